"""One row per part: a flat view of its record, for tables, terminal and counts; places count from 1."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from pipeline.common.reading_records import (
    CharacterRecord,
    CodeRecord,
    FieldRecord,
    LineRecord,
    ReadingRecord,
)

COLUMNS = (
    *("part", "text", "decision", "confidence", "source", "seconds", "error", "font", "height_mm"),
    *("rotation_deg", "raised", "flags", "alternatives", "depth_min_mm", "depth_mean_mm", "depths"),
    *("expected", "verdict", "verify_probability", "states", "rivals", "grade", "grades", "action"),
    *("height_px", "lines", "codes", "burr_mm", "fields", "at", "program", "settings", "accept_risk"),
)
"""Columns of a row; `row_of` makes those that are not fields of a record."""
WORTH_SHOWING = 0.01  # least probability of an alternative in a row
_UNGRADED = "?"
# in the order of a row; those of `recognition.decide.grade.Action`
_ACTIONS = ("clean", "clean first", "re-strike")


def row_of(record: ReadingRecord) -> dict[str, Any]:
    """Cells of one part, in the order of the columns: fields of `ReadingRecord` as they are, the others as short texts.

    Columns:
        flags: messages about the reading and about rules that the mark breaks.
        depth_min_mm, depth_mean_mm: least and mean depth of all characters; None if unknown.
        depths: least and mean depth of every character, mm, as "K 0.212/0.231 7 0.198/0.220"; "?" where not measured.
        states: places that are not plainly read, as "3:confused 8/B, 5:not read, 7:mismatch 1/7" (1 for 7).
        rivals: other possible serials with their probabilities, as "KB74 0.021, KB71 0.013".
        grade: mark quality, A to F, of the worst character; empty if none was graded.
        grades: grades of all characters, a letter each; "?" where too little was scanned.
        burr_mm: height of the highest rim beside a character's strokes; None if unknown.
    """

    places = record.characters
    least = [c.depth_min_mm for c in places if c.depth_min_mm is not None]
    means = [c.depth_mean_mm for c in places if c.depth_mean_mm is not None]
    burrs = [c.burr_mm for c in places if c.burr_mm is not None]
    grades = "".join(c.grade or _UNGRADED for c in places) if any(c.grade for c in places) else ""
    cells = {
        "height_mm": _round(record.height_mm, 4),
        "rotation_deg": round(record.rotation_deg, 3),
        "flags": "; ".join(record.messages),
        "alternatives": alternatives_text(places),
        "depth_min_mm": _round(min(least, default=None), 4),
        "depth_mean_mm": _round(sum(means) / len(means) if means else None, 4),
        "depths": _depths_text(places) if least or record.source != "vision" else "",
        "states": _states_text(places),
        "rivals": ", ".join(f"{r.text} {r.probability:.3f}" for r in record.rivals),
        "grade": max(grades.replace(_UNGRADED, ""), default=grades[:1]),
        "grades": grades,
        "action": action_text(places),
        "height_px": _round(record.height_px, 1),
        "lines": lines_text(record.lines),
        "codes": codes_text(record.codes),
        "burr_mm": _round(max(burrs, default=None), 4),
        "fields": fields_text(record.fields),
        "at": "" if record.at is None else record.at.isoformat(timespec="seconds"),
    }
    return {name: cells[name] if name in cells else getattr(record, name) for name in COLUMNS}


def _depths_text(places: Sequence[CharacterRecord]) -> str:
    return " ".join(
        f"{c.char} ?" if c.depth_min_mm is None else f"{c.char} {c.depth_min_mm:.3f}/{c.depth_mean_mm:.3f}"
        for c in places
    )


def lines_text(lines: Sequence[LineRecord]) -> str:
    """Other lines of a part: "lot=LOT77;date=12/26"; only the text of a line that the settings do not name."""
    return ";".join(f"{line.name}={line.text}" if line.name else line.text for line in lines)


def fields_text(fields: Sequence[FieldRecord]) -> str:
    """Fields by name: "MFR=0AB12;SER=KB74"."""
    return ";".join(f"{field.name}={field.value}" for field in fields)


def codes_text(codes: Sequence[CodeRecord]) -> str:
    """Codes of a part: "SER KB74 (same) | 4711 (other)"; a code without a serial has no remark."""
    words = {True: " (same)", False: " (other)", None: ""}
    return " | ".join(f"{code.text}{words[code.same]}" for code in codes)


def alternatives_text(places: Sequence[CharacterRecord]) -> str:
    """Each place's other candidates with their probabilities: "3: 8 0.21, B 0.02; 5: S 0.01"."""
    named = (
        (k, [f"{c.char} {c.probability:.2f}" for c in place.candidates[1:] if c.probability >= WORTH_SHOWING])
        for k, place in enumerate(places, start=1)
    )
    return "; ".join(f"{k}: {', '.join(others)}" for k, others in named if others)


def _states_text(places: Sequence[CharacterRecord]) -> str:
    return ", ".join(
        f"{k}:{state_text(c.state, c.state_chars)}"
        for k, c in enumerate(places, start=1)
        if c.state not in ("", "read")
    )


def state_text(state: str, chars: Sequence[str]) -> str:
    """State of a place: "read", "not read", "confused 8/B", or "mismatch 8/B" if there is an 8 in place of a B."""
    return f"{state} {'/'.join(c or '-' for c in chars)}".strip()


def action_text(places: Sequence[CharacterRecord]) -> str:
    """Actions with their places: "clean 3 5, re-strike 7"; empty without any."""
    actions: dict[str, list[str]] = {}
    for k, place in enumerate(places, start=1):
        if place.action:
            actions.setdefault(place.action, []).append(str(k))
    return ", ".join(
        f"{action} {' '.join(actions[action])}" for action in sorted(actions, key=_ACTIONS.index)
    )


def _round(value: float | None, digits: int) -> float | None:
    return None if value is None else round(value, digits)
