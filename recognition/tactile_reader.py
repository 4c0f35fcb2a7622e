"""The reader by touch: how a scan becomes a reading.

scan --edge_map--> EdgeMap --localise--> hypotheses --search--> line --refine--> cells --decide--> Reading
                      |                                                            |                ^
                      +------------------------relief-------------------------> mark depths --------+
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np

from glyphs.errors import MarksError
from glyphs.soiling.soil import Soil
from glyphs.surface.maps import EdgeMap, HeightMap, MapError
from recognition.acceptance import Decided, ScoredLine, decide
from recognition.constrained_decoding import choose
from recognition.decision import check_doubted
from recognition.depth import mark_depths
from recognition.depth_rules import judged_by
from recognition.evidence_cache import EvidenceCache
from recognition.grading import graded
from recognition.levelling import first_look, level
from recognition.lines import find_lines, hypotheses
from recognition.localise import activity_of, runs_down
from recognition.reader_settings import ReaderSettings, Repertoire
from recognition.reading import Decision, Reading, ReadingFlag, ReadingTrace
from recognition.refine import refine_line
from recognition.robust_reading import RobustReading, is_crisp, lattice_of_reading, read_robustly, untroubled
from recognition.search import LineFit, LineSearch
from recognition.step_timer import StepTimer
from recognition.templates import TemplateCache
from recognition.turning import is_better, turned_back, turned_edges, turned_heights, turned_map
from recognition.unseen_glyphs import doubted_guesses
from whisker_array.estimation.edges import edge_map
from whisker_array.estimation.profiled import estimate_relief
from whisker_array.estimation.relief import Relief, relief_from_edges
from whisker_array.scan.scan import Scan, trace_scan
from whisker_array.simulation.traces import SampleFlag
from whisker_array.whisker.array import default_plan
from whisker_array.whisker.touch import Touch, default_touch

MOST_SCANS = 2
"""Scales at which a height map is scanned in search of a reading that is accepted."""


class TactileReader:
    """Reads parts by touch, one after the other; keeps fonts and predicted templates between them."""

    def __init__(self, settings: ReaderSettings | None = None) -> None:
        """Load the fonts.

        Raises:
            FontError: a font that cannot be loaded, or that lacks what the format needs.
        """
        self.settings = settings if settings is not None else ReaderSettings()
        repertoire = Repertoire(self.settings)
        self.fonts, self.chars, self.grammar = repertoire.fonts, repertoire.chars, repertoire.grammar
        self.places, self.gaps = repertoire.places, repertoire.gaps
        self.cache = TemplateCache()

    def read_height_map(
        self, height_map: HeightMap, *, soil: Soil | None = None, part_id: str = ""
    ) -> Reading:
        """Mount, scan with the virtual array at the scale of the characters, and read.

        Of several plausible character heights each is scanned, until one reads well. A plate that is not accepted as
        it lies is tried turned, see `recognition.turning`.

        Args:
            height_map: the part's surface, the top of what lies on it.
            soil: dirt into which the tip sinks, and the part's friction, if known.
            part_id: what the part is called.

        Raises:
            MapError: a map that cannot be scanned, a soil on another grid.
        """
        timer = StepTimer()
        with timer.step("mount"):
            levelled = level(height_map)
            look = first_look(levelled)

        def read(quarters: int) -> Reading:
            with timer.step("mount"):
                heights = (
                    first_look(turned_map(levelled, quarters)).heights_mm if quarters else look.heights_mm
                )
            return self._read_levelled(levelled, heights, quarters, timer, soil=soil, part_id=part_id)

        return _best_turn(read, (1, 3, 0) if look.runs_down else (0, 2))

    def _read_levelled(
        self,
        levelled: HeightMap,
        heights_mm: tuple[float, ...],
        quarters: int,
        timer: StepTimer,
        *,
        soil: Soil | None,
        part_id: str,
    ) -> Reading:
        """Scan for characters of these heights, and read as if the plate were turned so far."""
        heights = (self.settings.height_mm,) if self.settings.height_mm else heights_mm
        if not heights:
            return _nothing(timer, height_map=levelled)
        best: Reading | None = None
        for height in heights[:MOST_SCANS]:
            touch = default_touch(height)
            with timer.step("scan"):
                plan = default_plan((0.0, 0.0, *levelled.size_mm), character_height_mm=height)
                scan = trace_scan(
                    levelled,
                    touch=touch,
                    plan=plan,
                    fidelity=self.settings.fidelity,
                    part_id=part_id,
                    soil=soil,
                )
            tried = self._read(scan, quarters, timer, height_map=levelled)
            if best is None or _merit(tried) > _merit(best):
                best = tried
            if best.decision is Decision.ACCEPT:
                break
        assert best is not None
        return best

    def read_scan(self, scan: Scan) -> Reading:
        """Read a recorded or simulated scan."""
        timer = StepTimer()
        found = self._read(scan, 0, timer, height_map=None)
        edges = found.trace.edge_map
        if found.decision is Decision.ACCEPT or edges is None:
            return found
        turns = (1, 3) if runs_down(activity_of(edges.enhancement)) else (2,)
        return _best_turn(lambda q: self._read(scan, q, timer, height_map=None) if q else found, (0, *turns))

    def _read(self, scan: Scan, quarters: int, timer: StepTimer, *, height_map: HeightMap | None) -> Reading:
        """Read a scan as if its plate were turned so far; the reading is of the plate as it lies."""
        with timer.step("edge map"):
            try:
                edges = edge_map(scan)
            except MapError:
                return _nothing(timer, _scan_flags(scan), scan=scan, height_map=height_map)
        with timer.step("depth"):
            relief = relief_of(scan, edges)
        upright = turned_edges(edges, quarters) if quarters else edges
        heights = turned_heights(relief, quarters, edges=edges) if quarters and relief is not None else relief
        found = self.read_edge_map(upright, scan.touch, relief=heights, timer=timer, flags=_scan_flags(scan))
        if quarters:
            found = turned_back(found, quarters, edges=edges).traced(edge_map=edges, relief=relief)
        return found.traced(scan=scan, height_map=height_map)

    def read_edge_map(
        self,
        edges: EdgeMap,
        touch: Touch,
        *,
        relief: Relief | None = None,
        timer: StepTimer | None = None,
        flags: ReadingFlag = ReadingFlag.NONE,
    ) -> Reading:
        """Read an edge map of the given touch. Without a relief the reading has no depths."""
        timer = timer if timer is not None else StepTimer()
        nothing = _nothing(timer, flags, edge_map=edges, relief=relief)
        search = LineSearch(edges, touch, self.cache, chars=self.chars, places=self.places)
        look = EvidenceCache(search, places=self.places, gaps=self.gaps)
        with timer.step("localise"):
            tried = hypotheses(search, self.fonts, height_mm=self.settings.height_mm)
        if not tried:
            return nothing
        with timer.step("search"):
            height_known = self.settings.height_mm is not None
            lines = find_lines(search, tried, height_known=height_known, look=look)
        if not lines:
            return nothing
        with timer.step("match"):
            judged = [self._judge(search, line) for line in lines]
        with timer.step("decide"):
            decided = decide(judged, places=self.places, gaps=self.gaps, settings=self.settings, flags=flags)
        with timer.step("evidence"):
            again = None
            if not untroubled(decided, self.grammar):
                again = self._again(look, judged, flags, nothing_read=decided.judged is None)
        if self.places is None:
            decided, again = _counted_alike(decided, again)
        reading, support, line_read = decided.reading, decided.support_mm, decided.judged
        lattice, choice = lattice_of_reading(decided), None
        if again is None and lattice is not None and self.grammar is not None and self.grammar.checks:
            # correlation asks no check digit; what it cannot tell apart is in doubt all the same
            reading = check_doubted(reading, choose(lattice, self.grammar), self.grammar)
        if again is not None:
            reading, line_read, lattice, choice = again.reading, again.judged, again.lattice, again.choice
        with timer.step("depth"):
            if relief is not None and line_read is not None:
                reading = _with_depths(reading, line_read, relief)
            reading = judged_by(reading, self.settings.depth_rules)
        if line_read is not None:
            reading = doubted_guesses(reading, line_read, self.places)
        if line_read is not None:
            with timer.step("grade"):
                image = search.image(line_read[0].hypothesis.rotation_deg)
                reading = graded(reading, line_read, image, edges.directions)
        return _timed(reading, timer).traced(
            edge_map=edges,
            relief=relief,
            support_mm=support,
            lattice=lattice,
            choice=choice,
        )

    @staticmethod
    def _judge(search: LineSearch, line: LineFit) -> ScoredLine:
        templates = search.templates(line.hypothesis, raised=line.raised)
        image = search.image(line.hypothesis.rotation_deg)
        settled, cells = refine_line(line, image, templates, search.edges.directions)
        return settled, templates, cells

    def _again(
        self, look: EvidenceCache, judged: list[ScoredLine], flags: ReadingFlag, *, nothing_read: bool
    ) -> RobustReading | None:
        """The reading by evidence, of the line that has most; None where no line is of a font's own shapes."""
        seen = [
            (look.at(line), (line, templates, cells)) for line, templates, cells in judged if is_crisp(line)
        ]
        if nothing_read and not seen and look.best is not None:
            # no hand explains the line; dirt may
            seen = [(look.at(look.best), self._judge(look.search, look.best))]
        kept = [(evidence, one) for evidence, one in seen if evidence is not None]
        if not kept:
            return None
        evidence, best = max(kept, key=lambda pair: pair[0].total)
        if not (nothing_read or look.stands(evidence)) and len(seen) < len(judged):
            return None  # a foreign hand explains the line better than dirt does
        image = look.search.image(best[0].hypothesis.rotation_deg)
        gaps = self.gaps if self.places is not None else None
        return read_robustly(
            evidence, best, image, grammar=self.grammar, gaps=gaps, settings=self.settings, flags=flags
        )


def relief_of(scan: Scan, edges: EdgeMap) -> Relief | None:
    """The surface as felt; None where friction or whisker tell no heights."""
    try:
        if scan.others or any(s.plan.pushed for s in scan.sweeps):
            return estimate_relief(scan, edges)
        return relief_from_edges(edges, scan.touch)
    except MarksError:
        return None


def _with_depths(reading: Reading, judged: ScoredLine, relief: Relief) -> Reading:
    line, templates, cells = judged
    depths = mark_depths(relief, line, templates, cells, [c.char for c in reading.characters])
    characters = tuple(replace(c, depth=d) for c, d in zip(reading.characters, depths, strict=True))
    return replace(reading, characters=characters)


def _counted_alike(decided: Decided, again: RobustReading | None) -> tuple[Decided, RobustReading | None]:
    """Without a format: evidence judges the characters that correlation counts, and doubts the count.

    Evidence passes over a faint character that correlation reads; but what it finds beyond is there.
    """
    if again is None or decided.judged is None or len(again.judged[2]) == len(decided.judged[2]):
        return decided, again
    if len(again.judged[2]) < len(decided.judged[2]):
        return decided, None
    reading = decided.reading
    decision = Decision.REVIEW if reading.decision is Decision.ACCEPT else reading.decision
    doubted = replace(reading, decision=decision, flags=reading.flags | ReadingFlag.UNREAD_MARKS)
    return decided._replace(reading=doubted), None


def _scan_flags(scan: Scan) -> ReadingFlag:
    """Flags of the samples that are common enough (0.5 %) to matter."""
    table = (
        (SampleFlag.CONTACT_LOST, ReadingFlag.CONTACT_LOST),
        (SampleFlag.JAMMED, ReadingFlag.JAMMED),
        (SampleFlag.OUT_OF_RANGE, ReadingFlag.OUT_OF_RANGE),
        (SampleFlag.DROPOUT, ReadingFlag.DROPOUTS),
    )
    flags = ReadingFlag.NONE
    for sample, reading in table:
        bad = sum(int(np.count_nonzero(s.flags & np.uint8(sample))) for s in scan.sweeps)
        if bad > 0.005 * scan.n_samples:
            flags |= reading
    return flags


def _nothing(timer: StepTimer, flags: ReadingFlag = ReadingFlag.NONE, **trace: Any) -> Reading:
    return Reading(
        characters=(),
        decision=Decision.REJECT,
        confidence=0.0,
        flags=flags | ReadingFlag.NO_CHARACTERS,
        seconds=MappingProxyType(dict(timer.seconds)),
        trace=ReadingTrace(**trace),
    )


def _best_turn(read: Callable[[int], Reading], turns: tuple[int, ...]) -> Reading:
    """The reading of a plate turned by one of these quarters: the first that is accepted, or the best."""
    best = read(turns[0])
    for quarters in turns[1:]:
        if best.decision is Decision.ACCEPT:
            break
        turned = read(quarters)
        if is_better(turned, best):
            best = turned
    return best


def _timed(reading: Reading, timer: StepTimer) -> Reading:
    return replace(reading, seconds=MappingProxyType(dict(timer.seconds)))


def _merit(tried: Reading) -> tuple[bool, float]:
    return (tried.decision is not Decision.REJECT, tried.trace.support_mm)
