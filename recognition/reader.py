"""The one composition: how a scan becomes a reading.

scan --edge_map--> EdgeMap --localise--> hypotheses --search--> line --refine--> cells --decide--> Reading
                      |                                                            |                ^
                      +------------------------relief-------------------------> mark depths --------+
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from glyphs.errors import MarksError
from glyphs.fonts.glyph import Font, FontError
from glyphs.fonts.outlines import BUILTIN_FONTS, load_font
from glyphs.fonts.serials import FormatError
from glyphs.soiling.soil import Soil
from glyphs.surface.maps import EdgeMap, HeightMap, MapError
from recognition.acceptance import Decided, ScoredLine, decide
from recognition.constrained_decoding import Choice
from recognition.depth import mark_depths
from recognition.depth_rules import judged_by
from recognition.evidence_cache import EvidenceCache
from recognition.grading import graded
from recognition.grammar import Grammar
from recognition.lattice import Lattice
from recognition.levelling import first_look, level
from recognition.lines import find_lines, hypotheses
from recognition.reader_settings import ReaderSettings
from recognition.reading import Decision, Reading, ReadingFlag
from recognition.refine import refine_line
from recognition.robust_reading import RobustReading, is_crisp, lattice_of_reading, read_robustly, untroubled
from recognition.search import LineFit, LineSearch
from recognition.step_timer import StepTimer
from recognition.templates import TemplateCache
from recognition.unseen_glyphs import doubted_guesses
from whisker_array.estimation.edges import edge_map
from whisker_array.estimation.profiled import estimate_relief
from whisker_array.estimation.relief import Relief, relief_from_edges
from whisker_array.scan.scan import Scan, trace_scan
from whisker_array.simulation.traces import SampleFlag
from whisker_array.whisker.array import default_plan
from whisker_array.whisker.touch import Touch, default_touch

__all__ = ["ALPHABET", "Reader", "ReaderSettings", "ReadingTrace", "relief_of"]

ALPHABET = "ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789"
MOST_SCANS = 2
"""Scales at which a height map is scanned in search of a reading that is accepted."""


@dataclass(frozen=True, eq=False)
class ReadingTrace:
    """A reading and what it was made from.

    Attributes:
        reading: the answer.
        edge_map: what matching worked on, if it came to that.
        scan: the moments, if it came to that.
        height_map: the levelled height map, if one was given.
        support_mm: length of line that the templates explain, weighted by how well.
        relief: heights and slopes as felt, if it came to that.
        lattice: beliefs of the places before the grammar has its say; None where nothing was read.
        choice: what the grammar made of them; None where the reading rests on correlation alone.
        open_lattice: beliefs over the whole alphabet, for verification.
    """

    reading: Reading
    edge_map: EdgeMap | None = None
    scan: Scan | None = None
    height_map: HeightMap | None = None
    support_mm: float = 0.0
    relief: Relief | None = None
    lattice: Lattice | None = None
    choice: Choice | None = None
    open_lattice: Lattice | None = None


class Reader:
    """Reads parts one after the other; keeps fonts and predicted templates between them."""

    def __init__(self, settings: ReaderSettings | None = None, *, fonts: tuple[Font, ...] = ()) -> None:
        """Load the fonts.

        Args:
            settings: what to read with.
            fonts: fonts already loaded (from a glyph database), beside those the settings name.

        Raises:
            FontError: a font that cannot be loaded, or that lacks what the format needs.
            FormatError: a format that cannot be met.
        """
        self.settings = settings if settings is not None else ReaderSettings()
        names = self.settings.fonts if self.settings.fonts or fonts else BUILTIN_FONTS
        self.fonts = (*fonts, *(load_font(name) for name in names))
        mask = self.settings.mask
        self.grammar = self.settings.grammar
        if self.grammar is None and mask is not None:
            if not mask.strip():
                raise FormatError(
                    f"the mask {mask!r} is blank", hint="write one character a position: A, 9, * or itself"
                )
            self.grammar = Grammar(mask=mask)
        self.places: tuple[str, ...] | None = None
        self.gaps: frozenset[int] = frozenset()
        chars = ALPHABET
        if self.grammar is not None:
            # characters that the format forbids are looked for as well: where one stands, it is not passed over
            chars = "".join(sorted({*ALPHABET, *self.grammar.characters}))
            lengths = self.grammar.lengths()
            if lengths is not None and len(lengths) == 1:
                self.places = self.grammar.places(next(iter(lengths)))
                self.gaps = self.grammar.gaps
        if self.places is not None:
            lacks = {
                font.name: next((p for p in self.places if not any(c in font.glyphs for c in p)), "")
                for font in self.fonts
            }
            if not (self.settings.fonts or fonts) and not all(lacks.values()):
                # of fonts that nobody named, those that can compete
                self.fonts = tuple(font for font in self.fonts if not lacks[font.name])
            for font in self.fonts:
                if lacks[font.name]:
                    raise FontError(
                        f"font {font.name!r} has no {lacks[font.name]!r}, which the format {mask or 'given'!r} needs"
                    )
        self.chars = chars
        self.cache = TemplateCache()

    def read_height_map(
        self, height_map: HeightMap, *, soil: Soil | None = None, part_id: str = ""
    ) -> ReadingTrace:
        """Mount, scan with the virtual array at the scale of the characters, and read.

        Of several plausible character heights each is scanned, until one reads well.

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
        heights = (self.settings.height_mm,) if self.settings.height_mm else look.heights_mm
        if not heights:
            return ReadingTrace(_nothing(timer), height_map=levelled)
        best: ReadingTrace | None = None
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
            tried = self._read(scan, timer, height_map=levelled)
            if best is None or _merit(tried) > _merit(best):
                best = tried
            if best.reading.decision is Decision.ACCEPT:
                break
        assert best is not None
        return best

    def read_scan(self, scan: Scan) -> ReadingTrace:
        """Read a recorded or simulated scan."""
        return self._read(scan, StepTimer(), height_map=None)

    def _read(self, scan: Scan, timer: StepTimer, *, height_map: HeightMap | None) -> ReadingTrace:
        with timer.step("edge map"):
            try:
                edges = edge_map(scan)
            except MapError:
                return ReadingTrace(_nothing(timer, _scan_flags(scan)), scan=scan, height_map=height_map)
        with timer.step("depth"):
            relief = relief_of(scan, edges)
        found = self.read_edge_map(edges, scan.touch, relief=relief, timer=timer, flags=_scan_flags(scan))
        return replace(found, scan=scan, height_map=height_map)

    def read_edge_map(
        self,
        edges: EdgeMap,
        touch: Touch,
        *,
        relief: Relief | None = None,
        timer: StepTimer | None = None,
        flags: ReadingFlag = ReadingFlag.NONE,
    ) -> ReadingTrace:
        """Read an edge map felt with the given touch. Without a relief the reading tells no depths."""
        timer = timer if timer is not None else StepTimer()
        made = ReadingTrace(_nothing(timer, flags), edge_map=edges, relief=relief)
        search = LineSearch(edges, touch, self.cache, chars=self.chars, places=self.places)
        look = EvidenceCache(search, places=self.places, gaps=self.gaps)
        with timer.step("localise"):
            tried = hypotheses(search, self.fonts, height_mm=self.settings.height_mm)
        if not tried:
            return made
        with timer.step("search"):
            height_known = self.settings.height_mm is not None
            lines = find_lines(search, tried, height_known=height_known, look=look)
        if not lines:
            return made
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
        return replace(
            made,
            reading=_timed(reading, timer),
            support_mm=support,
            lattice=lattice,
            choice=choice,
            open_lattice=lattice,
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


def _nothing(timer: StepTimer, flags: ReadingFlag = ReadingFlag.NONE) -> Reading:
    return Reading(
        characters=(),
        decision=Decision.REJECT,
        confidence=0.0,
        flags=flags | ReadingFlag.NO_CHARACTERS,
        seconds=MappingProxyType(dict(timer.seconds)),
    )


def _timed(reading: Reading, timer: StepTimer) -> Reading:
    return replace(reading, seconds=MappingProxyType(dict(timer.seconds)))


def _merit(tried: ReadingTrace) -> tuple[bool, float]:
    return (tried.reading.decision is not Decision.REJECT, tried.support_mm)
