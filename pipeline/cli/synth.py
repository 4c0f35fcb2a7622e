"""`tactile-marks synth`: stamped parts, their dirt, their photographs and their truth."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from pipeline.cli.choices import DieName, FaceName, LayoutName, PlateName, PracticeName, listed
from pipeline.cli.exit_status import failures_reported


def synth(
    out: Path,
    *,
    parts: int,
    format: str,
    font: str = "gothic",
    seed: int = 0,
    height_mm: float = 5.0,
    depth_mm: float | None = None,
    face: FaceName = "flat",
    bevel_deg: float = 45.0,
    raised: Annotated[bool, Parameter(negative="")] = False,
    variation: bool = True,
    practice: PracticeName | None = None,
    die: DieName | None = None,
    plate: PlateName | None = None,
    layout: LayoutName | None = None,
    dirt: float = 0.0,
    soil: str = "workshop",
    grime: float | None = None,
    oil: float | None = None,
    swarf: float | None = None,
    scratches: float | None = None,
    pits: float | None = None,
    paint: float | None = None,
    burr: float | None = None,
    photo: bool = True,
    pixel_mm: float = 0.06,
    light_azimuth_deg: float | None = None,
    light_elevation_deg: float | None = None,
    lights: int = 1,
    jobs: int | None = None,
    overwrite: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Stamp serials on plates: part-000.npz, part-000.png and so on, and truth.csv.

    Parameters
    ----------
    out
        Folder for them.
    parts
        Number of parts.
    format
        Mask of the serials: A letter, 9 digit, * either, any other character itself.
    font
        Built-in name or TTF/OTF file.
    seed
        Of everything random: the same seed gives the same parts.
    height_mm
        Character height in mm.
    depth_mm
        Depth of the marks in mm; the usual one for the height unless given.
    face
        Face of the die.
    bevel_deg
        Slope of the walls, degrees.
    raised
        Raised marks instead of sunk ones.
    variation
        Let blows and plates differ as in a shop.
    practice
        Who stamps: a press, a hand with single stamps, or nobody (all ideal); a press unless given.
    die
        In place of a face: also a V with a blunt edge, pile-up on one side, double strikes, one wall missing.
    plate
        What is stamped: bent (cylinder: line along its axis; ring: around it), or left rough by a tool.
    layout
        A straight line, one turned by up to 5 degrees, an arc, or another line above or below.
    dirt
        How dirty, 0 to 1.
    soil
        What the dirt is; of several, separated by commas, the first lies lowest: workshop, caked, rust, paint, weld,
        mud, wear, casting, or module:function of your own. The workshop's is a mixture of the seven kinds that follow.
    grime
        Grime caked into the grooves, 0 to 1, in place of its share of the mixture; likewise the next six.
    oil
        Oil: slippery, dark and glossy.
    swarf
        Curls, slivers and grains of metal.
    scratches
        Scratches in any direction.
    pits
        Corrosion pits and rust.
    paint
        Paint, chipped in places.
    burr
        A ragged rim along the marks.
    photo
        Take a photograph of every part.
    pixel_mm
        Size of a pixel on the part, mm.
    light_azimuth_deg
        Where the lamp stands: 0 at the right, 90 below, 270 above; drawn at random unless given.
    lights
        Photographs of each part, PART.light-1.png and so on, the lamp on another side each time.
    light_elevation_deg
        How high it stands over the plate; drawn from 25 to 65 unless given.
    jobs
        Worker processes; one for each core unless given, or none for a few parts.
    overwrite
        Write into a folder that is not empty.
    """
    with failures_reported():
        from dataclasses import replace
        from functools import partial

        from glyphs.soiling.soiled import Soiling
        from glyphs.soiling.workshop.mixture import Dirt
        from glyphs.stamping.faces import Face
        from pipeline.formats.synth import SynthSpec, write_parts
        from pipeline.workers.executors import ordered_map
        from pipeline.workers.options import ExecutorOptions

        kinds = {
            "grime": grime,
            "oil": oil,
            "swarf": swarf,
            "scratches": scratches,
            "pits": pits,
            "paint": paint,
            "burr": burr,
        }
        own = {kind: amount for kind, amount in kinds.items() if amount is not None}
        soiling = Soiling(listed(soil), dirt, mixture=replace(Dirt.of(dirt), **own) if own else None)
        spec = SynthSpec(
            format=format,
            font=font,
            seed=seed,
            height_mm=height_mm,
            depth_mm=depth_mm,
            face=Face(face),
            bevel_deg=bevel_deg,
            raised=raised,
            variation=variation,
            practice=practice,
            die=die,
            plate=plate,
            layout=layout,
            soiling=soiling,
            light_azimuth_deg=light_azimuth_deg,
            light_elevation_deg=light_elevation_deg,
            lights=lights,
            pixel_mm=pixel_mm,
        )
        with ExecutorOptions(jobs=jobs).opened(parts) as executor:
            each = partial(ordered_map, executor)
            made = write_parts(spec, out, parts=parts, photos=photo, overwrite=overwrite, each=each)
    print(f"wrote {len(made)} parts and truth.csv to {out}")
    return 0
