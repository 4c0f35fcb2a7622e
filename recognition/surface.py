"""Evidence by touch of a surface: the virtual array scans it at the scale of its characters.

surface --first pass--> heights of characters --one after the other, until sure--> Scan --TactileReader--> evidence
order of its rows unknown, and not sure --> the mirrored surface likewise; the one that reads more counts
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from glyphs.soiling.soil import Soil
from glyphs.surface.display import one_line
from glyphs.surface.maps import HeightMap
from recognition.active.felt_log import read_and_log
from recognition.active.moves import Region
from recognition.decide.decision import Finding, ReadingFlag
from recognition.decide.evidence import EVEN, Log, SenseEvidence
from recognition.decide.reading import Reading
from recognition.find.deadline import Deadline
from recognition.find.first_pass import Feel, NothingFeltError, felt_heights_mm, virtual_feel
from recognition.see.edges_seen import has_edges
from recognition.see.levelling import filled_note, level, square_to_plate
from recognition.step_times import StepTimes
from recognition.touch import TactileReader, nothing_felt
from whisker_array.scan.session import StageSession

MIRRORED_NOTE = "read with the rows of the map in the other order (the file does not state it; set rows)"

LEAST_STEP_MM = 2e-4
"""Difference of heights below which no mark can be felt."""

OpenStage = Callable[[HeightMap, Soil | None, float, Region | None], StageSession]
"""A function that mounts a surface with its soil on a stage whose whiskers are for characters of a height, mm; its
field is the region, if given."""


@dataclass(frozen=True, eq=False)
class Surface:
    """The surface of a part, and how it is felt.

    Attributes:
        height_map: the surface, with the top of any dirt on it.
        soil: dirt into which the tip sinks, and the part's friction, if known.
        rows_known: whether the order of its rows is known. If not, a serial that reads differently mirrored goes to
            review, and an uncertain part is also read mirrored, unless the mirrored line is far less likely.
        part_id: name of the part.
        feel: function that scans the surface (default: the virtual array of the reader by the default plan).
        stage: opens a stage on which the part is felt pass by pass instead; it goes with `budget_s`.
        budget_s: most stage seconds.
        region_mm: region of the line on the map, if known; used pass by pass only.
    """

    height_map: HeightMap
    soil: Soil | None = None
    rows_known: bool = True
    part_id: str = ""
    feel: Feel | None = None
    stage: OpenStage | None = None
    budget_s: float = 0.0
    region_mm: Region | None = None

    __repr__ = one_line

    @property
    def mirrored(self) -> Surface:
        """The surface with its rows in reverse order; a region is not known there."""
        soil = None if self.soil is None else self.soil.mirrored
        return replace(self, height_map=self.height_map.mirrored, soil=soil, region_mm=None)


def evidence_of_surface(touch: TactileReader, surface: Surface) -> SenseEvidence:
    """Scan a surface, and make evidence of what is felt.

    Args:
        touch: makes evidence of scans; its time limit does not hold on a stage, whose seconds are limited.
        surface: the surface.

    Raises:
        MapError: the map cannot be scanned, or the soil is on another grid.
    """
    deadline = Deadline(None if surface.stage else touch.settings.limit_s)
    return _surest(touch.until(deadline), surface).logged(stopped=deadline.stopped)


def _surest(touch: TactileReader, surface: Surface) -> SenseEvidence:
    """Evidence of the surface; of the mirrored one, if the order of its rows is unknown and that reads more."""
    if surface.rows_known:
        return _felt(touch, surface)
    touch = touch.with_unknown_rows()
    evidence = _felt(touch, surface)
    # a simulated second measurement has the dirt on the map as given, and cannot be mirrored
    if surface.feel is not None and surface.soil is not None:
        return evidence
    looks = _Looks(touch)
    looks.add(evidence)
    upright = looks.reading
    if (
        upright.serial_is_sure
        or not touch.may_be_mirrored(evidence, upright)
        or touch.request.deadline.is_over()
    ):
        return evidence
    mirrored = _felt(touch, surface.mirrored)
    if not upright.flags & ReadingFlag.LAYOUT or touch.reading_of(mirrored).serial_is_sure:
        looks.add(mirrored.logged(notes=(*mirrored.log.notes, MIRRORED_NOTE)))
    return looks.surest


class _Looks:
    """Looks at one part, and the one of them that reads most."""

    def __init__(self, touch: TactileReader) -> None:
        self._touch = touch
        self._surest: SenseEvidence | None = None
        self._texts: frozenset[str] = frozenset()
        self.reading = Reading((), 0.0)

    def add(self, evidence: SenseEvidence) -> None:
        """Add a look."""
        reading = self._touch.reading_of(evidence)
        self._texts |= evidence.log.other_texts
        if reading.confidence > EVEN:
            self._texts |= {reading.plain_text}
        if self._surest is None or reading.nats_read > self.reading.nats_read:
            self._surest, self.reading = evidence, reading

    @property
    def surest(self) -> SenseEvidence:
        """The evidence that reads most, with the texts of the other looks."""
        assert self._surest is not None
        others = self._texts - {self.reading.plain_text}
        return self._surest.logged(other_texts=others) if others else self._surest


def _felt(touch: TactileReader, surface: Surface) -> SenseEvidence:
    if surface.stage is not None:
        actively = _felt_actively(touch, surface, surface.stage)
        if actively is not None:
            return actively
    return _felt_by_plan(touch, surface)


def _felt_by_plan(touch: TactileReader, surface: Surface) -> SenseEvidence:
    """Scan a surface by a whole plan, at one height of characters after the other until the serial is sure."""
    times, array = StepTimes(), touch.settings.array
    with times.step("mount"):
        squared, soil = square_to_plate(surface.height_map, surface.soil)
        levelled = level(squared)
        flat = not has_edges(levelled.z_mm, step=LEAST_STEP_MM)
    if flat:
        return SenseEvidence(
            "tactile", log=Log((Finding.of(ReadingFlag.NO_EDGES),), seconds=times.seconds, surface=levelled)
        )
    with times.step("first pass"):
        try:
            heights = felt_heights_mm(touch.request, levelled, array=array, soil=soil, feel=surface.feel)
        except NothingFeltError as error:
            return nothing_felt(error, Log(seconds=times.seconds, surface=levelled))
    if not heights:
        return SenseEvidence("tactile", log=Log(seconds=times.seconds, surface=levelled))
    feel = surface.feel or virtual_feel(array, soil=soil, part_id=surface.part_id)
    looks = _Looks(touch)
    for number, height_mm in enumerate(heights):
        if number and touch.request.deadline.is_over():
            break
        with times.step("scan"):
            scan = feel(levelled, height_mm)
        evidence = touch.of_scan(scan, times=times)
        notes = (*filled_note(squared, levelled), *evidence.log.notes)
        looks.add(evidence.logged(notes=notes, surface=levelled))
        if looks.reading.serial_is_sure:
            break
    return looks.surest.logged(seconds=times.seconds)


def _felt_actively(touch: TactileReader, surface: Surface, stage: OpenStage) -> SenseEvidence | None:
    """Feel a surface pass by pass until its serial is sure; a note states the stage time. None if nothing was felt.

    The whiskers are those for the known character height, or for the one that a first pass finds. If the serial is not
    sure and the budget not spent, those for the next height are tried.
    """
    squared, soil = square_to_plate(surface.height_map, surface.soil)
    levelled, spent_s, looks = level(squared), 0.0, _Looks(touch)
    try:
        heights = felt_heights_mm(touch.request, levelled, array=touch.settings.array, soil=soil)
    except NothingFeltError:
        return None
    for height_mm in heights:
        if spent_s >= surface.budget_s:
            break
        session = stage(squared, soil, height_mm, surface.region_mm)
        felt = read_and_log(touch, session, budget_s=surface.budget_s - spent_s)
        session.close()
        spent_s += felt.stage_s
        note = f"felt in {len(felt.passes)} passes, {spent_s:.1f} s of stage time: {felt.stop.message}"
        notes = (*felt.evidence.log.notes, *filled_note(squared, levelled), note)
        looks.add(felt.evidence.logged(notes=notes, surface=levelled))
        if looks.reading.serial_is_sure:
            break
    return looks.surest if spent_s else None
