"""How much of each soil makes a severity: as much as costs a fixed reader what the workshop's dirt costs it.

    parts, stamped once --each soil, each amount--> ideal heights of the line --RapidOCR's network--> loss
    mean loss, made monotone: workshop at each knot of severity --> amount of every other soil with that loss

The reader is a generic one that nobody here trained, and it is shown the heights as they are: nothing of touch or
camera comes in. It knows that there are A-Z and 0-9, and how many characters. Its loss is the belief that it lacks in
the true characters: one less their posterior probability, mean over the characters. That moves with the first dirt,
long before a character is read wrongly; the share of characters that are wrong is kept beside it.

Run `python tests/benchmarks/soil_severity.py --write` after a change of a soil.
"""

from __future__ import annotations

import json
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import date
from importlib.metadata import version
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from rapidfuzz.distance import Levenshtein

from glyphs.fonts.outlines import SERIAL_CHARACTERS
from glyphs.part import stamp
from glyphs.soiling.coat import bare_coat
from glyphs.soiling.severity import KNOTS, MANIFEST
from glyphs.soiling.soiled import WORKSHOP
from glyphs.soiling.soils import SOILS, soil_model
from glyphs.surface.maps import HeightMap
from pipeline.benchmark.exam.design import design_named
from pipeline.benchmark.exam.designed_parts import hull
from pipeline.benchmark.exam.font_packages import font_file, font_mark
from pipeline.benchmark.readers.peers import RapidOcr
from pipeline.benchmark.readers.pictures import heights_picture
from pipeline.workers.executors import ordered_map
from pipeline.workers.pool import WorkPool
from recognition.recogniser.ctc import place_belief

EDITION: Final = "marks-exam-1-1600"
"""Whose fonts are used; never those of a section that is kept out."""
HEIGHTS_MM: Final = (2.0, 3.5, 5.0, 8.0, 12.0)
FORMAT: Final = "********"
SEED, CHECK_SEED = 4101, 4102
"""Of the parts that the amounts are fitted to, and of those that they are checked on."""
GRID: Final = (0.0, 0.05, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.9, 1.0)
"""Amounts that are tried of every soil but the workshop's."""
CHECKED: Final = (0.0, 0.3, 0.6, 0.9)
"""Severities at which other parts are looked at."""
Curves = dict[str, NDArray[np.float64]]


@dataclass(frozen=True)
class Task:
    """One part, soiled again and again.

    Attributes:
        seed: of its kind.
        number: among the parts of that seed.
        fonts: names or files, taken in turn.
        amounts: of each soil, tried one after the other.
    """

    seed: int
    number: int
    fonts: tuple[str, ...]
    amounts: Mapping[str, tuple[float, ...]]


def losses_of(task: Task) -> Curves:
    """(amounts, 2) of each soil: the loss, and the share of characters that are read wrongly."""
    key = (task.seed, task.number)
    part = stamp(
        format=FORMAT,
        fonts=task.fonts[task.number % len(task.fonts)],
        height_mm=HEIGHTS_MM[task.number % len(HEIGHTS_MM)],
        seed=key,
    ).stamped
    bare = bare_coat(part, rng=np.random.default_rng([*key, 1]))
    reader, box = RapidOcr(SERIAL_CHARACTERS), hull(part.boxes_mm)
    found = {}
    for soil, amounts in task.amounts.items():
        losses = []
        for amount in amounts:
            z = bare.z_mm
            if amount > 0.0:
                z = soil_model(soil)(bare, amount, rng=np.random.default_rng([*key, 2])).z_mm
            picture = heights_picture(HeightMap(z, bare.pitch_mm), box)
            losses.append(_loss(reader, picture, part.text))
        found[soil] = np.array(losses)
    return found


def _loss(reader: RapidOcr, picture: NDArray[np.uint8], text: str) -> tuple[float, float]:
    beliefs = reader.beliefs(picture).astype(np.float64)
    columns = [reader.classes.index(char) for char in SERIAL_CHARACTERS]
    with np.errstate(divide="ignore"):
        logs = np.log(beliefs)
    allowed = np.ones((len(text), len(columns)), dtype=np.bool_)
    places = place_belief(logs[:, 0], logs[:, columns], allowed)
    true = [SERIAL_CHARACTERS.index(char) for char in text]
    belief = 0.0 if places is None else np.exp(places.log_belief[np.arange(len(true)), true]).mean()
    read = "".join(char for char, _ in reader.read_line(picture, ()))
    return float(1.0 - belief), min(1.0, Levenshtein.distance(text, read) / len(text))


def measured(tasks: list[Task], *, jobs: int) -> Curves:
    """(parts, amounts, 2) of each soil."""
    with WorkPool(jobs) as pool:
        found = list(ordered_map(pool, losses_of, tasks))
    return {soil: np.stack([each[soil] for each in found]) for soil in found[0]}


def rising(amounts: tuple[float, ...], losses: NDArray[np.float64]) -> NDArray[np.float64]:
    """The rising curve that comes closest to mean losses (amounts,)."""
    from sklearn.isotonic import IsotonicRegression

    return np.asarray(IsotonicRegression().fit_transform(amounts, losses), dtype=np.float64)


def amount_with(target: float, amounts: tuple[float, ...], losses: NDArray[np.float64]) -> float:
    """The least amount with that loss, along a rising curve; the largest amount where none costs so much."""
    first = int(np.searchsorted(losses, target))
    if first == 0:
        return amounts[0]
    if first == len(amounts):
        return amounts[-1]
    return float(np.interp(target, losses[first - 1 : first + 1], amounts[first - 1 : first + 1]))


def fitted(curves: Curves) -> dict[str, tuple[float, ...]]:
    """Amount of every soil but the workshop's at each knot."""
    targets = rising(KNOTS, curves[WORKSHOP][..., 0].mean(axis=0))
    table = {}
    for soil, losses in curves.items():
        if soil != WORKSHOP:
            curve = rising(GRID, losses[..., 0].mean(axis=0))
            inner = (amount_with(target, GRID, curve) for target in targets[1:])
            table[soil] = (0.0, *(round(amount, 4) for amount in inner))
    return table


def main(*, parts: int = 60, jobs: int = 2, write: bool = False) -> None:
    """Measure, print the table and, if asked to, keep it.

    Args:
        parts: that the amounts are fitted to; as many others are looked at afterwards.
        jobs: processes.
        write: keep the table and how it came about in the file that `glyphs.soiling.severity` reads.
    """
    design = design_named(EDITION)
    names = [
        str(font)
        for section in design.all_sections()
        if not section.kept_out
        for font in {**design.part, **section.part}["font"]
    ]
    names = list(dict.fromkeys(names))
    fonts = tuple(str(font_file(name, design.fonts)) for name in names)

    def run(seed: int, amounts: Mapping[str, tuple[float, ...]]) -> Curves:
        return measured([Task(seed, number, fonts, amounts) for number in range(parts)], jobs=jobs)

    curves = run(SEED, {soil: KNOTS if soil == WORKSHOP else GRID for soil in SOILS})
    table = fitted(curves)
    amounts = {
        soil: tuple(float(np.interp(s, KNOTS, table.get(soil, KNOTS))) for s in CHECKED) for soil in SOILS
    }
    checks = run(CHECK_SEED, amounts)
    manifest = {
        "what": "amounts of each soil at the knots of severity (glyphs/soiling/severity.py)",
        "command": f"python tests/benchmarks/soil_severity.py --parts {parts} --write",
        "made": date.today().isoformat(),
        "commit": _commit(),
        "editions": {EDITION: "fonts of the sections that are not kept out"},
        "fonts": [font_mark(name, design.fonts) for name in names],
        "soils": list(SOILS),
        "heights_mm": HEIGHTS_MM,
        "format": FORMAT,
        "seeds": {"fit": SEED, "check": CHECK_SEED},
        "parts": parts,
        "versions": {name: version(name) for name in ("numpy", "rapidocr", "onnxruntime", "scikit-learn")},
        "reader": "RapidOCR's recognition network on the ideal height map",
        "fit": {soil: _summary(KNOTS if soil == WORKSHOP else GRID, c) for soil, c in curves.items()},
        "knots": KNOTS,
        "amounts": table,
        "cannot_lose_as_much": _short(curves),
        "check": {soil: {"severity": CHECKED, **_summary(amounts[soil], c)} for soil, c in checks.items()},
        "check_less_workshop": {
            soil: np.round((c - checks[WORKSHOP])[..., 0].mean(axis=0), 4).tolist()
            for soil, c in checks.items()
        },
    }
    _show(table, checks)
    if write:
        MANIFEST.write_text(json.dumps(manifest, indent=1) + "\n", encoding="utf-8")


def _summary(amounts: tuple[float, ...], losses: NDArray[np.float64]) -> dict[str, Any]:
    mean = losses.mean(axis=0)
    return {
        "amount": [round(amount, 4) for amount in amounts],
        "loss": np.round(mean[:, 0], 4).tolist(),
        "standard_error": np.round(losses[..., 0].std(axis=0) / np.sqrt(len(losses)), 4).tolist(),
        "characters_wrong": np.round(mean[:, 1], 4).tolist(),
    }


def _short(curves: Curves) -> dict[str, dict[str, float]]:
    """By how much a soil at amount 1 falls short of a knot's loss."""
    targets = rising(KNOTS, curves[WORKSHOP][..., 0].mean(axis=0))
    short: dict[str, dict[str, float]] = {}
    for soil, losses in curves.items():
        most = float(rising(GRID, losses[..., 0].mean(axis=0))[-1]) if soil != WORKSHOP else np.inf
        for knot, target in zip(KNOTS, targets, strict=True):
            if target > most:
                short.setdefault(soil, {})[f"{knot:g}"] = round(float(target - most), 4)
    return short


def _show(table: Mapping[str, tuple[float, ...]], checks: Curves) -> None:
    from rich.console import Console
    from rich.table import Table

    shown = Table(title="Amount at each severity, and on other parts: loss (characters wrong)")
    for heading in ("soil", *(f"{knot:g}" for knot in KNOTS), *(f"at {s:g}" for s in CHECKED)):
        shown.add_column(heading)
    for soil, losses in checks.items():
        found = (f"{loss:.3f} ({wrong:.0%})" for loss, wrong in losses.mean(axis=0))
        shown.add_row(soil, *(f"{amount:.3f}" for amount in table.get(soil, KNOTS)), *found)
    Console(width=160).print(shown)


def _commit() -> str:
    said = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], cwd=MANIFEST.parent, capture_output=True, text=True
    )
    return said.stdout.strip() or "not known"


if __name__ == "__main__":
    from cyclopts import run

    run(main)
