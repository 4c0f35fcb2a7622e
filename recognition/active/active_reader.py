"""Active reading: feel a step, read the line quickly, then stop or choose the next step.

    session --feel--> passes so far --edge map--> view --look--> posterior --sure? no gain?--> stop
                           ^-------------------- next step <------------------'

A look is a quick reading of some 50 milliseconds. A full reading, which has more experts, is made if a look is sure,
after every few unsure looks, and before giving up. Later looks follow the line that it found.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from glyphs.surface.display import OneLine
from glyphs.surface.maps import EdgeMap, MapError
from recognition.active.active_reading import ActiveReading, StopReason, stage_failure
from recognition.active.moves import FIRST, Region, Step, Way
from recognition.active.policy import Greedy, Policy, Progress
from recognition.active.watch import LineWatch, Look
from recognition.decide.decision import BESIDE_SERIAL, Finding, ReadingFlag
from recognition.decide.evidence import EVEN, Log, SenseEvidence
from recognition.decide.reading import Reading
from recognition.marks.lines_felt import LackingLines, places_lacking_lines
from recognition.see.text_line import TextLine
from recognition.touch import TactileReader, bench_findings, nothing_felt, see_scan
from whisker_array.estimation.edges import edge_map
from whisker_array.estimation.faults import Fault, find_faults, flag_faults
from whisker_array.scan.pass_log import LoggedPass
from whisker_array.scan.scan import Scan
from whisker_array.scan.session import Fitting, StageSession, gather_sweeps
from whisker_array.scan.stage_error import StageError
from whisker_array.scan.sweep import Sweep
from whisker_array.whisker.array import LINES_PER_HEIGHT

MARGIN_HEIGHTS = (0.8, 0.5)
"""Margin of land to feel around a found line, along it and across it, character heights."""
FIRST_LOOK_DOUBT = 0.1
"""Share of the doubt allowed for acceptance below which a single look triggers a full reading."""
LOOKS_PER_READING = 4
"""Number of looks between two full readings if no look is sure: a full reading takes as long as four looks."""
TOUCHABLE = (
    ReadingFlag.LOW_CONFIDENCE
    | ReadingFlag.FORMAT_OVERRULED
    | ReadingFlag.FORMAT_NOT_MET
    | ReadingFlag.SEARCH_EXHAUSTED
    | ReadingFlag.FOREIGN_SHAPES
    | ReadingFlag.NO_CHARACTERS
    | ReadingFlag.STROKES_MISSING
    | ReadingFlag.STROKES_UNDECIDED
    | ReadingFlag.NOT_WHOLE
    | ReadingFlag.TOO_FEW_LINES
    | ReadingFlag.BELIEVED_OTHERWISE
)
"""Flags that further passes may clear."""


@dataclass(frozen=True, repr=False)
class ActiveSettings(OneLine):
    """Settings of active touch; without `until_sure` only the policy or the budget ends it. Raises ValueError."""

    budget_s: float = 20.0
    policy: Policy = field(default_factory=Greedy)
    until_sure: bool = True

    def __post_init__(self) -> None:
        if not self.budget_s > 0.0:
            raise ValueError(f"budget_s is {self.budget_s}; it must be positive")


class ActiveReader:
    """Chooses each pass over a part on a stage: `ActiveReader(Reader(format="AA999999").touch).read(session)`."""

    def __init__(self, reader: TactileReader, settings: ActiveSettings | None = None) -> None:
        self.reader = reader
        self.settings = settings if settings is not None else ActiveSettings()

    def read(
        self, session: StageSession, *, region_mm: Region | None = None, line: TextLine | None = None
    ) -> ActiveReading:
        """Feel and read the part near `line` or in `region_mm` (x0, y0, x1, y1), if known; the session stays open."""
        if region_mm is None and line is not None:
            region_mm = region_around(line, session.fitting.field_mm)
        return _Part(self, session, region_mm, line).read()


@dataclass
class _Part:
    active: ActiveReader
    session: StageSession
    requested_mm: Region | None
    line: TextLine | None
    passes: list[LoggedPass] = field(default_factory=list)
    evidence: SenseEvidence | None = None
    problem: str = ""

    def __post_init__(self) -> None:
        self.fitting = self.session.fitting
        self.region = self.requested_mm if self.requested_mm is not None else self.fitting.field_mm
        self.mapped = self.region
        self.watch = LineWatch(self.active.reader.request, line=self.line)
        self.progress = Progress(self.fitting)
        request = self.active.reader.request
        # feel the whole region if the caller set it, if the search has its own, or if there are further lines to read
        self.may_shrink = self.requested_mm is None and request.region is None and not request.lines
        # a full reading follows the first look, because it finds the line best
        self.looks_since = LOOKS_PER_READING
        self.accept = self.active.reader.settings.least_score("tactile")
        self.texts: set[str] = set()
        self.edges: EdgeMap | None = None
        self.unseen: MapError | None = None
        self.scan: Scan | None = None
        self.faults: tuple[Fault, ...] = ()
        self.missing: tuple[LackingLines, ...] = ()

    def read(self) -> ActiveReading:
        stop = self._make_steps()
        sure_at_look = stop is StopReason.SURE
        if self.evidence is None or self.looks_since:
            self._look()
            self.evidence = self._full_evidence()
        findings = list(bench_findings(self.faults))
        if stop is StopReason.STAGE_FAILED:
            note = stage_failure(self.problem, passes=len(self.passes))
            findings.append(Finding(ReadingFlag.STAGE_FAILED, note))
        evidence = self.evidence.logged(findings=(*findings, *self.evidence.log.findings))
        reading = self._reading_of(evidence)
        until_sure = self.active.settings.until_sure and stop is not StopReason.STAGE_FAILED
        if until_sure and reading.serial_is_sure:
            stop = StopReason.SURE
        if not reading.characters and stop is StopReason.NO_GAIN:
            stop = StopReason.NOTHING_FOUND
        return ActiveReading(
            evidence, reading, tuple(self.passes), stop, self.mapped, steps=self.progress.history,
            sure_at_look=sure_at_look, problem=self.problem,
        )  # fmt: skip

    def _make_steps(self) -> StopReason:
        settings = self.active.settings
        while True:
            chosen = self._next(left_s=settings.budget_s - self.progress.stage_s)
            if isinstance(chosen, StopReason):
                # before giving up, make a full reading of all passes
                if chosen is not StopReason.NO_GAIN or not self.looks_since or not settings.until_sure:
                    return chosen
                ended = self._stop_reason()
            elif self._feel(chosen):
                ended = self._judge(chosen)
            else:
                return StopReason.STAGE_FAILED
            if ended is not None:
                return ended

    def _judge(self, step: Step) -> StopReason | None:
        until_sure = self.active.settings.until_sure
        # without early stopping, looks are only needed to find the region of the line
        look = self._look() if until_sure or self.region == self.fitting.field_mm else None
        self.progress = self.progress.after(step, look)
        self.looks_since += 1
        ended = self._stop_reason() if until_sure and self._reading_is_due(look) else None
        text, confidence = ("", 0.0) if look is None else (look.text, look.confidence)
        self.passes[-1] = replace(self.passes[-1], text=text, confidence=confidence)
        return ended

    def _next(self, *, left_s: float) -> Step | StopReason:
        # the lines of a dead whisker stay missing whatever is felt, so a way gets at most FIRST lines here
        ways = [way for way in Way if self.progress.lines.get(way, 0) < FIRST]
        wanted = [
            way for way in ways if any(way.direction.along_x is place.along_x for place in self.missing)
        ]
        steps = self.progress.candidates(self.region, wanted)
        if not steps:
            return self.active.settings.policy.choose(self.progress, self.region, left_s=left_s)
        cheapest = min(steps, key=lambda step: step.stage_s)
        return cheapest if cheapest.stage_s <= left_s else StopReason.BUDGET

    def _feel(self, step: Step) -> bool:
        for order in step.passes:
            try:
                sweep = self.session.feel(order)
            except StageError as error:
                self.problem = str(error)
                return False
            self.passes.append(LoggedPass(order, sweep, why=step.way.purpose))
        return True

    def _look(self) -> Look | None:
        if not self.passes:
            return None
        raw = scan_of(self.fitting, [felt.sweep for felt in self.passes])
        self.faults = find_faults(raw)
        self.scan = flag_faults(raw, self.faults)
        try:
            self.edges, self.mapped = edge_map(self.scan, within_mm=self.region), self.region
        except MapError as error:
            self.edges, self.unseen = None, error
            return None
        look = self.watch.look(see_scan(self.scan, self.edges)[0])
        if look is not None and self.may_shrink and self.watch.is_sure and not look.others:
            self.region = region_around(look.read.line, self.fitting.field_mm)
        return look

    def _reading_is_due(self, look: Look | None) -> bool:
        if self.edges is None:
            return False
        if self.looks_since >= LOOKS_PER_READING:
            return True
        if self.missing:
            return True
        if look is None or look.confidence < self.accept:
            return False
        return self.progress.steady >= 1 or look.confidence >= 1.0 - FIRST_LOOK_DOUBT * (1.0 - self.accept)

    def _stop_reason(self) -> StopReason | None:
        self.evidence, self.looks_since = self._full_evidence(), 0
        reading = self._reading_of(self.evidence)
        self.watch.follow(reading.trace.line, confidence=reading.confidence)
        self.progress = self.progress.with_confidence(reading.confidence)
        sure = reading.is_sure_but_for(BESIDE_SERIAL | ReadingFlag.TOO_FEW_LINES)
        self.missing = ()
        if sure and self.scan is not None:
            boxes, strokes = [place.box for place in reading.characters], reading.trace.strokes
            self.missing = places_lacking_lines(self.scan, boxes, strokes, height_mm=reading.height_mm)
        if sure:
            return None if self.missing else StopReason.SURE
        doubts = reading.flags & ~TOUCHABLE
        return StopReason.NO_GAIN if doubts and not reading.flags & TOUCHABLE else None

    def _reading_of(self, evidence: SenseEvidence) -> Reading:
        reading = self.active.reader.reading_of(evidence)
        if reading.confidence > EVEN:
            self.texts.add(reading.plain_text)
        return reading

    def _full_evidence(self) -> SenseEvidence:
        others = frozenset(self.texts)
        if self.scan is None:
            return SenseEvidence("tactile")
        if self.edges is None:
            assert self.unseen is not None
            return nothing_felt(self.unseen, Log(scan=self.scan, chosen_passes=True, other_texts=others))
        evidence = self.active.reader.of_scan(self.scan, about=self.line, edges=self.edges)
        return evidence.logged(chosen_passes=True, other_texts=others)


def region_around(line: TextLine, field_mm: Region) -> Region:
    """Return the region to feel around a line, within the field."""
    along_mm, across_mm = (share * line.height_mm for share in MARGIN_HEIGHTS)
    across_mm += 0.5 * line.height_mm  # the characters themselves
    upright = 45.0 <= abs(line.turned_deg) <= 135.0
    reach_mm = (across_mm, along_mm) if upright else (along_mm, across_mm)
    x0, y0 = np.maximum(line.centre_mm.min(axis=0) - reach_mm, field_mm[:2]).tolist()
    x1, y1 = np.minimum(line.centre_mm.max(axis=0) + reach_mm, field_mm[2:]).tolist()
    return x0, y0, x1, y1


def scan_of(fitting: Fitting, felt: Sequence[Sweep]) -> Scan:
    """Combine the passes so far into one scan."""
    line_pitch_mm = fitting.height_mm / LINES_PER_HEIGHT
    return Scan(
        sweeps=gather_sweeps(felt),
        touch=fitting.touch,
        line_pitch_mm=line_pitch_mm,
        sample_rate_hz=fitting.speed_mm_s / line_pitch_mm,
        calibration=fitting.calibration,
        part_id=fitting.part_id,
        fidelity=fitting.fidelity,
    )
