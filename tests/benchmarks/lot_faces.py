"""Whether a lot is read better with the shapes learned from its own accepted parts.

    python -m tests.benchmarks.lot_faces FONT... [--parts 24] [--severity 0.6] --out lots.jsonl

Each font is the die of one lot, felt, its format given, the soils mixed; a font counts only if neither the library of
faces nor the recogniser has learned it. As `read` does, accepted parts are enrolled, and the others read again with the
learned font. What is in the file already is not done again.
"""

from __future__ import annotations

import json
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from glyphs.errors import MarksError
from glyphs.soiling.soiled import Soiling
from glyphs.soiling.soils import SOILS
from pipeline.common.settings import ReadSettings
from pipeline.common.texts import without_blanks
from pipeline.formats.part_files import PartFiles
from pipeline.formats.synth import SynthSpec, write_part
from pipeline.reading.enrolment import enrol
from pipeline.reading.part_job import PartJob, reading_of
from pipeline.runs.lot import LEAST_AGREEMENT, Outline, is_better, needs_another, teachers
from recognition.decide.evidence import EVEN
from recognition.decide.reading import Reading

FORMAT = "AA999999"


def log_losses(reading: Reading, text: str) -> list[float]:
    """Minus log posterior of the true character of each place; empty if the line has another number of places."""
    lattice = reading.trace.lattice
    if lattice is None or lattice.log_belief.shape[0] != len(text):
        return []
    return [
        -max(float(row[lattice.chars.index(char)]), np.log(1e-6))
        for row, char in zip(lattice.log_belief, text, strict=True)
    ]


def facts_of(reading: Reading, text: str, name: str) -> tuple[Outline, dict[str, Any]]:
    """What decides about a second reading, and what is kept of a reading."""
    outline = Outline(name, reading.decision.value, without_blanks(reading.text), reading.confidence)
    return outline, {**outline._asdict(), "true": text, "losses": log_losses(reading, text)}


def read_lot(font: Path, *, parts: int, severity: float, seed: int) -> dict[str, Any]:
    """Read a lot once, and what was not accepted again with the shapes of what was."""
    with tempfile.TemporaryDirectory() as folder:
        files, texts = list[PartFiles](), dict[str, str]()
        for number in range(parts):
            soil = list(SOILS)[number % len(SOILS)]
            spec = SynthSpec(seed=seed, soiling=Soiling((soil,), severity), format=FORMAT, font=str(font))
            stem = Path(folder) / f"part-{number:03d}"
            texts[stem.name] = write_part(spec, stem, number, photos=False)
            files.append(PartFiles(stem.name, height_map=str(stem.with_suffix(".npz"))))
        settings = ReadSettings(format=(FORMAT,), mode="tactile", accept_risk=0.01)
        start = time.process_time()
        first = {
            part.name: facts_of(reading_of(PartJob(part, settings)), texts[part.name], part.name)
            for part in files
        }
        first_s = time.process_time() - start
        chosen = teachers(outline for outline, _ in first.values())
        row: dict[str, Any] = {
            "font": font.stem,
            "first": [facts for _, facts in first.values()],
            "second": [],
        }
        database = Path(folder) / "lot.glyphs"
        try:
            report = enrol(
                [replace(part, expected=chosen[part.name]) for part in files if part.name in chosen],
                database,
                font="lot-die",
                settings=settings,
                vouching=False,
            )
        except MarksError as error:
            return row | {"learned": str(error)}
        row["learned"] = f"{report.exemplars} exemplars of {report.felt}, agreement {report.agreement:.2f}"
        if not report.exemplars or report.agreement < LEAST_AGREEMENT:
            return row
        with_shapes = settings.model_copy(update={"database": database, "font": ("lot-die",)})
        start = time.process_time()
        for part in files:
            before = first[part.name][0]
            if needs_another(before):
                other = before.text if before.confidence > EVEN else ""
                job = PartJob(replace(part, other_text=other), with_shapes)
                outline, facts = facts_of(reading_of(job), texts[part.name], part.name)
                row["second"].append(facts | {"taken": is_better(outline, before)})
        return row | {"first_s": first_s, "second_s": time.process_time() - start}


def table(row: dict[str, Any]) -> list[str]:
    """Lines for a person: accepted, right and wrong of the lot, and the log loss of the parts read twice."""
    first = {facts["part"]: facts for facts in row["first"]}
    again = {facts["part"]: facts for facts in row["second"]}
    both = first | {part: facts for part, facts in again.items() if facts["taken"]}
    lines = [f"{row['font']}: {row['learned']}"]
    for name, readings in (("first", first), ("with the second", both)):
        right = [facts["text"] == facts["true"] for facts in readings.values()]
        accepted = [facts["decision"] == "accept" for facts in readings.values()]
        wrong = sum(taken and not ok for taken, ok in zip(accepted, right, strict=True))
        lines.append(f"  {name:16} right {sum(right)} accepted {sum(accepted)} wrong {wrong} of {len(first)}")
    pairs = [(first[part]["losses"], facts["losses"]) for part, facts in again.items()]
    pairs = [(before, after) for before, after in pairs if before and after]
    if pairs:
        before, after = (float(np.mean(np.concatenate(side))) for side in zip(*pairs, strict=True))
        lines.append(f"  log loss of a character, {len(pairs)} parts read twice: {before:.3f} -> {after:.3f}")
    return lines


def main(
    *fonts: Path, parts: int = 24, severity: float = 0.6, seed: int = 7, out: Path = Path("lots.jsonl")
) -> None:
    """Read lots, and print how.

    Args:
        fonts: font files, each the die of one lot.
        parts: parts of a lot.
        severity: severity of the dirt.
        seed: seed of the parts.
        out: where each lot is kept.
    """
    rows = [json.loads(line) for line in out.read_text().splitlines()] if out.exists() else []
    for font in fonts:
        if font.stem not in {row["font"] for row in rows}:
            rows.append(read_lot(font, parts=parts, severity=severity, seed=seed))
            with out.open("a") as kept:
                kept.write(json.dumps(rows[-1]) + "\n")
        print(*table(next(row for row in rows if row["font"] == font.stem)), sep="\n", flush=True)


if __name__ == "__main__":
    from cyclopts import run

    run(main)
