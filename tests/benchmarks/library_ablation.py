"""Read whole parts with smaller libraries of faces, without one, and without fitted weights::

    python tests/benchmarks/library_ablation.py DRAWN --out READINGS --step 5 --below 5000

DRAWN is the folder of `risk_parts.py draw`. Each part is read once by every variant: by touch, its format given, no
font named. Parts in fonts that library, recogniser or finder have learned are left out. The command prints the tables
of all parts in READINGS, so a run that was stopped goes on where it ended. `fit_experts.py` has such a table for
characters.

Variants without fitted weights, with n the recogniser's posterior at a place, and m that of the faces alone
(`believe_faces`, with its fitted sharpness):

    no library, sharper    log p = 1.25 log n    up to a constant
    half and half          log p = (log n + log m) / 2
    product                log p = log n + log m

The power 1.25 is the recogniser's usual weight beside the faces, fitted to lines of other parts.
"""

from __future__ import annotations

import os
import pickle
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
from numpy.typing import NDArray

from glyphs.atomic import replacing
from glyphs.errors import MarksError
from pipeline.benchmark.analysis.confidence import risk_coverage
from pipeline.benchmark.analysis.estimates import Estimate, draw_parts, mcnemar, ratio, resample
from recognition import touch
from recognition.decide.decision import BROKEN, Decision
from recognition.decide.reading import Reading
from recognition.glyph_match import faces
from recognition.glyph_match.combine import ExpertWeights, fitted_weights
from recognition.glyph_match.face_library import FaceLibrary, Sense, face_library
from recognition.reader import Reader
from recognition.recogniser.steps import EXPERTS
from tests.benchmarks.drawn_parts import DrawnPart, KeptSweeps, load_part, unread_parts
from tests.benchmarks.fit_experts import loss_of
from tests.benchmarks.kept_readings import is_learned

MOST_LOSS = 9.0
"""Loss of a character of a line that was not read, nats: the greatest of `loss_of`."""
WRONG = (1, 3, 5)
"""Right readings are counted down to the first, third and fifth wrong one."""


@dataclass(frozen=True)
class Variant:
    """A reader with one part of it changed."""

    name: str
    faces: int = 80  # size of the library
    experts: tuple[str, ...] = EXPERTS
    powers: tuple[float, float] | None = (
        None  # of the posteriors of recogniser and faces; None: fitted weights
    )

    @contextmanager
    def in_place(self) -> Iterator[None]:
        """Within the block, touch reads with this library and these weights."""

        def library(sense: Sense) -> FaceLibrary:
            whole = face_library(sense)
            return replace(whole, faces=whole.faces.of(np.arange(self.faces)))

        def weights(sense: str) -> ExpertWeights:
            fitted = fitted_weights(sense)
            if self.powers is None:
                return fitted
            network, faces = self.powers
            return replace(fitted, network=network, network_fit=0.0, faces=faces, faces_fit=0.0)

        with (
            mock.patch.object(touch, "face_library", library),
            mock.patch.object(faces, "fitted_weights", weights),
        ):
            yield


WHOLE = Variant("80 faces")
VARIANTS = (
    Variant("no library", experts=("network",)),
    Variant("no library, sharper", powers=(1.25, 0.0)),
    Variant("10 faces", faces=10),
    Variant("40 faces", faces=40),
    WHOLE,
    Variant("80 faces, half and half", powers=(0.5, 0.5)),
    Variant("80 faces, product", powers=(1.0, 1.0)),
)


@dataclass(frozen=True)
class VariantReading:
    """What a variant read of a part."""

    text: str
    right: bool
    score: float  # 0 if a contract is broken: such a reading is never accepted
    accepted: bool
    losses: NDArray[np.float64]

    @classmethod
    def of(cls, reading: Reading, truth: str) -> VariantReading:
        """Compare a reading with the true text."""
        lattice, losses = reading.trace.lattice, np.full(len(truth), MOST_LOSS)
        if lattice is not None and lattice.n_places == len(truth):
            losses = loss_of(lattice.log_belief, np.array([lattice.chars.index(char) for char in truth]))
        return cls(
            text=reading.plain_text,
            right=reading.plain_text == truth,
            score=0.0 if reading.flags & BROKEN else reading.confidence,
            accepted=reading.decision is Decision.ACCEPT,
            losses=losses,
        )


@dataclass(frozen=True)
class AblatedPart:
    """A part, and its readings by variant."""

    generator: str
    severity: float
    font: str
    readings: Mapping[str, VariantReading]

    @classmethod
    def of(cls, plain: Mapping[str, Any]) -> AblatedPart:
        """A part that was kept."""
        readings = {name: VariantReading(**reading) for name, reading in plain["readings"].items()}
        return cls(**{**plain, "readings": readings})

    @property
    def plain(self) -> dict[str, Any]:
        """The part without classes of its own, to be kept."""
        return {**vars(self), "readings": {name: vars(reading) for name, reading in self.readings.items()}}


@cache
def reader_of(format: str, experts: tuple[str, ...]) -> Reader:
    """The reader of a format; it keeps what it has compiled and predicted."""
    return Reader(format=format, experts=experts, accept_risk=0.01)


def read_variants(part: DrawnPart, sweeps: KeptSweeps) -> AblatedPart:
    """Read a part by every variant. Raises MarksError."""
    readings = {}
    for variant in VARIANTS:
        reader = reader_of(part.format, variant.experts)
        with variant.in_place(), sweeps.in_place_of_simulation():
            reading = reader.read(part.height_map, soil=part.soil_layer)
        readings[variant.name] = VariantReading.of(reading, part.text)
    return AblatedPart(part.generator, part.severity, part.font, readings)


def right_above_wrong(readings: Sequence[VariantReading], wrong: int) -> int:
    """Number of right readings whose score is above that of all wrong ones but the `wrong - 1` highest."""
    scores = sorted((reading.score for reading in readings if not reading.right), reverse=True)
    least = scores[wrong - 1] if len(scores) >= wrong else -1.0
    return sum(reading.right and reading.score > least for reading in readings)


def area_difference(readings: Sequence[VariantReading], others: Sequence[VariantReading]) -> Estimate:
    """Difference of the areas under the risk-coverage curves, with its interval from resampling parts."""
    both = [
        (np.array([reading.score for reading in of]), np.array([reading.right for reading in of]))
        for of in (readings, others)
    ]

    def difference(chosen: NDArray[np.intp]) -> float:
        first, second = (risk_coverage(scores[chosen], right[chosen]).area for scores, right in both)
        return first - second

    every = np.arange(len(readings))
    again = [difference(np.repeat(every, counts.astype(np.intp))) for counts in draw_parts(len(readings))]
    low, high = np.quantile(again, (0.025, 0.975))
    return Estimate(difference(every), float(low), float(high))


def loss_difference(readings: Sequence[VariantReading], others: Sequence[VariantReading]) -> Estimate:
    """Difference of the mean log losses of a character, with its interval from resampling parts."""
    rows = [
        (one.losses.sum() - other.losses.sum(), one.losses.size)
        for one, other in zip(readings, others, strict=True)
    ]
    return resample(np.array(rows, dtype=np.float64), ratio, least=-1.0)


def summary_table(parts: Sequence[AblatedPart]) -> Iterator[str]:
    """Readings of each variant; Markdown."""
    ordinals = ", ".join(f"{count}." for count in WRONG)
    yield (
        "| variant | parts | serials right | log loss of a character | AURC "
        f"| right ones above the {ordinals} wrong one | accepted, wrong of these |"
    )
    yield "|" + "---|" * 7
    for name in (variant.name for variant in VARIANTS):
        readings = [part.readings[name] for part in parts]
        area = risk_coverage([r.score for r in readings], [r.right for r in readings]).area
        above = ", ".join(str(right_above_wrong(readings, wrong)) for wrong in WRONG)
        accepted = [reading for reading in readings if reading.accepted]
        yield (
            f"| {name} | {len(readings)} | {sum(r.right for r in readings)} "
            f"| {np.concatenate([r.losses for r in readings]).mean():.4f} | {area:.4f} | {above} "
            f"| {len(accepted)}, {sum(not r.right for r in accepted)} |"
        )


def pair_table(parts: Sequence[AblatedPart]) -> Iterator[str]:
    """Each variant against all faces on the same parts; Markdown."""
    yield (
        f"| instead of {WHOLE.name} | serials won, lost (p) | accepted won, lost (p) "
        "| log loss, difference (95 %) | AURC, difference (95 %) |"
    )
    yield "|" + "---|" * 5
    whole = [part.readings[WHOLE.name] for part in parts]
    for name in _others():
        readings = [part.readings[name] for part in parts]
        differences = (loss_difference(readings, whole), area_difference(readings, whole))
        cells = (
            _won_and_lost(readings, whole, lambda reading: reading.right),
            _won_and_lost(readings, whole, lambda reading: reading.accepted and reading.right),
            *(f"{d.value:+.4f} ({d.low:+.4f} to {d.high:+.4f})" for d in differences),
        )
        yield f"| {name} | {' | '.join(cells)} |"


def group_table(parts: Sequence[AblatedPart], field: str) -> Iterator[str]:
    """Serials right and log loss by a fact of the parts, and serials won and lost; Markdown."""
    groups = {
        value: [part for part in parts if getattr(part, field) == value]
        for value in sorted({getattr(part, field) for part in parts})
    }
    yield f"| variant | {' | '.join(f'{field} {value} ({len(own)})' for value, own in groups.items())} |"
    yield "|" + "---|" * (len(groups) + 1)
    for name in (WHOLE.name, *_others()):
        cells = []
        for own in groups.values():
            readings, whole = ([part.readings[key] for part in own] for key in (name, WHOLE.name))
            loss = np.concatenate([reading.losses for reading in readings]).mean()
            pair = "" if name == WHOLE.name else f"; {_won_and_lost(readings, whole, lambda r: r.right)}"
            cells.append(f"{sum(reading.right for reading in readings)}, {loss:.3f}{pair}")
        yield f"| {name} | {' | '.join(cells)} |"


def _others() -> list[str]:
    return [variant.name for variant in VARIANTS if variant != WHOLE]


def _won_and_lost(
    readings: Sequence[VariantReading],
    others: Sequence[VariantReading],
    is_good: Callable[[VariantReading], bool],
) -> str:
    test = mcnemar([is_good(reading) for reading in readings], [is_good(reading) for reading in others])
    return f"{test.only_first}, {test.only_second} ({test.p_differ:.2g})"


def main(
    drawn: Path, *, out: Path, first: int = 0, step: int = 1, below: int = 100_000, hours: float = 2.0
) -> None:
    """Read drawn parts by every variant, and print the tables.

    Args:
        drawn: folder of the drawn parts.
        out: folder of the readings.
        first: number of the first part.
        step: distance of the numbers; an odd one, so that all generators occur.
        below: number at which the parts end.
        hours: time after which no part is begun.
    """
    os.nice(19)
    for source, target in unread_parts(drawn, out, first=first, step=step, hours=hours):
        if int(source.stem) >= below:
            break
        part, sweeps = load_part(source)
        if is_learned(part.font):
            print(f"part {part.number}: {part.font} was learned", flush=True)
            continue
        try:
            kept = read_variants(part, sweeps)
        except MarksError as error:
            print(f"part {part.number}: {error}", flush=True)
            continue
        with replacing(target) as temporary:
            temporary.write_bytes(pickle.dumps(kept.plain))
    parts = [AblatedPart.of(pickle.loads(path.read_bytes())) for path in sorted(out.glob("*.pkl"))]
    fonts = len({part.font for part in parts})
    print(f"{len(parts)} parts in {fonts} font files")
    tables = (summary_table(parts), pair_table(parts))
    for table in (*tables, group_table(parts, "severity"), group_table(parts, "generator")):
        print("", *table, sep="\n", flush=True)


if __name__ == "__main__":
    from cyclopts import run

    run(main)
