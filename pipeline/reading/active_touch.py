"""Read a height map on the simulated stage pass by pass, until its serial is sure."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from pipeline.reading.framed_session import FramedSession
from recognition.active.replay import read_kept
from recognition.decision.score import serial_is_sure
from recognition.find.first_pass import felt_heights_mm
from recognition.views.levelling import filled_note, level, square_to_plate
from whisker_array.simulation.traces import Fidelity

if TYPE_CHECKING:
    from glyphs.soiling.soil import Soil
    from glyphs.surface.maps import HeightMap
    from recognition.active.moves import Region
    from recognition.decision.reading import Reading
    from recognition.senses.touch import TactileReader
    from whisker_array.scan.session import StageSession


def read_actively(
    reader: TactileReader,
    surface: HeightMap,
    *,
    budget_s: float,
    soil: Soil | None = None,
    part_id: str = "",
    region_mm: Region | None = None,
) -> Reading:
    """Read a height map by passes that are chosen one after the other; a note states their stage time.

    The whiskers are those for the known character height, or for the one that a first pass finds. If the serial is not
    sure and the budget not spent, those for the next height are tried.

    Args:
        reader: reader by touch.
        surface: the part.
        budget_s: most stage seconds.
        soil: dirt on it, if known.
        part_id: name of the part.
        region_mm: region of the line, if known; nothing else is scanned.

    Raises:
        MapError: the map cannot be scanned, or the soil is on another grid.
    """
    from pipeline.reading.simulated_scan import VirtualBench

    surface, soil = square_to_plate(surface, soil)
    levelled, found, spent_s = level(surface), None, 0.0
    fidelity = Fidelity(reader.settings.fidelity)
    heights = felt_heights_mm(reader.request, levelled, fidelity=fidelity, soil=soil)
    for height_mm in heights:
        if spent_s >= budget_s:
            break
        bench = VirtualBench(surface, height_mm, fidelity, noise=False, part_id=part_id, soil=soil)
        session: StageSession = bench.open_session()
        if region_mm is not None:
            # the field limits the passes, and the recording stores it
            session = FramedSession(session, x_mm=0.0, y_mm=0.0, field_mm=region_mm)
        tried = read_kept(reader, session, budget_s=budget_s - spent_s)
        session.close()
        spent_s += tried.stage_s
        if found is None or tried.reading.nats_read > found.reading.nats_read:
            found = tried
        if serial_is_sure(found.reading):
            break
    if found is None:
        return reader.read_height_map(surface, soil=soil, part_id=part_id)
    note = f"felt in {len(found.passes)} passes, {spent_s:.1f} s of stage time: {found.stop.message}"
    notes = (*found.reading.notes, *filled_note(surface, levelled), note)
    return replace(found.reading, notes=notes).with_trace(height_map=levelled)
