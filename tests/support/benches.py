"""Recordings over test pieces by benches whose numbers are known."""

from __future__ import annotations

from dataclasses import replace

from glyphs.surface.pieces import Piece
from pipeline.reading.simulated_scan import feel
from whisker_array.scan.scan import Scan
from whisker_array.whisker.array import RasterPlan, default_comb
from whisker_array.whisker.touch import Touch, default_touch

HEIGHT_MM = 5.0
FINE_MM = 0.01


def recorded(
    piece: Piece,
    *,
    touch: Touch | None = None,
    friction: float = 0.2,
    seed: int = 0,
    whiskers: int = 2,
    memory: bool = False,
) -> Scan:
    """A scan of a piece by a few default whiskers, which says that they are as drawn whatever they are.

    Args:
        piece: under the whiskers, its corner at the plate's.
        touch: how they truly meet it.
        friction: true.
        seed: of the noise; gains and offsets are the same for all.
        whiskers: of the comb.
        memory: whether its gauges creep and lag, and its stage has play.
    """
    drawn = default_touch(HEIGHT_MM)
    comb = default_comb(HEIGHT_MM, n_whiskers=whiskers)
    plan = RasterPlan(
        comb, (0.0, 0.0, *piece.size_mm), comb.pitch_mm / 4, 0.03125, speed_mm_s=50.0, lead_mm=1.5
    )
    scan = feel(
        piece.height_map(FINE_MM),
        plan=plan,
        height_mm=HEIGHT_MM,
        touch=touch or drawn,
        friction=friction,
        sensor_seed=1,
        noise_seed=seed,
        memory=memory,
    )
    return replace(scan, touch=drawn)


def worn(radius_mm: float = 0.1, preload_mm: float = 1.0) -> Touch:
    """The default touch with another tip or height."""
    return replace(default_touch(HEIGHT_MM), tip_radius_mm=radius_mm, preload_mm=preload_mm)
