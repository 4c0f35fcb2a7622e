"""Find the lines of drawn parts, and keep what the experts of a line need, one file a part::

    python tests/benchmarks/risk_parts.py draw FONTS OTHER_GENERATORS --out drawn-lines --seed 62
    python tests/benchmarks/expert_lines.py drawn-lines --out lines

The seed is another than that of the parts to which the score is fitted; most of the parts that are read are dirty.
`tests/benchmarks/fit_experts.py` fits the weights of the experts to what was kept, so that neither a new library of
faces nor other terms need a new reading.
"""

from __future__ import annotations

import os
import pickle
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from glyphs.atomic import replacing
from glyphs.errors import MarksError
from recognition.decide.evidence import Evidence, SenseEvidence
from recognition.glyph_match.felt_line import DepthStrip
from recognition.language.lattice import Lattice
from recognition.reader import Reader
from recognition.see.text_line import TextLine
from recognition.surface import Surface
from tests.benchmarks.drawn_parts import DrawnPart, KeptSweeps, load_part, unread_parts
from tests.benchmarks.risk_parts import FORMATS, kept_of
from whisker_array.whisker.touch import Touch

CLEAN = 4
"""Of so many clean parts one is read."""


@dataclass(frozen=True, eq=False)
class ExpertLine:
    """A line that the recogniser has read.

    Attributes:
        sense: "tactile" or "vision".
        strips: (LAYERS, rows, columns) float16 of each view along the line.
        columns: (places,) column of each place in them.
        lattice: posteriors of the recogniser.
        line: position of the line.
        raised: whether the marks are raised.
        touch: touch of a felt line.
        depths: depths of a felt line; None without heights.
        reading: what `risk_parts.kept_of` keeps of the reading.
    """

    sense: str
    strips: tuple[NDArray[np.float16], ...]
    columns: NDArray[np.float64]
    lattice: Lattice
    line: TextLine
    raised: bool
    touch: Touch | None
    depths: DepthStrip | None
    reading: dict[str, Any]


def line_of(evidence: SenseEvidence, reader: Reader) -> ExpertLine | None:
    """The line of a sense; None if it has read none."""
    main = evidence.main
    if main is None or not main.columns.size or not main.is_text:
        return None
    felt = None if evidence.marks is None else evidence.marks.felt
    line, columns = (main.line, main.columns) if felt is None else (felt.line, felt.columns)
    depths = None if felt is None else felt.strip
    return ExpertLine(
        sense=evidence.source,
        strips=tuple(view.strip(line).astype(np.float16) for view in evidence.views),
        columns=columns,
        lattice=main.by_expert["network"],
        line=line,
        raised=felt is not None and felt.raised,
        touch=evidence.views[0].touch,
        depths=depths,
        reading=kept_of(reader.decide(Evidence.of(evidence))),
    )


def is_wanted(part: DrawnPart) -> bool:
    """Whether a part is read: all dirty ones, and some clean ones."""
    return part.severity > 0.0 or (part.number // 4) % CLEAN == 0


def lines_of(part: DrawnPart, sweeps: KeptSweeps, reader: Reader) -> dict[str, ExpertLine | None]:
    """The line of each sense."""
    with sweeps.in_place_of_simulation():
        felt = reader.feel(Surface(part.height_map, part.soil_layer))
    return {sense.source: line_of(sense, reader) for sense in (felt, reader.look_at(part.photo))}


def main(drawn: Path, *, out: Path, first: int = 0, step: int = 1, hours: float = 2.0) -> None:
    """Read, and keep lines.

    Args:
        drawn: folder of the drawn parts, in fonts that neither recogniser nor library has learned from.
        out: folder of the lines.
        first: number of the first part.
        step: distance of the numbers.
        hours: time after which the run stops.
    """
    os.nice(19)
    readers = {format: Reader(format=format) for format in dict.fromkeys(FORMATS)}
    for source, target in unread_parts(drawn, out, first=first, step=step, hours=hours):
        part, sweeps = load_part(source)
        if not is_wanted(part):
            continue
        try:
            lines = lines_of(part, sweeps, readers[part.format])
        except MarksError as error:
            print(f"part {part.number}: {error}", flush=True)
            continue
        written = {sense: None if line is None else vars(line) for sense, line in lines.items()}
        with replacing(target) as temporary:
            temporary.write_bytes(pickle.dumps({**part.facts, "lines": written}))


if __name__ == "__main__":
    from cyclopts import run

    run(main)
