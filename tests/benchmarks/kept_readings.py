"""Readings of known parts in one compressed file, so that a new score needs no new reading::

    python tests/benchmarks/kept_readings.py READINGS [--same-reader FILE [--with-format]]

READINGS is the folder of `risk_parts.py`. The further parts of FILE, which the same reader read, count as well; if what
is read without a format has changed, only those with one. Of each part the file keeps what score and weights of fusion
may depend on: truth and texts, generator, font, dirt, the posteriors at every place by touch and by camera, and named
measures. `fit_score.py` fits from this file.
"""

from __future__ import annotations

import json
import pickle
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from recognition.decide.decision import BROKEN, ReadingFlag
from recognition.decide.score import Measure
from recognition.find import finder
from recognition.glyph_match import face_library
from recognition.language.constrained_decoding import Choice, choose
from recognition.language.grammar import Grammar
from recognition.language.lattice import Lattice
from recognition.learning.training_fonts import family
from recognition.recogniser import recogniser
from recognition.recogniser.read_line import with_slip
from tests.benchmarks.risk_parts import SOILS

KEPT = Path(__file__).with_name("readings.npz")
CHARS = "#&()-./0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZ"
SENSES = ("tactile", "vision")
MEASURES = {
    "tactile": (
        Measure.FORMAT, Measure.EVIDENCE, Measure.COVERED, Measure.STROKES, Measure.LEAST_STROKES,
        Measure.FINE_SHARE, Measure.COARSE_SHARE,
    ),
    "vision": (Measure.FORMAT, Measure.GRAIN, Measure.PATCHES),
    "fused": (Measure.EVIDENCE, Measure.COVERED),
}  # fmt: skip
"""Measures that are kept of each source of readings."""
CONTRACTS = BROKEN & ~(ReadingFlag.SENSES_DISAGREE | ReadingFlag.RISK_NOT_KEPT)
"""Contracts of a reading by itself; what depends on the score is judged anew."""


@dataclass(frozen=True, eq=False)
class KeptReading:
    """What one source read.

    Attributes:
        text: text without blanks; empty if nothing was read.
        broken: whether a contract is broken.
        count_probability: probability of the number of places; 1 with a format.
        measures: known measures.
        recognised: posteriors of all experts at each place; None if nothing was read, and of a fused reading.
        grammar: format of the part; None if it was read without.
    """

    text: str
    broken: bool
    count_probability: float
    measures: Mapping[Measure, float]
    recognised: Lattice | None
    grammar: Grammar | None

    @cached_property
    def lattice(self) -> Lattice | None:
        """Posteriors as the reader combines them."""
        return None if self.recognised is None else with_slip(self.recognised)

    @cached_property
    def choice(self) -> Choice | None:
        """The text that the format allows, and its rivals."""
        return None if self.lattice is None else choose(self.lattice, self.grammar)


@dataclass(frozen=True, eq=False)
class KeptPart:
    """A part with a known text, and its readings.

    Attributes:
        number: number of the part (`risk_parts.draw_part`).
        generator: generator that drew it.
        font: font of its marks.
        severity: severity of its dirt.
        format: format that the reader was given; empty for none.
        text: text on the part.
        readings: readings by source.
    """

    number: int
    generator: str
    font: str
    severity: float
    format: str
    text: str
    readings: Mapping[str, KeptReading]


def pack(parts: Sequence[Mapping[str, Any]]) -> dict[str, NDArray[Any]]:
    """Convert readings of `risk_parts.py` to the arrays of the file."""
    columns: dict[str, NDArray[Any]] = {
        name: np.array([part[name] for part in parts])
        for name in ("number", "generator", "font", "severity", "format", "text")
    }
    columns["severity"] = columns["severity"].astype(np.float32)
    for source, names in MEASURES.items():
        readings = [part["readings"][source] for part in parts]
        columns[f"{source}_text"] = np.array([reading["text"] for reading in readings])
        columns[f"{source}_broken"] = np.array([_breaks(reading["flags"]) for reading in readings])
        columns[f"{source}_measures"] = np.array(
            [[reading["measures"].get(name.name, np.nan) for name in names] for reading in readings],
            dtype=np.float32,
        )
        if source in SENSES:
            rows = [_rows(reading) for reading in readings]
            columns[f"{source}_places"] = np.array([len(row) for row in rows], dtype=np.uint8)
            columns[f"{source}_log"] = np.concatenate(rows)
            columns[f"{source}_count"] = np.array([_count(r) for r in readings], dtype=np.float32)
    return columns


def _breaks(flags: Sequence[str]) -> bool:
    return any(ReadingFlag[name] & CONTRACTS for name in flags)


def _rows(reading: Mapping[str, Any]) -> NDArray[np.float16]:
    """(places, CHARS) log posteriors of all experts; no row if nothing was read."""
    if not reading["text"] or "together" not in reading["lattices"]:
        return np.zeros((0, len(CHARS)), dtype=np.float16)
    chars, log = reading["lattices"]["together"]
    rows = np.full((len(log), len(CHARS)), -np.inf, dtype=np.float16)
    rows[:, [CHARS.index(char) for char in chars]] = log
    return rows


def _count(reading: Mapping[str, Any]) -> float:
    """Probability of the number of places: that of the text with it, divided by that without."""
    odds, probability = reading["odds"], reading["probability"]
    if odds is None or not probability or odds > 30.0:
        return 1.0
    return float(min(1.0, 1.0 / (1.0 + np.exp(-odds)) / probability))


def load(path: Path = KEPT) -> tuple[KeptPart, ...]:
    """Load the kept parts."""
    with np.load(path) as archive:
        columns = {name: archive[name] for name in archive.files}
    readings = {source: _readings(columns, source) for source in MEASURES}
    return tuple(
        KeptPart(
            int(columns["number"][k]),
            str(columns["generator"][k]),
            str(columns["font"][k]),
            round(float(columns["severity"][k]), 3),
            str(columns["format"][k]),
            str(columns["text"][k]),
            {source: of_source[k] for source, of_source in readings.items()},
        )
        for k in range(columns["number"].size)
    )


def _readings(columns: Mapping[str, NDArray[Any]], source: str) -> list[KeptReading]:
    names, values = MEASURES[source], columns[f"{source}_measures"].astype(np.float64)
    total = len(values)
    places = columns.get(f"{source}_places", np.zeros(total, dtype=np.intp)).astype(np.intp)
    ends = np.cumsum(places)
    grammars = {format: Grammar(format=format) for format in set(columns["format"].tolist()) if format}
    chars = tuple(CHARS)
    return [
        KeptReading(
            text=str(columns[f"{source}_text"][k]),
            broken=bool(columns[f"{source}_broken"][k]),
            count_probability=float(columns[f"{source}_count"][k]) if source in SENSES else 1.0,
            measures={
                name: float(value) for name, value in zip(names, values[k], strict=True) if np.isfinite(value)
            },
            recognised=_lattice(chars, columns[f"{source}_log"][ends[k] - places[k] : ends[k]])
            if places[k]
            else None,
            grammar=grammars.get(str(columns["format"][k])),
        )
        for k in range(total)
    ]


def _lattice(chars: tuple[str, ...], rows: NDArray[np.float16]) -> Lattice:
    """A lattice; rounding must not bring the sum of a place above 1."""
    log = rows.astype(np.float64)
    return Lattice(chars, log - np.maximum(np.logaddexp.reduce(log, axis=1), 0.0)[:, None])


_MANIFESTS = tuple(
    Path(module.__file__ or "").with_name(f"{name}.fit.json")
    for module, name in ((face_library, "face_library"), (recogniser, "recogniser"), (finder, "finder"))
)


def is_learned(font: str) -> bool:
    """Whether library, recogniser or finder have learned from a font of this family."""
    return any(learned.startswith(family(Path(font))) for learned in _learned_fonts())


@cache
def _learned_fonts() -> frozenset[str]:
    names = {name for path in _MANIFESTS for name in json.loads(path.read_text("utf-8"))["fonts"]}
    return frozenset(re.sub(r"[^a-z0-9]", "", Path(name).stem.lower()) for name in names)


def of_parts(columns: Mapping[str, NDArray[Any]], chosen: NDArray[np.bool_]) -> dict[str, NDArray[Any]]:
    """The columns of some parts."""
    rows = {f"{source}_log": np.repeat(chosen, columns[f"{source}_places"]) for source in SENSES}
    return {name: values[rows.get(name, chosen)] for name, values in columns.items()}


def with_parts(
    columns: Mapping[str, NDArray[Any]], further: Mapping[str, NDArray[Any]], *, with_format: bool = False
) -> dict[str, NDArray[Any]]:
    """Add the parts of another file that are not among these, or those of them that were read with a format."""
    more = ~np.isin(further["number"], columns["number"])
    if with_format:
        more &= further["format"] != ""
    added = of_parts({name: further[name] for name in columns}, more)
    return {name: np.concatenate([values, added[name]]) for name, values in columns.items()}


def main(
    readings: Path, *, out: Path = KEPT, same_reader: Path | None = None, with_format: bool = False
) -> None:
    """Pack the readings of a folder, without parts in fonts that the reader has learned.

    Args:
        readings: folder of `risk_parts.py`.
        out: file to write.
        same_reader: file of readings by the same reader, whose further parts count as well.
        with_format: whether only those of them count that were read with a format.
    """
    every = [pickle.loads(path.read_bytes()) for path in sorted(readings.glob("*.pkl"))]
    # others that are stamped have soils that are kept out of every fit
    parts = [part for part in every if part["generator"] != "stamped" or part["soil"] in SOILS]
    columns = pack(parts)
    if same_reader is not None:
        with np.load(same_reader) as further:
            arrays = {name: further[name] for name in further.files}
        columns = with_parts(columns, arrays, with_format=with_format)
    columns = of_parts(columns, np.array([not is_learned(str(font)) for font in columns["font"]]))
    np.savez_compressed(out, **columns)
    print(f"{columns['number'].size:,} parts")


if __name__ == "__main__":
    from cyclopts import run

    run(main)
