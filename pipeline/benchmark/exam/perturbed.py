"""A part measured again under a perturbation."""

from __future__ import annotations

import zlib
from dataclasses import replace
from typing import TYPE_CHECKING

from pipeline.benchmark.exam.specimens import Box, Specimen
from pipeline.reading.perturbation import Perturbation, Retake

if TYPE_CHECKING:
    from whisker_array.simulation.traces import Fidelity


def perturbed(specimen: Specimen, how: Perturbation, *, fidelity: Fidelity) -> Specimen:
    """The part under a perturbation; the same every time.

    Args:
        specimen: as it is.
        how: what is changed.
        fidelity: how touch is simulated.
    """
    again = Retake(how, zlib.crc32(f"{specimen.part} {how.name}".encode()))
    grown, take = again.grown, specimen.take_photo
    take_lights = specimen.take_lights

    def larger(box: Box | None) -> Box | None:
        return None if box is None else (box[0] * grown, box[1] * grown, box[2] * grown, box[3] * grown)

    return replace(
        specimen,
        height_map=again.surface(specimen.height_map),
        take_photo=None if take is None else lambda: again.photo(take()),
        take_lights=None if take_lights is None else lambda: again.photo(take_lights()),
        line_mm=larger(specimen.line_mm),
        boxes_mm=tuple(b for b in map(larger, specimen.boxes_mm) if b is not None),
        beside_mm=larger(specimen.beside_mm),
        feel=again.feel(fidelity=fidelity, soil=specimen.soil, part_id=specimen.part),
    )
