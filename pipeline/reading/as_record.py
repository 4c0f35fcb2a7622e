"""Convert a reading to the record that is stored and sent."""

from __future__ import annotations

import itertools
import math
from datetime import UTC, datetime
from typing import TYPE_CHECKING

from pipeline.common.reading_records import (
    Box,
    CandidateRecord,
    CharacterRecord,
    CodeRecord,
    FieldRecord,
    LineRecord,
    PassRecord,
    ReadingRecord,
    ReasonRecord,
    RivalRecord,
)
from pipeline.common.row import WORTH_SHOWING
from pipeline.common.settings import ReadSettings
from pipeline.common.version import key_of, program_version

if TYPE_CHECKING:
    from recognition.decide.reading import CharacterReading, OtherLine, Reading
    from recognition.language.box import Box as Hull
    from recognition.language.grammar import Grammar
    from recognition.language.lattice import Lattice
    from recognition.marks.grade import Action
    from recognition.see.codes import Code
    from whisker_array.scan.pass_log import PassLog

MOST_RIVALS = 3


def reading_record(
    reading: Reading, settings: ReadSettings, grammar: Grammar | None, *, part: str, seconds: float
) -> ReadingRecord:
    """Make the record of a reading; settings, grammar and seconds are those of the reading."""
    from recognition.decide.decision import bench_faults
    from recognition.decide.reasons import reasons_of

    verification, scaled = reading.trace.verification, reading.scaled
    scan = None if reading.touch is None else reading.touch.trace.scan
    log = None if scan is None else scan.log
    more = verification.messages() if verification is not None else ()
    height, reasons = _finite(reading.height_mm) or None, reasons_of(reading)
    return ReadingRecord(
        source=reading.source,
        text=reading.text,
        decision=reading.decision.value,
        confidence=_share(reading.confidence),
        characters=tuple(
            _character(c, action, scaled)
            for c, action in zip(reading.characters, reading.actions, strict=True)
        ),
        messages=tuple(dict.fromkeys((*(reason.text for reason in reasons), *more))),
        reasons=tuple(ReasonRecord(reason.code, reason.places) for reason in reasons if reason.code),
        font=reading.font,
        height_mm=height if scaled else None,
        rotation_deg=_finite(reading.rotation_deg),
        verdict="" if verification is None else verification.verdict.value,
        database=settings.database.stem if settings.database is not None else "",
        seconds=round(seconds, 4),
        at=datetime.now(UTC),
        part=part,
        height_px=None if scaled else height,
        raised=bool(reading.raised),
        expected="" if verification is None else verification.expected,
        verify_probability=None if verification is None else _share(verification.probability),
        rivals=rivals_of(reading, reading.trace.lattice, grammar),
        lines=tuple(_line(line, scaled) for line in reading.others),
        codes=tuple(_code(code, reading.text, scaled) for code in reading.codes),
        fields=tuple(FieldRecord(name, value) for name, value in reading.fields.items()),
        photos=reading.photos,
        program=program_version(),
        settings=key_of(settings.model_dump(mode="json", exclude_defaults=True)),
        passes=() if scan is None or log is None else _passes(log, scan.touch.preload_mm),
        stage_s=None if log is None else round(log.stage_s, 3),
        stopped="" if log is None else log.stopped,
        accept_risk=reading.accept_risk,
        faults=() if reading.touch is None else bench_faults(reading.touch.findings),
    )


def _passes(log: PassLog, usual_preload_mm: float) -> tuple[PassRecord, ...]:
    spent = itertools.accumulate(p.order.stage_s for p in log.passes)
    return tuple(
        PassRecord(
            direction_deg=int(felt.order.direction),
            line_mm=tuple(round(v, 4) for v in felt.order.line_mm),
            along_mm=(round(felt.order.along_mm[0], 4), round(felt.order.along_mm[1], 4)),
            speed_mm_s=felt.order.speed_mm_s,
            preload_mm=usual_preload_mm if felt.order.preload_mm is None else felt.order.preload_mm,
            stage_s=round(stage_s, 3),
            why=felt.why,
            text=felt.text,
            confidence=_share(felt.confidence),
        )
        for felt, stage_s in zip(log.passes, spent, strict=True)
    )


def rivals_of(reading: Reading, lattice: Lattice | None, grammar: Grammar | None) -> tuple[RivalRecord, ...]:
    """Other serials that the format allows, by the posteriors that the reading was chosen from."""
    from recognition.language.constrained_decoding import choose

    if lattice is None or not reading.characters:
        return ()
    choice = choose(lattice, grammar, k=MOST_RIVALS + 1)
    read = "".join(c.char for c in reading.characters)
    named = [(choice.text, choice.probability), *((r.text, r.probability) for r in choice.rivals)]
    others = [RivalRecord(t, _share(p)) for t, p in named if t and t != read and p >= WORTH_SHOWING]
    return tuple(others[:MOST_RIVALS])


def _character(character: CharacterReading, action: Action, scaled: bool) -> CharacterRecord:
    state, grade, depth = character.state, character.grade, character.depth
    return CharacterRecord(
        candidates=tuple(
            CandidateRecord(c.char, _share(c.probability), _finite(c.score)) for c in character.candidates
        ),
        **_box(character.box, scaled),
        state="" if state is None else state.state.value,
        grade="" if grade is None else grade.letter,
        state_chars=() if state is None else state.chars,
        action="" if action.value == "none" else action.value,
        depth_min_mm=None if depth is None else _finite(depth.min_mm),
        depth_mean_mm=None if depth is None else _finite(depth.mean_mm),
        depth_sd_mm=None if depth is None or depth.sd_mm is None else _finite(depth.sd_mm),
        burr_mm=None if depth is None or depth.burr_mm is None else _finite(depth.burr_mm),
        no_depth="" if character.no_depth is None else character.no_depth.value,
    )


def _line(line: OtherLine, scaled: bool) -> LineRecord:
    return LineRecord(line.name, line.text, _share(line.confidence), **_box(line.box, scaled))


def _code(code: Code, serial: str, scaled: bool) -> CodeRecord:
    from recognition.language.code_text import holds

    same = holds(code.text, serial) if serial else None
    return CodeRecord(code.kind, code.text, same, **_box(code.box, scaled))


def _box(box: Hull | None, scaled: bool) -> dict[str, Box | None]:
    if box is None:
        return {}
    corners = (_finite(box.x0_mm), _finite(box.y0_mm), _finite(box.x1_mm), _finite(box.y1_mm))
    return {"box_mm": corners if scaled else None, "box_px": None if scaled else corners}


def _share(value: float) -> float:
    return min(1.0, max(0.0, _finite(value)))


def _finite(value: float) -> float:
    number = float(value)
    return round(number, 6) if math.isfinite(number) else 0.0
