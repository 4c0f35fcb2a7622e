"""Evidence by touch of a surface: the virtual array scans it at the scale of its characters.

surface --first pass--> heights of characters --one after the other, until sure--> Scan --TactileReader--> evidence
order of its rows unknown, and not sure --> the mirrored surface likewise; the one that reads more counts
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from glyphs.soiling.soil import Soil
from glyphs.surface.display import OneLine
from glyphs.surface.maps import HeightMap
from recognition.active.felt_log import read_and_log
from recognition.active.moves import Region
from recognition.decide.decision import Finding, ReadingFlag
from recognition.decide.evidence import EVEN, Log, SenseEvidence
from recognition.decide.reading import Reading
from recognition.find.deadline import Deadline
from recognition.find.first_pass import LEAST_HEIGHT_MM, Feel, NothingFeltError, felt_heights_mm, virtual_feel
from recognition.see.edges_seen import has_edges
from recognition.see.levelling import filled_note, level, square_to_plate
from recognition.step_times import StepTimes
from recognition.touch import TactileReader, nothing_felt
from whisker_array.scan.session import StageSession

MIRRORED_NOTE = "read with the rows of the map in the other order (the file does not state it; set rows)"

LEAST_STEP_MM = 2e-4
"""Difference of heights below which no mark can be felt."""

OpenStage = Callable[[HeightMap, Soil | None, float, Region | None], StageSession]
"""Mounts a surface with its soil for characters of a height, mm, on a stage whose field is the region, if given."""


@dataclass(frozen=True, eq=False, repr=False)
class Surface(OneLine):
    """The surface of a part, and how it is felt."""

    height_map: HeightMap
    soil: Soil | None = None
    # whether the order of its rows is known. If not, a serial that reads differently mirrored goes to review,
    # and an uncertain part is also read mirrored, unless the mirrored line is far less likely.
    rows_known: bool = True
    part_id: str = ""
    # function that scans the surface (default: the virtual array of the reader by the default plan)
    feel: Feel | None = None
    # opens a stage on which the part is felt pass by pass instead; it goes with `budget_s`
    stage: OpenStage | None = None
    budget_s: float = 0.0
    region_mm: Region | None = None

    @property
    def mirrored(self) -> Surface:
        """The surface with its rows in reverse order; a region is not known there."""
        soil = None if self.soil is None else self.soil.mirrored
        return replace(self, height_map=self.height_map.mirrored, soil=soil, region_mm=None)


def evidence_of_surface(touch: TactileReader, surface: Surface) -> SenseEvidence:
    """Scan a surface, and make evidence of what is felt; a stage has no time limit but `budget_s`. Raises MapError."""
    deadline = Deadline(None if surface.stage else touch.settings.limit_s)
    evidence = _feel_in_either_order(touch.requesting(deadline=deadline), surface)
    return evidence.logged(stopped=deadline.stopped)


def _feel_in_either_order(touch: TactileReader, surface: Surface) -> SenseEvidence:
    if surface.rows_known:
        return _feel(touch, surface)
    touch = touch.requesting(rows_known=False)  # lines are read mirrored as well
    evidence = _feel(touch, surface)
    # a simulated second measurement has the dirt on the map as given, and cannot be mirrored
    if surface.feel is not None and surface.soil is not None:
        return evidence
    upright = touch.reading_of(evidence)
    if upright.serial_is_sure or not touch.may_be_mirrored(evidence, upright):
        return evidence
    if touch.request.deadline.is_over():
        return evidence
    mirrored = _feel(touch, surface.mirrored)
    mirrored = mirrored.logged(notes=(*mirrored.log.notes, MIRRORED_NOTE))
    reading = touch.reading_of(mirrored)
    if upright.flags & ReadingFlag.LAYOUT and not reading.serial_is_sure:
        return evidence
    return _surest([(evidence, upright), (mirrored, reading)])


def _feel(touch: TactileReader, surface: Surface) -> SenseEvidence:
    times, array = StepTimes(), touch.settings.array
    with times.step("mount"):
        squared, soil = square_to_plate(surface.height_map, surface.soil)
        levelled = level(squared)
        notes = filled_note(squared, levelled)
        # a map in a wrong unit is not called flat
        flat = max(levelled.size_mm) >= LEAST_HEIGHT_MM and not has_edges(levelled.z_mm, step=LEAST_STEP_MM)
    if flat:
        log = Log((Finding.of(ReadingFlag.NO_EDGES),), seconds=times.seconds, surface=levelled)
        return SenseEvidence("tactile", log=log)
    feel = surface.feel or virtual_feel(array, soil=soil, part_id=surface.part_id)
    with times.step("first pass"):
        try:
            heights = felt_heights_mm(touch.request, levelled, array=array, soil=soil, feel=surface.feel)
        except NothingFeltError as error:
            return nothing_felt(error, Log(seconds=times.seconds, surface=levelled))
    looks, spent_s = list[tuple[SenseEvidence, Reading]](), 0.0
    for height_mm in heights:
        if looks and touch.request.deadline.is_over():
            break
        if surface.stage is None:
            with times.step("scan"):
                scan = feel(levelled, height_mm)
            evidence = touch.of_scan(scan, times=times)
        elif spent_s < surface.budget_s:
            session = surface.stage(squared, soil, height_mm, surface.region_mm)
            felt = read_and_log(touch, session, budget_s=surface.budget_s - spent_s)
            session.close()
            spent_s += felt.stage_s
            note = f"felt in {len(felt.passes)} passes, {spent_s:.1f} s of stage time: {felt.stop.message}"
            evidence = felt.evidence.logged(notes=(*felt.evidence.log.notes, note))
        else:
            break
        evidence = evidence.logged(notes=(*notes, *evidence.log.notes), surface=levelled)
        reading = touch.reading_of(evidence)
        looks.append((evidence, reading))
        if reading.serial_is_sure:
            break
    if not looks:
        return SenseEvidence("tactile", log=Log(seconds=times.seconds, surface=levelled))
    surest = _surest(looks)
    return surest.logged(seconds={**surest.log.seconds, **times.seconds})


def _surest(looks: Sequence[tuple[SenseEvidence, Reading]]) -> SenseEvidence:
    surest, reading = max(looks, key=lambda look: look[1].nats_read)
    texts = {look.plain_text for _, look in looks if look.confidence > EVEN}
    others = texts.union(*(evidence.log.other_texts for evidence, _ in looks)) - {reading.plain_text}
    return surest.logged(other_texts=others) if others else surest
