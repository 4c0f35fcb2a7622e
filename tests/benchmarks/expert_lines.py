"""Draw parts, find their lines, and keep what the experts of a line need, one file a part::

    python tests/benchmarks/expert_lines.py FONTS OTHER_GENERATORS --out lines

The parts are those of `risk_parts.py` with another seed, most of them dirty. `tests/benchmarks/fit_experts.py` fits the
weights of the experts to what was kept, so that neither a new library of faces nor other terms need a new reading.
"""

from __future__ import annotations

import os
import pickle
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from glyphs.errors import MarksError
from recognition.decide.evidence import Evidence, SenseEvidence
from recognition.glyph_match.felt_line import DepthStrip
from recognition.language.lattice import Lattice
from recognition.reader import Reader
from recognition.see.text_line import TextLine
from recognition.surface import Surface
from tests.benchmarks.drawn_parts import DrawnPart
from tests.benchmarks.risk_parts import FORMATS, SEVERITIES, SHARES, draw_part, kept_of
from whisker_array.whisker.touch import Touch

SEED = 62
CLEAN = 4
"""Of so many clean parts one is kept."""


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
    main = None if evidence.lines is None else evidence.lines.main
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


def is_wanted(number: int) -> bool:
    """Whether the part of a number is drawn: all dirty ones, and some clean ones."""
    severity = np.random.default_rng((SEED, number)).choice(SEVERITIES, p=SHARES)
    return bool(severity > 0.0) or (number // 4) % CLEAN == 0


def lines_of(part: DrawnPart, reader: Reader) -> dict[str, ExpertLine | None]:
    """The line of each sense."""
    evidence = (reader.feel(Surface(part.height_map, part.soil_layer)), reader.look_at(part.photo))
    return {sense.source: line_of(sense, reader) for sense in evidence}


def main(
    fonts: Path,
    others: Path,
    *,
    out: Path,
    parts: int = 4000,
    first: int = 0,
    step: int = 1,
    hours: float = 2.0,
) -> None:
    """Draw, read and keep.

    Args:
        fonts: folder of font files that neither recogniser nor library has learned from.
        others: folder of the other generators.
        out: folder of what is kept.
        parts: number of parts.
        first: number of the first part.
        step: distance of the numbers.
        hours: time after which the run stops.
    """
    os.nice(19)
    files = sorted(path for path in fonts.iterdir() if path.suffix in (".woff", ".ttf", ".otf"))
    out.mkdir(parents=True, exist_ok=True)
    readers = {format: Reader(format=format) for format in dict.fromkeys(FORMATS)}
    end = time.monotonic() + 3600.0 * hours
    for number in filter(is_wanted, range(first, parts, step)):
        path = out / f"{number:06d}.pkl"
        if path.exists() or time.monotonic() > end:
            continue
        try:
            part = draw_part(number, files, others, seed=SEED)
            lines = lines_of(part, readers[part.format])
        except (MarksError, ValueError, KeyError) as error:
            print(f"part {number}: {error}", flush=True)
            continue
        kept_lines = {sense: None if line is None else vars(line) for sense, line in lines.items()}
        temporary = path.with_suffix(".tmp")
        temporary.write_bytes(pickle.dumps({**part.facts, "lines": kept_lines}))
        temporary.replace(path)


if __name__ == "__main__":
    from cyclopts import run

    run(main)
