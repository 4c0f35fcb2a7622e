"""Read parts by touch: from a height map or a scan to a reading.

height map --height of the lines on it--> scan
scan --edge_map, relief--> felt view --find--> line and posteriors --templates, format--> Reading
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import astuple, replace
from functools import lru_cache
from types import MappingProxyType
from typing import Any

import numpy as np

from glyphs.fonts.glyph import Font
from glyphs.soiling.soil import Soil
from glyphs.stamping.faces import Face
from glyphs.surface.maps import EdgeMap, HeightMap, MapError
from recognition.decision.contracts import doubted_guesses
from recognition.decision.decide import Finding, ReadingFlag
from recognition.decision.depth_rules import judged_by
from recognition.decision.layouts import with_layout
from recognition.decision.reading import Reading, ReadingTrace
from recognition.decision.reading_of_line import reading_of_line
from recognition.decision.score import score_of, serial_is_sure, with_score
from recognition.decision.stroke_doubts import add_stroke_findings, only_whole
from recognition.decision.which_way_up import plain_text, weigh_orientation
from recognition.find.find import find
from recognition.find.first_pass import Feel, felt_heights_mm, virtual_feel
from recognition.find.orientation import LEAST_LEAD_NATS, other_reading
from recognition.find.template_fonts import TemplateFonts
from recognition.glyph_match.felt_line import FeltLine, felt_line
from recognition.glyph_match.laid_line import with_depths
from recognition.glyph_match.pose import Floats
from recognition.glyph_match.predicted import MOST_SETS, TemplateSet, predict_templates, template_key
from recognition.glyph_match.prototypes import felt_prototypes, match_fonts
from recognition.language.lattice import Lattice
from recognition.language.orientation import Way
from recognition.marks.grade import OWN_FIT, edge_fit, edges_of, grades_of
from recognition.marks.laid_text import laid_text
from recognition.marks.no_depth import NoDepth
from recognition.marks.strokes import reject_false_lines, strokes_of
from recognition.marks.unknown_font import line_depths
from recognition.recogniser.read_line import ReadLine
from recognition.senses.settings import ReaderSettings, Repertoire
from recognition.senses.step_timer import StepTimer
from recognition.views.levelling import filled_note, level, square_to_plate
from recognition.views.text_line import TextLine
from recognition.views.view import View, felt_view, relief_of
from whisker_array.estimation.edges import edge_map
from whisker_array.estimation.faults import Fault, FaultKind, find_faults, flag_faults
from whisker_array.estimation.relief import Relief
from whisker_array.scan.scan import Scan, positions_mm
from whisker_array.simulation.traces import SampleFlag
from whisker_array.whisker.touch import Touch


class TactileReader:
    """Reads parts by touch, one after the other; keeps fonts and predicted templates between them."""

    def __init__(self, settings: ReaderSettings | None = None) -> None:
        """Load the fonts.

        Raises:
            FontError: a font cannot be loaded, or lacks characters that the format needs.
        """
        self.settings = (settings if settings is not None else ReaderSettings()).of("tactile")
        repertoire = Repertoire(self.settings)
        self.places, self.fonts, self.named = repertoire.places, repertoire.fonts, bool(self.settings.fonts)
        self.strokes_of = repertoire.strokes_of
        # room for all named fonts: they are compared on every part
        self.predict = lru_cache(max(MOST_SETS, len(self.fonts)))(predict_templates)
        self.request = repertoire.request
        if "network" not in self.settings.experts:
            self.request = replace(self.request, templates=TemplateFonts(self.fonts, self.predict))

    def read_height_map(
        self,
        height_map: HeightMap,
        *,
        soil: Soil | None = None,
        part_id: str = "",
        feel: Feel | None = None,
    ) -> Reading:
        """Mount a surface, scan it with the virtual array at the scale of the characters, and read the scan.

        Args:
            height_map: surface of the part, with the top of any dirt on it.
            soil: dirt into which the tip sinks, and the part's friction, if known.
            part_id: name of the part.
            feel: function that scans the surface (default: the default plan with ideal sensors).

        Raises:
            MapError: the map cannot be scanned, or the soil is on another grid.
        """
        timer = StepTimer()
        with timer.step("mount"):
            height_map, soil = square_to_plate(height_map, soil)
            levelled = level(height_map)
        with timer.step("first pass"):
            heights = felt_heights_mm(
                self.request, levelled, fidelity=self.settings.fidelity, soil=soil, feel=feel
            )
        notes = filled_note(height_map, levelled)
        feel = feel or virtual_feel(fidelity=self.settings.fidelity, soil=soil, part_id=part_id)
        best: Reading | None = None
        for height in heights:
            with timer.step("scan"):
                scan = feel(levelled, height)
            tried = replace(self._read(scan, timer), notes=notes).with_trace(height_map=levelled)
            if best is None or tried.nats_read > best.nats_read:
                best = tried
            if serial_is_sure(best):
                break
        return best if best is not None else _nothing(timer, height_map=levelled)

    def read_scan(self, scan: Scan) -> Reading:
        """Read a recorded or simulated scan; report faults of whiskers and bench, and leave out samples they spoil."""
        timer = StepTimer()
        with timer.step("faults"):
            faults = find_faults(scan)
            usable = flag_faults(scan, faults)
        return self._read(usable, timer).with_findings(*bench_findings(faults))

    def _read(self, scan: Scan, timer: StepTimer) -> Reading:
        with timer.step("edge map"):
            try:
                edges = edge_map(scan)
            except MapError:
                return _nothing(timer, _scan_flags(scan), scan=scan)
        with timer.step("relief"):
            relief = relief_of(scan, edges)
        reading = self.read_edge_map(
            edges,
            scan.touch,
            relief=relief,
            timer=timer,
            flags=_scan_flags(scan),
            saturated_mm=positions_mm(scan, SampleFlag.SATURATED),
        )
        return reading.with_trace(scan=scan)

    def read_edge_map(
        self,
        edges: EdgeMap,
        touch: Touch,
        *,
        relief: Relief | None = None,
        timer: StepTimer | None = None,
        flags: ReadingFlag = ReadingFlag.NONE,
        about: TextLine | None = None,
        saturated_mm: Floats | None = None,
    ) -> Reading:
        """Read an edge map that was felt with a known touch.

        Args:
            edges: the edge map.
            touch: whisker, preload and friction with which it was felt.
            relief: heights and slopes; without them the reading has no depths.
            timer: records the time of each step.
            flags: flags of the scan.
            about: position of the line, if known; no other line is searched for.
            saturated_mm: (n, 2) x, y of clipped samples: characters there have no depth.
        """
        timer = timer if timer is not None else StepTimer()
        view, felt = felt_view(edges, relief, touch), None
        with timer.step("read"):
            part = find([view], self.request, about=about, twice=True)
            main = part.main
            if main is not None:
                if relief is not None:
                    text = main.lattice.text
                    felt = felt_line(view, main.line, main.columns, text, self.strokes_of)
                    part = reject_false_lines(part, felt, self.strokes_of)
                part = replace(part, main=main.with_experts(self._templates(view, main, felt)))
        reading = reading_of_line(part, self.settings, flags=flags, source="tactile")
        if part.main is not None and reading.characters and felt is not None and relief is not None:
            with timer.step("strokes"):
                reading = self._with_strokes(reading, part.main, felt)
            with timer.step("measure"):
                reading = only_whole(self._with_depths(reading, part.main, relief))
            if saturated_mm is not None and len(saturated_mm):
                reading = _without_clipped_depths(reading, saturated_mm, int(edges.valid.sum()))
        reading = add_stroke_findings(reading)
        reading = judged_by(reading, self.settings.depth_rules).with_trace(edge_map=edges, relief=relief)
        reading = with_score(reading)
        reading = weigh_orientation(reading, part, self.request)
        if main is not None:
            there = other_reading(main, Way.ROWS_REVERSED, plain_text(reading), self.request.grammar)
            reading = reading.with_trace(mirrored_lead_nats=None if there is None else there.lead_nats)
        reading = with_layout(reading, part, self.request.grammar)
        return replace(reading, seconds=MappingProxyType(dict(timer.seconds)))

    def with_unknown_rows(self) -> TactileReader:
        """The same reader for maps whose rows may be in reverse order: lines are read mirrored as well."""
        reader = copy(self)
        reader.request = replace(self.request, rows_known=False)
        return reader

    def may_be_mirrored(self, reading: Reading) -> bool:
        """Whether the rows may be in reverse order: little is read, or the mirrored line reads about as well."""
        lead = reading.trace.mirrored_lead_nats
        little = reading.nats_read <= self.request.limits.plain * len(reading.characters)
        return little or (lead is not None and lead < LEAST_LEAD_NATS)

    def _templates(self, view: View, main: ReadLine, felt: FeltLine | None) -> dict[str, Lattice]:
        """Match the named fonts to a line."""
        if not self.settings.templates_judge or "templates" in main.by_expert or not main.columns.size:
            return {}
        line, columns = (main.line, main.columns) if felt is None else (felt.line, felt.columns)
        raised = felt is not None and felt.raised
        fonts = [font for font in self.fonts if self.request.chars_of(font)]
        if not fonts:
            return {}
        sets = [self._template_set(font, view, line.height_mm, raised=raised) for font in fonts]
        prototypes = [[felt_prototypes(one)] for one in sets]
        lattice, best = match_fonts([view], line, columns, prototypes, main.lattice)
        if felt is not None:
            together = main.with_experts({"templates": lattice}).lattice
            lattice = with_depths(lattice, together, felt, fonts[best])
        return {"templates": lattice}

    def _template_set(
        self, font: Font, view: View, height_mm: float, *, raised: bool, face: Face = Face.FLAT
    ) -> TemplateSet:
        """Templates of a font's characters, predicted for the touch of a view."""
        # the height found differs from part to part, and each new height takes 0.5 s to predict
        height_mm = self.settings.height_mm or height_mm
        assert view.touch is not None  # a felt view has one
        key = template_key(font, view.touch, height_mm=height_mm, raised=raised, face=face)
        return self.predict(font, self.request.chars_of(font), key)

    def _with_strokes(self, reading: Reading, main: ReadLine, felt: FeltLine) -> Reading:
        """Lay the text on the line and add evidence for its strokes and those of rival characters."""
        text = [c.char for c in reading.characters]
        laid = laid_text(felt, text, self.fonts, stand_ins=self.strokes_of[len(self.fonts) :])
        strokes = () if laid is None else strokes_of(laid, main.lattice, slope=score_of("tactile").slope)
        resized = felt.line is not main.line and reading.height_mm == main.line.height_mm
        height_mm = felt.line.height_mm if resized else reading.height_mm
        sized = replace(reading, height_mm=height_mm, raised=felt.raised)
        return sized.with_trace(laid=laid, strokes=strokes)

    def _with_depths(self, reading: Reading, main: ReadLine, relief: Relief) -> Reading:
        """Add depths and grades, along the strokes of the named font, or of the font that fits each character."""
        best = reading.trace.laid
        laid = best
        if best is not None and best.font not in self.fonts:
            laid = laid_text(best.felt, best.text, self.fonts)
        if best is None or laid is None:
            return reading
        others = [
            best if font is best.font else laid.in_font(font)
            for font in self.strokes_of
            if font is not laid.font
        ]
        line = line_depths(relief, laid, others, named=self.named)
        measured = tuple(
            replace(c, no_depth=depth) if isinstance(depth, NoDepth) else replace(c, depth=depth)
            for c, depth in zip(reading.characters, line.depths, strict=True)
        )
        reading = replace(reading, characters=measured)
        if not line.font_fits:
            what = f"the font {laid.font.name} does not fit the marks (name the right font, or none)"
            foreign = [Finding(ReadingFlag.FOREIGN_SHAPES, what)] if self.named else []
            return reading.with_findings(*foreign)
        templates = self._template_set(
            laid.font, laid.felt.view, laid.height_mm, raised=laid.felt.raised, face=laid.face
        )
        edges = edges_of(laid, templates)
        if not self.named and edge_fit(edges) < OWN_FIT:
            return reading
        graded = tuple(
            replace(c, grade=grade) if same else c
            for c, grade, same in zip(reading.characters, grades_of(edges), line.same_strokes, strict=True)
        )
        settled = replace(
            reading,
            characters=graded,
            font=laid.font.name,
            height_mm=laid.height_mm,
            rotation_deg=laid.rotation_deg,
        )
        # the network judges each character by itself; templates only compare characters that were felt
        alone = "network" not in main.by_expert
        return doubted_guesses(settled, laid, self.places) if alone else settled


def _scan_flags(scan: Scan) -> ReadingFlag:
    """Flags that more than 0.5 % of the samples have."""
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


def _without_clipped_depths(
    reading: Reading, saturated_mm: Floats, samples: int, *, few: int = 3, land_share: float = 0.01
) -> Reading:
    """Remove the depths of characters in which samples are clipped; of all, if the land is clipped as well.

    Args:
        reading: with depths.
        saturated_mm: (n, 2) x, y of clipped samples.
        samples: samples of the edge map.
        few: number of clipped samples from which the depth of a character is not trusted.
        land_share: clipped samples outside of the characters, as a share of those of the map, from which the level of
            the land, and so every depth, is not trusted.
    """
    low, high = np.array([astuple(c.box) for c in reading.characters]).reshape(-1, 2, 2).transpose(1, 0, 2)
    points = saturated_mm[:, None]
    inside = np.asarray(np.logical_and.reduce((points >= low) & (points <= high), axis=2))
    clipped = inside.sum(axis=0) >= few
    clipped |= np.count_nonzero(~inside.any(axis=1)) > land_share * samples
    characters = (
        replace(c, depth=None, no_depth=NoDepth.SATURATED) if bad else c
        for c, bad in zip(reading.characters, clipped, strict=True)
    )
    return replace(reading, characters=tuple(characters))


def bench_findings(faults: Sequence[Fault]) -> tuple[Finding, ...]:
    """Return faults of whiskers and bench as findings of a reading."""
    return tuple(Finding(_flag_of(f), f.text) for f in faults)


def _flag_of(fault: Fault) -> ReadingFlag:
    # marks at wrong places may read as another serial
    if fault.kind in (FaultKind.EXCHANGED, FaultKind.DOUBLED):
        return ReadingFlag.CHANNELS_MIXED
    return ReadingFlag.BENCH_FAULTY if fault.whisker is None else ReadingFlag.WHISKER_FAULTY


def _nothing(timer: StepTimer, flags: ReadingFlag = ReadingFlag.NONE, **trace: Any) -> Reading:
    return Reading(
        characters=(),
        confidence=0.0,
        flags=flags | ReadingFlag.NO_CHARACTERS,
        seconds=MappingProxyType(dict(timer.seconds)),
        trace=ReadingTrace(**trace),
    )
