"""Evidence by touch: from a scan to the marks on its lines.

Scan --see--> felt view --find--> lines --measure--> marks
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from glyphs.errors import MarksError
from glyphs.fonts.glyph import Font
from glyphs.stamping.faces import Face
from glyphs.surface.maps import EdgeMap, MapError
from recognition.decide.decide import decide
from recognition.decide.decision import Finding, ReadingFlag
from recognition.decide.evidence import Evidence, Log, SenseEvidence
from recognition.decide.reading import Reading
from recognition.find.deadline import Deadline
from recognition.find.find import find
from recognition.find.orientation import LEAST_LEAD_NATS, other_reading
from recognition.find.template_fonts import TemplateFonts
from recognition.glyph_match.face_library import face_library
from recognition.glyph_match.faces import compare_faces, read_faces
from recognition.glyph_match.felt_line import FeltLine
from recognition.glyph_match.predicted import MOST_SETS, TemplateSet, predict_templates, template_key
from recognition.glyph_match.prototypes import felt_prototypes
from recognition.language.orientation import Way
from recognition.marks.measure import MarkFonts, measure
from recognition.marks.strokes import reject_false_lines
from recognition.recogniser.read_line import ReadLine
from recognition.recogniser.recogniser import features_of
from recognition.see.text_line import TextLine
from recognition.see.view import View, felt_relief, felt_view
from recognition.settings import ReaderSettings, Repertoire
from recognition.step_times import StepTimes
from whisker_array.estimation.edges import edge_map
from whisker_array.estimation.faults import Fault, FaultKind, find_faults, flag_faults
from whisker_array.scan.scan import Scan, positions_mm
from whisker_array.simulation.traces import SampleFlag


class TactileReader:
    """Makes evidence of scans; keeps fonts and predicted templates between them. Raises FontError."""

    def __init__(self, settings: ReaderSettings | None = None) -> None:
        self.settings = settings if settings is not None else ReaderSettings()
        repertoire = Repertoire(self.settings)
        fonts, self.named = repertoire.fonts, repertoire.named
        # room for all named fonts: they are compared on every part
        self.predict = lru_cache(max(MOST_SETS, len(fonts)))(predict_templates)
        self.fonts = MarkFonts(fonts, repertoire.stand_ins, bool(self.named), self._templates_of)
        self.request = repertoire.request
        if "network" not in self.settings.experts:
            self.request = replace(self.request, templates=TemplateFonts(fonts, self.predict))

    def of_recording(
        self, scan: Scan, *, within_mm: tuple[float, float, float, float] | None = None
    ) -> SenseEvidence:
        """Evidence of a recorded scan, without samples that faults of whiskers and bench spoil."""
        times, deadline = StepTimes(), Deadline(self.settings.limit_s)
        with times.step("faults"):
            faults = find_faults(scan)
            usable = flag_faults(scan, faults)
        evidence = self.requesting(deadline=deadline).of_scan(usable, times=times, within_mm=within_mm)
        findings = (*bench_findings(faults), *evidence.log.findings)
        return evidence.logged(findings=findings, stopped=deadline.stopped)

    def of_scan(
        self,
        scan: Scan,
        *,
        times: StepTimes | None = None,
        about: TextLine | None = None,
        edges: EdgeMap | None = None,
        within_mm: tuple[float, float, float, float] | None = None,
    ) -> SenseEvidence:
        """Evidence of a scan, or of the area `within_mm` of it; if `about` is given, no other line is searched for."""
        times = times if times is not None else StepTimes()
        log = Log(scan_findings(scan), scan=scan, rows_known=self.request.rows_known)
        with times.step("see"):
            try:
                view, notes = see_scan(scan, edge_map(scan, within_mm=within_mm) if edges is None else edges)
            except MapError as error:
                return nothing_felt(error, replace(log, seconds=times.seconds))
        with times.step("find"):
            part = find([view], self.request, about=() if about is None else (about,), twice=True)
        with times.step("measure"):
            marks, main = None, part.main
            if main is not None:
                clipped_mm = positions_mm(scan, SampleFlag.SATURATED)
                marks = measure(view, main, self.fonts, clipped_mm=clipped_mm)
                felt = None if marks is None else marks.felt
                if felt is not None:
                    part = reject_false_lines(part, felt, self.fonts.every)
                part = replace(part, main=self._with_faces(view, main, felt))
        log = replace(log, notes=notes, seconds=times.seconds)
        return SenseEvidence("tactile", (view,), part, marks, log)

    def reading_of(self, evidence: SenseEvidence) -> Reading:
        """The reading by touch alone, to choose the surest of several looks."""
        return decide(Evidence.of(evidence), self.settings)

    def requesting(self, **fields: Any) -> TactileReader:
        """The same reader with other fields of its request."""
        reader = copy(self)
        reader.request = replace(self.request, **fields)
        return reader

    def may_be_mirrored(self, evidence: SenseEvidence, reading: Reading) -> bool:
        """Whether the rows may be in reverse order: little is read, or the mirrored line reads about as well."""
        little = reading.nats_read <= self.request.limits.plain * len(reading.characters)
        if little or evidence.main is None:
            return True
        there = other_reading(evidence.main, Way.ROWS_REVERSED, reading.plain_text, self.request.grammar)
        return there is not None and there.lead_nats < LEAST_LEAD_NATS

    def _with_faces(self, view: View, main: ReadLine, felt: FeltLine | None) -> ReadLine:
        if not self.settings.faces_judge or not main.columns.size:
            return main
        line, columns = (main.line, main.columns) if felt is None else (felt.line, felt.columns)
        raised = felt is not None and felt.raised
        fonts = [font for font in self.named if self.request.chars_of(font)]
        library = face_library("tactile")
        named = [
            felt_prototypes(
                self._templates_of(font, view, line.height_mm, raised=raised), library.map, font.name
            )
            for font in fonts
        ]
        features, network = features_of(view.strip(line)), main.by_expert["network"]
        cosines = compare_faces([features], columns, named, library.faces, library.map, network)
        return read_faces(main, cosines, "tactile", felt=felt, fonts=fonts)

    def _templates_of(
        self, font: Font, view: View, height_mm: float, *, raised: bool, face: Face = Face.FLAT
    ) -> TemplateSet:
        # the height found differs from part to part, and each new height takes 0.5 s to predict
        height_mm = self.settings.height_mm or height_mm
        assert view.touch is not None  # a felt view has one
        key = template_key(font, view.touch, height_mm=height_mm, raised=raised, face=face)
        return self.predict(font, self.request.chars_of(font), key)


def see_scan(scan: Scan, edges: EdgeMap) -> tuple[View, tuple[str, ...]]:
    """View of a scan by its edge map, and a note if it has no heights."""
    try:
        return felt_view(edges, felt_relief(scan, edges), scan.touch), ()
    except MarksError as error:
        return felt_view(edges, None, scan.touch), (f"no depth was measured: {error}",)


def nothing_felt(error: MapError, log: Log) -> SenseEvidence:
    """Evidence of a scan that shows nothing, with the reason."""
    problem = Finding(ReadingFlag.NO_CHARACTERS, f"no characters found: {error}")
    return SenseEvidence("tactile", log=replace(log, findings=(problem, *log.findings)))


def scan_findings(scan: Scan, *, most_share: float = 0.005) -> tuple[Finding, ...]:
    """Report what is wrong with more than a share of the samples."""
    table = (
        (SampleFlag.CONTACT_LOST, ReadingFlag.CONTACT_LOST),
        (SampleFlag.JAMMED, ReadingFlag.JAMMED),
        (SampleFlag.OUT_OF_RANGE, ReadingFlag.OUT_OF_RANGE),
        (SampleFlag.DROPOUT, ReadingFlag.DROPOUTS),
    )

    def bad_samples(flag: SampleFlag) -> int:
        return sum(int(np.count_nonzero(sweep.flags & np.uint8(flag))) for sweep in scan.sweeps)

    most = most_share * scan.n_samples
    return tuple(Finding.of(flag) for sample, flag in table if bad_samples(sample) > most)


def bench_findings(faults: Sequence[Fault]) -> tuple[Finding, ...]:
    """Return faults of whiskers and bench as findings of a reading."""
    return tuple(Finding(_flag_of(fault), fault.text) for fault in faults)


def _flag_of(fault: Fault) -> ReadingFlag:
    # marks at wrong places may read as another serial
    if fault.kind in (FaultKind.EXCHANGED, FaultKind.DOUBLED):
        return ReadingFlag.CHANNELS_MIXED
    return ReadingFlag.BENCH_FAULTY if fault.whisker is None else ReadingFlag.WHISKER_FAULTY
