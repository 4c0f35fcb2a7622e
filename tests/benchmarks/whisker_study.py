"""What edge enhancement is worth to a reader: the same parts felt with other whiskers, preloads, sensors and plans::

    python tests/benchmarks/whisker_study.py feel --hours 2
    python tests/benchmarks/whisker_study.py feel --at-speed --hours 1
    python tests/benchmarks/whisker_study.py tables

Parts are those of a balanced design of their own (`design`), in fonts that no fit has seen. Each part is felt and read
in every cell of `CELLS`, so all comparisons are paired, wherever the run is stopped. Each cell differs from the default
whisker in one factor. `feel` adds to the rows that are there: a further day adds further parts. Several runs may share
the file: with `--first 1 --step 2` a run takes every other part. In `CELLS` nothing rings, as on a slow stage. The
cells of speed are in a file of their own, beside the same on a slow stage.

The reader knows the format and the whisker, as on a bench. The network has learned from scans of a former default
whisker (cell `k 0.117`), which favours whiskers that are like it. Of every fifth part, if its line is straight,
plain correlation reads the same scans with the templates of the named font at the known height: the paper's recipe,
without a network.
"""

from __future__ import annotations

import gzip
import json
import math
import os
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from functools import cache, partial
from pathlib import Path
from unittest import mock

import numpy as np
from cyclopts import App
from numpy.typing import NDArray
from rapidfuzz.distance import Levenshtein

from glyphs.errors import MarksError
from glyphs.soiling.soil import Soil
from glyphs.surface.maps import TraceDirection
from pipeline.benchmark.analysis.estimates import (
    CharacterTest,
    Estimate,
    SerialTest,
    bootstrap_share,
    compare_characters,
    exact_share,
    holm,
    mcnemar,
)
from pipeline.benchmark.exam.condition import Level
from pipeline.benchmark.exam.design import Design, design_named
from pipeline.benchmark.exam.designed_parts import DesignedParts
from pipeline.benchmark.exam.specimens import Specimen
from pipeline.benchmark.readers.mode import scan_seconds
from pipeline.common.shares import Share, share
from pipeline.common.texts import without_blanks
from pipeline.common.version import file_sha256
from recognition import surface as surface_reading
from recognition.decide.decision import BROKEN, Decision, Kind
from recognition.decide.evidence import Evidence
from recognition.decide.reading import Reading
from recognition.decide.score import FITTED
from recognition.find.first_pass import virtual_feel
from recognition.reader import Reader
from recognition.see.virtual_array import VirtualArray
from recognition.surface import Surface
from whisker_array.scan.mounting import VirtualBench as BenchOptions
from whisker_array.whisker.array import RasterPlan
from whisker_array.whisker.defaults import (
    NOMINAL_FRICTION,
    default_preload_mm,
    default_whisker,
    profiling_whisker,
)
from whisker_array.whisker.enhancement import moment_ratio
from whisker_array.whisker.shapes import LShaped
from whisker_array.whisker.touch import Touch, default_touch

ROWS = Path(__file__).with_name("whisker_study.jsonl.gz")
SPEED_ROWS = ROWS.with_name("whisker_speed.jsonl.gz")
FORMAT = "AA999999"
FACTORS = ("severity", "soil", "font", "height_mm", "die", "plate", "practice", "layout")
PARTS = 512
"""16 parts of each soil and severity."""
CORRELATION_EVERY = 5
"""Of so many parts one is also read by correlation, if its line is straight: that takes 4 s a whisker. All severities
and soils take turns."""
Directions = tuple[TraceDirection, ...]
MakeWhisker = Callable[[float], LShaped]


def paper_whisker(height_mm: float, *, k: float) -> LShaped:
    """The paper's whisker: l3 = l2 = k l1, beta = 0; its sensor is as low as its tip."""
    l2_mm = 6.0 * k * height_mm
    return replace(default_whisker(height_mm), l2_mm=l2_mm, l3_mm=l2_mm)


def long_foot(height_mm: float, *, l2_heights: float) -> LShaped:
    """A longer foot, with its sensor as high above the land as the default's: 0.3 heights, and at least 1.5 mm."""
    usual = default_whisker(height_mm)
    longer_mm = l2_heights * height_mm - usual.l2_mm
    return replace(usual, l2_mm=usual.l2_mm + longer_mm, l3_mm=usual.lowered_mm + longer_mm)


def gauge_at_clamp(height_mm: float) -> LShaped:
    """The default whisker with its sensor at the clamp."""
    return replace(default_whisker(height_mm), l3_mm=0.0)


@dataclass(frozen=True)
class Cell:
    """How a part is felt: the default in all but a factor.

    Attributes:
        what: the level, for tables; lengths are those for characters of 5 mm.
        preload: preload, in that of the default.
        noise: factor of noise, drift and vibration.
        friction: friction of the whole part (default: 0.2 on metal, each soil its own).
        directions: trace directions (default: four).
        speed: speed at which whiskers ring, in the usual one (10 heights a second, up to 50 mm/s); 0: nothing rings.
    """

    name: str
    factor: str
    what: str
    whisker: MakeWhisker = default_whisker
    preload: float = 1.0
    noise: float = 1.0
    friction: float | None = None
    directions: Directions = ()
    speed: float = 0.0


CELLS = (
    Cell("default", "default", "l2 = 3.51 mm, l3 = 1.01 mm, preload 1.0 mm, four directions"),
    Cell("straight", "whisker", "straight, as the paper's k = 0", partial(paper_whisker, k=0.0)),
    Cell("profiler", "whisker", "L, l3 = -l2 / 2 (profiler)", profiling_whisker),
    Cell("k 0.033", "whisker", "k = 0.033, l3 = l2", partial(paper_whisker, k=0.033)),
    Cell("k 0.083", "whisker", "k = 0.083, l3 = l2", partial(paper_whisker, k=0.083)),
    Cell("k 0.117", "whisker", "k = 0.117, l3 = l2 (former default)", partial(paper_whisker, k=0.117)),
    Cell("l3 0", "whisker", "l2 = 3.51 mm, l3 = 0", gauge_at_clamp),
    Cell("l2 6", "whisker", "l2 = 6 mm, l3 = 3.5 mm", partial(long_foot, l2_heights=1.2)),
    Cell("l2 9", "whisker", "l2 = 9 mm, l3 = 6.5 mm", partial(long_foot, l2_heights=1.8)),
    Cell("preload 0.5", "preload", "preload 0.5 mm", preload=0.5),
    Cell("preload 1.5", "preload", "preload 1.5 mm", preload=1.5),
    Cell("noise 3", "noise", "noise x 3", noise=3.0),
    Cell("noise 10", "noise", "noise x 10", noise=10.0),
    Cell("profiler, noise 10", "noise", "profiler, noise x 10", profiling_whisker, noise=10.0),
    Cell("friction 0.1", "friction", "friction 0.1 everywhere", friction=0.1),
    Cell("friction 0.5", "friction", "friction 0.5 everywhere", friction=0.5),
    Cell(
        "along", "plan", "two directions, along the line there and back",
        directions=(TraceDirection.FORWARD_X, TraceDirection.BACK_X),
    ),
    Cell(
        "crossed", "plan", "two directions, along and across the line",
        directions=(TraceDirection.FORWARD_X, TraceDirection.FORWARD_Y),
    ),
)  # fmt: skip
AT_SPEED = (
    Cell("at speed", "speed", "default at the usual speed", speed=1.0),
    Cell("at twice the speed", "speed", "default at twice that", speed=2.0),
    Cell("profiler, at speed", "speed", "profiler at the usual speed", profiling_whisker, speed=1.0),
    Cell(
        "l2 6, at speed",
        "speed",
        "l2 = 6 mm at the usual speed",
        partial(long_foot, l2_heights=1.2),
        speed=1.0,
    ),
    Cell(
        "l2 9, at speed",
        "speed",
        "l2 = 9 mm at the usual speed",
        partial(long_foot, l2_heights=1.8),
        speed=1.0,
    ),
)
SPEED_CELLS = (*(cell for cell in CELLS if cell.name in ("default", "profiler", "l2 6", "l2 9")), *AT_SPEED)
BY_CORRELATION = tuple(cell for cell in CELLS if cell.factor in ("default", "whisker"))


@dataclass(frozen=True)
class CellArray(VirtualArray):
    """The virtual array of a cell."""

    cell: Cell = CELLS[0]

    def touch(self, height_mm: float) -> Touch:
        """Touch for characters of a height: whisker and preload of the cell."""
        touch = default_touch(height_mm).with_whisker(self.cell.whisker(height_mm))
        assert touch.ringing is not None
        # a lower frequency is as a higher speed
        rings = (
            replace(touch.ringing, held_hz=touch.ringing.held_hz / speed)
            if (speed := self.cell.speed)
            else None
        )
        return replace(touch, preload_mm=self.cell.preload * default_preload_mm(height_mm), ringing=rings)

    def draw(self, plan: RasterPlan, touch: Touch) -> BenchOptions:
        """Draw sensors and stage; noise, drift and vibration are multiplied."""
        options = super().draw(plan, touch)
        chain = options.get("sensor")
        if chain is not None:
            options["sensor"] = replace(
                chain,
                noise_n_mm=self.cell.noise * chain.noise_n_mm,
                drift_n_mm_per_sqrt_s=self.cell.noise * chain.drift_n_mm_per_sqrt_s,
                vibration=self.cell.noise * chain.vibration,
            )
        return options


def design() -> Design:
    """The parts: every soil at every severity equally often, the other factors balanced at each severity."""
    exam = design_named("marks-exam-1-208")
    (kept_out,) = (section for section in exam.sections if section.kept_out)
    fonts = kept_out.part["font"]
    part = {
        "severity": exam.part["severity"],
        "soil": exam.part["soil"],
        "format": FORMAT,
        "font": fonts,
        "height_mm": (3.5, 5, 8),
        "die": exam.part["die"],
        "plate": exam.part["plate"],
        "practice": exam.part["practice"],
        "layout": ("straight", "turned", "arc"),
    }
    packaged = {font: exam.fonts[font] for font in map(str, fonts)}
    return Design.of(
        name="whisker-study",
        seed=20261201,
        parts=PARTS,
        cross=("severity", "soil"),
        part=part,
        fonts=packaged,
    )


@dataclass(frozen=True)
class Row:
    """What was read of a part in a cell.

    Attributes:
        by: the reader, or correlation alone.
        text: text without blanks; empty if nothing was read.
        edits: characters wrong, missing and too many (Levenshtein).
        score: probability that the text is right.
        accepted: whether it is accepted at the default risk.
        broken: whether a contract keeps it from acceptance, whatever its score.
        scan_s: stage time of the scan.
        error: why the part could not be felt or read; empty if it was.
        flags: samples that are missing or wrong, such as those of a jammed whisker.
    """

    cell: str
    by: str
    text: str = ""
    edits: int = 0
    score: float = 0.0
    accepted: bool = False
    broken: bool = False
    scan_s: float = 0.0
    error: str = ""
    flags: tuple[str, ...] = ()

    @property
    def right(self) -> bool:
        """Whether the text is that on the part."""
        return self.edits == 0


@dataclass(frozen=True)
class StudyPart:
    """A part with its rows.

    Attributes:
        number: number of the part in the design.
        truth: the text on it.
        levels: levels of its factors.
        score: beginning of the hash of the fitted score (`score_mark`).
    """

    number: int
    truth: str
    levels: Mapping[str, Level]
    score: str
    rows: tuple[Row, ...]

    @property
    def is_correlated(self) -> bool:
        """Whether it was also read by correlation."""
        return any(row.by == "correlation" for row in self.rows)


@cache
def score_mark() -> str:
    """The score that accepts: rows by two scores do not belong in one table."""
    return file_sha256(FITTED)[:8]


@cache
def reader_of(cell: Cell) -> Reader:
    """The reader of a cell, which keeps its templates."""
    return Reader(format=FORMAT, array=CellArray(cell=cell), accept_risk=0.01)


@contextmanager
def feel_along(directions: Directions) -> Iterator[None]:
    """Within the block, parts are felt in some directions only; the first pass is as usual."""
    if not directions:
        yield
        return
    feel = partial(virtual_feel, directions=directions)
    with mock.patch.object(surface_reading, "virtual_feel", feel):
        yield


def surface_of(specimen: Specimen, friction: float | None) -> Surface:
    """The surface of a part; with a friction, that everywhere."""
    soil, z_mm = specimen.soil, specimen.height_map.z_mm
    if friction is not None:
        mu = np.full_like(z_mm, friction)
        hard = Soil(np.zeros_like(z_mm), np.ones_like(z_mm), mu)
        soil = hard if soil is None else replace(soil, friction=mu)
    return Surface(specimen.height_map, soil, part_id=specimen.part)


def row_of(reading: Reading, truth: str, *, cell: str, by: str, scan_s: float) -> Row:
    """The row of a reading."""
    text = without_blanks(reading.text)
    return Row(
        cell, by, text, int(Levenshtein.distance(truth, text)), round(reading.confidence, 6),
        reading.decision is Decision.ACCEPT, bool(reading.flags & BROKEN), round(scan_s, 2),
        flags=tuple(str(flag.name) for flag in reading.flags if flag.kind is Kind.SCAN),
    )  # fmt: skip


def read_cell(specimen: Specimen, cell: Cell, *, font: str = "") -> list[Row]:
    """Feel a part in a cell, and read it.

    Args:
        font: file of the font by whose templates correlation reads the scan as well (default: it does not).
    """
    reader, truth = reader_of(cell), specimen.truth
    unread = Row(cell.name, "reader", edits=len(truth))
    try:
        with feel_along(cell.directions):
            evidence = reader.feel(surface_of(specimen, cell.friction))
        reading = reader.decide(Evidence.of(evidence))
    except MarksError as error:
        return [replace(unread, error=error.what)]
    scan = reading.trace.scan
    scan_s = 0.0 if scan is None else scan_seconds(scan)
    rows = [row_of(reading, truth, cell=cell.name, by="reader", scan_s=scan_s)]
    if font:
        unread = replace(unread, by="correlation", scan_s=round(scan_s, 2))
        if scan is None:
            return [*rows, replace(unread, error="there is no scan")]
        try:
            height_mm = specimen.height_mm
            templates = Reader(reader.settings, fonts=(font,), experts=("templates",), height_mm=height_mm)
            reading = templates.decide(Evidence.of(templates.touch.of_scan(scan)))
        except MarksError as error:
            return [*rows, replace(unread, error=error.what)]
        rows.append(row_of(reading, truth, cell=cell.name, by="correlation", scan_s=scan_s))
    return rows


def load_parts(path: Path = ROWS) -> list[StudyPart]:
    """All parts, in the order of their numbers."""
    if not path.exists():
        return []
    with gzip.open(path, "rt", encoding="utf-8") as file:
        lines = [json.loads(line) for line in file]
    parts = [
        StudyPart(
            line["number"],
            line["truth"],
            line["levels"],
            line["score"],
            tuple(Row(**{**values, "flags": tuple(values.get("flags", ()))}) for values in line["rows"]),
        )
        for line in lines
    ]
    return sorted({part.number: part for part in parts}.values(), key=lambda part: part.number)


def add_part(part: StudyPart, path: Path = ROWS) -> None:
    """Add a part, at once."""
    usual = asdict(Row("", ""))
    rows = [{k: value for k, value in asdict(row).items() if value != usual[k]} for row in part.rows]
    plain = {**vars(part), "levels": dict(part.levels), "rows": rows}
    with path.open("ab") as file:
        file.write(gzip.compress((json.dumps(plain, separators=(",", ":")) + "\n").encode(), mtime=0))


app = App()


@app.command
def feel(
    *, at_speed: bool = False, hours: float = 2.0, first: int = 0, step: int = 1, rows: Path | None = None
) -> None:
    """Feel and read further parts in every cell, and add their rows.

    Args:
        at_speed: in the cells of speed.
        hours: time after which no part is begun.
        first: number of the first part.
        step: distance of the numbers.
        rows: file of the rows (default: the one beside this program).
    """
    parts, end = DesignedParts(design(), first=PARTS), time.monotonic() + 3600.0 * hours
    cells = SPEED_CELLS if at_speed else CELLS
    rows = rows or (SPEED_ROWS if at_speed else ROWS)
    for number, item in list(enumerate(parts.items()))[first::step]:
        if number in {part.number for part in load_parts(rows)}:
            continue
        if time.monotonic() > end:
            return
        start, specimen = time.process_time(), parts.make(item)
        correlated = not at_speed and number % CORRELATION_EVERY == 0 and item.condition["layout"] != "arc"
        font, of_part = parts.font_of(item.condition), list[Row]()
        for cell in cells:
            wanted = correlated and cell in BY_CORRELATION
            of_part += read_cell(specimen, cell, font=font if wanted else "")
        levels = {factor: item.condition[factor] for factor in FACTORS}
        add_part(StudyPart(number, specimen.truth, levels, score_mark(), tuple(of_part)), rows)
        right = sum(row.right for row in of_part if row.by == "reader")
        print(
            f"part {number}, {item.condition.levels}: right in {right} of {len(cells)} cells, "
            f"{time.process_time() - start:.0f} s",
            flush=True,
        )


@app.command
def correlate(*, hours: float = 2.0, rows: Path = ROWS) -> None:
    """Read further parts of the file by correlation as well, if their line is straight.

    Args:
        hours: time after which no part is begun.
        rows: file of the rows.
    """
    parts, end = DesignedParts(design(), first=PARTS), time.monotonic() + 3600.0 * hours
    items = parts.items()
    for part in load_parts(rows):
        if part.levels["layout"] == "arc" or part.is_correlated:
            continue
        if time.monotonic() > end:
            return
        item = items[part.number]
        specimen, font = parts.make(item), parts.font_of(item.condition)
        added = [
            row
            for cell in BY_CORRELATION
            for row in read_cell(specimen, cell, font=font)
            if row.by == "correlation"
        ]
        add_part(replace(part, rows=(*part.rows, *added)), rows)
        print(
            f"part {part.number}: by correlation right with {sum(row.right for row in added)} whiskers",
            flush=True,
        )


@dataclass(frozen=True, eq=False)
class Readings:
    """The readings of all parts in a cell, in the order of the parts."""

    rows: tuple[Row, ...]
    truths: tuple[str, ...]

    @classmethod
    def of(cls, parts: Sequence[StudyPart], cell: str, *, by: str = "reader") -> Readings:
        """The readings in a cell; parts that were not read there are left out."""
        pairs = [(row, part.truth) for part in parts for row in part.rows if (row.cell, row.by) == (cell, by)]
        return cls(tuple(row for row, _ in pairs), tuple(truth for _, truth in pairs))

    @property
    def stamped(self) -> list[int]:
        """Number of characters of each part."""
        return [len(truth) for truth in self.truths]

    @property
    def characters_right(self) -> list[int]:
        """Characters of each part less the edits, not below 0."""
        return [max(0, n - row.edits) for n, row in zip(self.stamped, self.rows, strict=True)]

    @property
    def right(self) -> list[bool]:
        """Whether the serial of each part is right."""
        return [row.right for row in self.rows]

    @property
    def before_first_wrong(self) -> int:
        """Number of parts with higher scores than the first wrong text; those with a broken contract are left out."""
        candidates = [row for row in self.rows if row.text and not row.broken]
        wrong = max((row.score for row in candidates if not row.right), default=-1.0)
        return sum(row.score > wrong for row in candidates)

    def figures(self) -> str:
        """Cells of a table: characters, serials, accepted, wrong of these, accepted before the first wrong one."""
        accepted = [row for row in self.rows if row.accepted]
        wrong = exact_share(sum(not row.right for row in accepted), len(accepted))
        return " | ".join((
            percent(bootstrap_share(self.characters_right, self.stamped)),
            percent(share(sum(self.right), len(self.rows))),
            percent(share(len(accepted), len(self.rows))),
            f"{wrong.count} of {wrong.total} ({100.0 * wrong.high:.1f})",
            f"{self.before_first_wrong}",
        ))  # fmt: skip


@dataclass(frozen=True)
class Pair:
    """Two cells, read on the same parts."""

    first: str
    second: str
    serials: SerialTest
    accepted: SerialTest
    characters: CharacterTest

    @classmethod
    def of(cls, parts: Sequence[StudyPart], first: str, second: str, *, by: str = "reader") -> Pair:
        """Compare two cells."""
        one, other = (Readings.of(parts, cell, by=by) for cell in (first, second))
        return cls(
            first,
            second,
            mcnemar(one.right, other.right),
            mcnemar([row.accepted for row in one.rows], [row.accepted for row in other.rows]),
            compare_characters(one.characters_right, other.characters_right, one.stamped),
        )


def percent(value: Share | Estimate) -> str:
    """A share in percent, with its interval."""
    if value.low is None or value.high is None:
        return f"{100.0 * value.value:.1f}"
    return f"{100.0 * value.value:.1f} ({100.0 * value.low:.1f} to {100.0 * value.high:.1f})"


def whisker_table(heights_mm: Sequence[float] = (3.5, 5.0, 8.0)) -> Iterator[str]:
    """Whiskers: F by eq. (22) on walls of 60 degrees, friction 0.2, and the room below the sensor's axis."""
    heads = " | ".join(f"{height:g} mm: F falling, rising; room" for height in heights_mm)
    yield f"| cell | whisker at 5 mm | {heads} |"
    yield "|---|---|" + "---|" * len(heights_mm)
    for cell in BY_CORRELATION:
        of_height = []
        for height_mm in heights_mm:
            touch, whisker = CellArray(cell=cell).touch(height_mm), cell.whisker(height_mm)
            steep = math.tan(math.radians(60.0))
            falling, rising = moment_ratio([-steep, steep], NOMINAL_FRICTION, touch.tip)
            room_mm = whisker.l2_mm - touch.preload_mm - whisker.lowered_mm
            of_height.append(f"{falling:.2f}, {rising:.2f}; {room_mm:.1f} mm")
        yield f"| {cell.name} | {cell.what} | {' | '.join(of_height)} |"


def cell_table(parts: Sequence[StudyPart], cells: Sequence[Cell]) -> Iterator[str]:
    """Figures of cells."""
    yield (
        "| cell | characters | serials | accepted | of these wrong (at most) | before the first wrong "
        "| stage, s | unread, flagged |"
    )
    yield "|---|---|---|---|---|---|---|---|"
    for cell in cells:
        readings = Readings.of(parts, cell.name)
        stage_s = np.mean([row.scan_s for row in readings.rows])
        unread = sum(bool(row.error) or not row.text for row in readings.rows)
        flagged = sum(bool(row.flags) for row in readings.rows)
        yield f"| {cell.name} | {readings.figures()} | {stage_s:.0f} | {unread}, {flagged} |"


def pair_table(pairs: Sequence[Pair]) -> Iterator[str]:
    """Paired comparisons; p by Holm's correction for the pairs of the table."""
    tests = [(pair.serials, pair.accepted, pair.characters) for pair in pairs]
    corrected = zip(
        *(holm([test.p_differ for test in column]) for column in zip(*tests, strict=True)), strict=True
    )
    yield (
        "| cell / compared with | serials right only here, there | p | accepted only here, there | p "
        "| characters more, points | p |"
    )
    yield "|---|---|---|---|---|---|---|"
    for pair, (p_serials, p_accepted, p_characters) in zip(pairs, corrected, strict=True):
        only = [f"{test.only_first}, {test.only_second}" for test in (pair.serials, pair.accepted)]
        yield (
            f"| {pair.first} / {pair.second} | {only[0]} | {p_serials:.2g} | {only[1]} | {p_accepted:.2g} | "
            f"{percent(pair.characters.difference)} | {p_characters:.2g} |"
        )


def severity_table(parts: Sequence[StudyPart], cells: Sequence[Cell], *, by: str = "reader") -> Iterator[str]:
    """Characters and serials right by severity, %."""
    severities = sorted({float(part.levels["severity"] or 0.0) for part in parts})
    groups = [[part for part in parts if part.levels["severity"] == severity] for severity in severities]
    heads = (f"dirt {s:g} ({len(group)} parts)" for s, group in zip(severities, groups, strict=True))
    yield f"| characters / serials / accepted | {' | '.join(heads)} |"
    yield "|---|" + "---|" * len(groups)
    for cell in cells:
        figures = []
        for group in groups:
            readings = Readings.of(group, cell.name, by=by)
            characters = bootstrap_share(readings.characters_right, readings.stamped)
            accepted = sum(row.accepted for row in readings.rows)
            figures.append(f"{percent(characters)} / {sum(readings.right)} / {accepted}")
        yield f"| {cell.name} | {' | '.join(figures)} |"


def correlation_table(parts: Sequence[StudyPart]) -> Iterator[str]:
    """Correlation alone, and the reader, on parts that both have read."""
    yield "| cell | by correlation: characters | serials | by the reader: characters | serials |"
    yield "|---|---|---|---|---|"
    for cell in BY_CORRELATION:
        figures = []
        for by in ("correlation", "reader"):
            readings = Readings.of(parts, cell.name, by=by)
            figures.append(percent(bootstrap_share(readings.characters_right, readings.stamped)))
            figures.append(percent(share(sum(readings.right), len(readings.rows))))
        yield f"| {cell.name} | {' | '.join(figures)} |"


PROFILED = (
    ("k 0.033", "straight"), ("k 0.083", "straight"), ("k 0.117", "straight"),
    ("l3 0", "profiler"), ("default", "profiler"), ("l2 6", "profiler"), ("l2 9", "profiler"),
    ("noise 10", "profiler, noise 10"),
)  # fmt: skip
"""Whiskers that enhance edges, and those that do not but touch in the same way."""


SLOWED = (
    ("at speed", "default"), ("at twice the speed", "default"), ("profiler, at speed", "profiler"),
    ("l2 6, at speed", "l2 6"), ("l2 9, at speed", "l2 9"),
    ("at speed", "profiler, at speed"), ("l2 6, at speed", "profiler, at speed"),
    ("l2 9, at speed", "profiler, at speed"),
)  # fmt: skip
"""Cells at speed, and the same on a slow stage or the profiler at speed."""


def mean_gain(parts: Sequence[StudyPart], *, by: str = "reader") -> str:
    """Characters of the whiskers with F less those of the two without, both as means over whiskers."""

    def mean_right(cells: Sequence[Cell]) -> NDArray[np.float64]:
        each = [Readings.of(parts, cell.name, by=by).characters_right for cell in cells]
        return np.asarray(np.mean(each, axis=0))

    without = [cell for cell in BY_CORRELATION if cell.name in ("straight", "profiler")]
    enhancing = [cell for cell in BY_CORRELATION if cell not in without]
    stamped = [len(part.truth) for part in parts]
    test = compare_characters(mean_right(enhancing).tolist(), mean_right(without).tolist(), stamped)
    return (
        f"Mean of the {len(enhancing)} whiskers with F less that of the {len(without)} without: "
        f"{percent(test.difference)} points of characters, p = {test.p_differ:.2g}."
    )


def report(parts: Sequence[StudyPart]) -> Iterator[str]:
    """All tables, each under its heading; Markdown."""
    by_correlation = [part for part in parts if part.is_correlated]
    severities = Counter(float(part.levels["severity"] or 0.0) for part in parts)
    counts = ", ".join(f"{n} at dirt {severity:g}" for severity, n in sorted(severities.items()))
    yield f"{len(parts)} parts in every cell: {counts}. {len(by_correlation)} of them also by correlation."
    if len(marks := {part.score for part in parts}) > 1:
        yield f"They were accepted by {len(marks)} fits of the score: only texts can be compared."
    yield from ("", "### The whiskers", "", *whisker_table())
    yield from ("", "### Every cell", "", *cell_table(parts, CELLS))
    enhanced = [Pair.of(parts, *names) for names in PROFILED]
    yield from ("", "### With F, and without", "", *pair_table(enhanced), "", mean_gain(parts))
    others = [Pair.of(parts, cell.name, "default") for cell in CELLS[1:]]
    yield from ("", "### Every cell against the default", "", *pair_table(others))
    yield from ("", "### By dirt", "", *severity_table(parts, BY_CORRELATION))
    yield from ("", "### Correlation alone", "", *correlation_table(by_correlation))
    yield from ("", *severity_table(by_correlation, BY_CORRELATION, by="correlation"))
    pairs = [
        Pair.of(by_correlation, *names, by="correlation") for names in PROFILED if "noise" not in names[0]
    ]
    yield from ("", *pair_table(pairs), "", mean_gain(by_correlation, by="correlation"))


def speed_tables(parts: Sequence[StudyPart]) -> Iterator[str]:
    """Cells at speed beside the same on a slow stage."""
    yield from cell_table(parts, SPEED_CELLS)
    yield from ("", *pair_table([Pair.of(parts, *names) for names in SLOWED]))


@app.command
def tables(*, rows: Path = ROWS, speed_rows: Path = SPEED_ROWS) -> None:
    """Print all tables as Markdown.

    Args:
        rows: file of the rows.
        speed_rows: file of the rows at speed.
    """
    at_speed = load_parts(speed_rows)
    heading = ("", f"### At speed ({len(at_speed)} parts)", "")
    for line in (*report(load_parts(rows)), *heading, *speed_tables(at_speed)):
        print(line)


if __name__ == "__main__":
    os.nice(19)
    app()
