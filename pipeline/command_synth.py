"""`tactile-marks synth`: stamped parts and their truth."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from pipeline.failing import failures_told

FaceName = Literal["sharp", "flat", "round", "dotted"]


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
    overwrite: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Stamp serials on plates: part-000.npz and so on, and truth.csv.

    Parameters
    ----------
    out
        Folder for them.
    parts
        How many.
    format
        Mask of the serials: A letter, 9 digit, * either, any other character itself.
    font
        Built-in name or TTF/OTF file.
    seed
        Of everything random: the same seed gives the same parts.
    height_mm
        Character height.
    depth_mm
        Depth of the marks; usual for the height unless given.
    face
        Face of the die.
    bevel_deg
        Slope of the walls.
    raised
        Raised marks instead of sunk ones.
    variation
        Let blows and plates differ as in a shop.
    overwrite
        Write into a folder that is not empty.
    """
    with failures_told():
        from glyphs.die import Face
        from pipeline.synth import SynthSpec, write_parts

        spec = SynthSpec(
            mask=format,
            font=font,
            seed=seed,
            height_mm=height_mm,
            depth_mm=depth_mm,
            face=Face(face),
            bevel_deg=bevel_deg,
            raised=raised,
            variation=variation,
        )
        made = write_parts(spec, out, parts=parts, overwrite=overwrite)
    print(f"wrote {len(made)} parts and truth.csv to {out}")
    return 0
