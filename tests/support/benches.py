"""Recordings over test pieces by benches whose numbers are known; stress of a whisker as an oracle."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from glyphs.surface.maps import HeightMap
from glyphs.surface.pieces import Piece, PieceKind
from recognition.see.virtual_array import VirtualArray
from recognition.see.virtual_bench import VirtualBench
from whisker_array.identification.bench import BENCH_GAIN, Bench, Unknown, nominal_bench, prior_sd
from whisker_array.identification.knowledge import Knowledge
from whisker_array.identification.piece_map import Heights
from whisker_array.scan.calibration import Calibration
from whisker_array.scan.scan import Scan, trace_scan
from whisker_array.scan.sensor import draw_sensor_chain
from whisker_array.scan.stage_play import draw_stage_play
from whisker_array.whisker.array import RasterPlan, default_comb
from whisker_array.whisker.defaults import default_whisker
from whisker_array.whisker.sections import Taper
from whisker_array.whisker.shapes import LShaped, Whisker
from whisker_array.whisker.touch import Touch, default_touch
from whisker_array.whisker.validity import land_force_n

# ----------------------------------------------------------------------------------------------------------- benches

HEIGHT_MM = 5.0
FINE_MM, IRON_MM = 0.01, 0.005
_BESIDE_MM = 3.0
_FINER = 4
_MOST_SDS = 2.5
_SLIPPERY = 0.02
"""The least friction: one drawn by chance may be less than none."""


def recorded(piece: Piece, *, touch: Touch | None = None, friction: float = 0.2, whiskers: int = 2) -> Scan:
    """A scan of a piece by a few default whiskers, which says that they are as drawn whatever they are.

    Args:
        piece: under the whiskers, its corner at the plate's.
        touch: how they truly meet it.
        friction: true.
        whiskers: of the comb.
    """
    drawn = default_touch(HEIGHT_MM)
    comb = default_comb(HEIGHT_MM, n_whiskers=whiskers)
    plan = RasterPlan(
        comb, (0.0, 0.0, *piece.size_mm), comb.pitch_mm / 4, 0.03125, speed_mm_s=50.0, lead_mm=1.5
    )
    heights = piece.height_map(FINE_MM)
    array = VirtualArray(touch or drawn, seed=1, noise_seed=0)
    scan = VirtualBench(heights, HEIGHT_MM, array, friction=friction).scan(plan)
    return replace(scan, touch=drawn)


def worn(radius_mm: float = 0.1, preload_mm: float = 1.0) -> Touch:
    """The default touch with another tip or height."""
    return replace(default_touch(HEIGHT_MM), tip_radius_mm=radius_mm, preload_mm=preload_mm)


def known_whisker() -> tuple[LShaped, Touch, Knowledge]:
    """The default whisker, known as an identification leaves one."""
    sd = {
        Unknown.L1: 0.1, Unknown.L2: 0.1, Unknown.L3: 0.08, Unknown.BETA: 0.4, Unknown.STIFFNESS: 0.016,
        Unknown.RADIUS: 0.006, Unknown.PRELOAD: 0.001, Unknown.FRICTION: 0.002,
    }  # fmt: skip
    covariance = np.diag(np.array(list(sd.values())) ** 2)
    # a longer tip arm is made up for by a smaller setting angle
    covariance[1, 3] = covariance[3, 1] = -0.8 * sd[Unknown.L2] * sd[Unknown.BETA]
    return default_whisker(HEIGHT_MM), default_touch(HEIGHT_MM), Knowledge(tuple(sd), covariance)


@dataclass(frozen=True, eq=False)
class HiddenBench:
    """A bench drawn by chance, and what it recorded.

    Attributes:
        scan: which says that all is as drawn.
        heights: of the piece.
        drawn: the whisker.
        truth: what is to be found.
        stage_s: how long the recording took.
    """

    scan: Scan
    heights: Heights
    drawn: LShaped
    truth: Bench
    stage_s: float


def hidden_bench(seed: int, *, gains_shown: bool = False, whiskers: int = 3) -> HiddenBench:
    """A bench whose every number is drawn as a workshop knows it before, and its recording of pits.

    The tip slides through places `_FINER` times as close as the samples, as on iron.

    Args:
        seed: of all numbers, and of the noise.
        gains_shown: whether a weight on each tip has shown the gains, as well as it does.
        whiskers: of the comb.
    """
    rng = np.random.default_rng(seed)
    piece = Piece(PieceKind.PITS)
    drawn, touch = default_whisker(HEIGHT_MM), default_touch(HEIGHT_MM)
    comb = default_comb(HEIGHT_MM, n_whiskers=whiskers)
    nominal = nominal_bench(drawn, touch, n_whiskers=whiskers)
    before = prior_sd(nominal)
    off = np.clip(rng.standard_normal(before.size), -_MOST_SDS, _MOST_SDS)
    stage = draw_stage_play(rng=rng)
    play_mm = abs(float(off[list(Unknown).index(Unknown.PLAY)])) * before[list(Unknown).index(Unknown.PLAY)]
    stage = replace(stage, play_mm=play_mm)
    truth = Bench.of_vector(nominal.vector() + before * off)
    truth = truth.with_values(play_mm=play_mm, friction=max(truth[Unknown.FRICTION], _SLIPPERY))
    step_mm = 0.03125
    size = [round(value / step_mm) * step_mm for value in piece.size_mm]
    region = (_BESIDE_MM, _BESIDE_MM, _BESIDE_MM + size[0], _BESIDE_MM + size[1])
    plan = RasterPlan(comb, region, comb.pitch_mm / 28, step_mm, speed_mm_s=50.0, lead_mm=1.5, two_way=True)
    chain = draw_sensor_chain(whiskers, rng=rng, full_scale_n_mm=3.0 * abs(touch.land_moment_n_mm()))
    fine = trace_scan(
        _lain(piece, truth),
        # the stage is set up by what the friction is taken for
        touch=replace(truth.touch(drawn), friction=touch.friction),
        friction=truth[Unknown.FRICTION],
        plan=replace(plan, sample_pitch_mm=step_mm / _FINER, air_samples=plan.air_samples * _FINER),
        sensor=replace(chain, gain=truth.gain),
        stage=stage,
        rng=rng,
    )
    sweeps = tuple(
        replace(
            sweep,
            plan=asked,
            moment_n_mm=sweep.moment_n_mm[..., ::_FINER],
            flags=sweep.flags[..., ::_FINER],
            air_n_mm=sweep.air_n_mm[..., ::_FINER],
        )
        for asked, sweep in zip(plan.sweeps(), fine.sweeps, strict=True)
    )
    shown = truth.gain * (1.0 + BENCH_GAIN * rng.standard_normal(whiskers))
    scan = replace(
        fine,
        sweeps=sweeps,
        touch=touch,
        sample_rate_hz=plan.sample_rate_hz,
        calibration=Calibration(shown, np.zeros(whiskers)) if gains_shown else None,
    )
    if gains_shown:
        truth = replace(truth, gain=truth.gain / shown)  # what is left of them
    return HiddenBench(
        scan, lambda x, y: piece.height_mm(x - _BESIDE_MM, y - _BESIDE_MM), drawn, truth, plan.scan_time_s
    )


def _lain(piece: Piece, bench: Bench) -> HeightMap:
    """The piece as it lies on the plate, land all around."""
    width, height = (int((size + 2.0 * _BESIDE_MM) / IRON_MM) + 1 for size in piece.size_mm)
    x, y = np.arange(width)[None, :] * IRON_MM, np.arange(height)[:, None] * IRON_MM
    off_x, off_y = x - bench[Unknown.SHIFT_X], y - bench[Unknown.SHIFT_Y]
    yaw = math.radians(bench[Unknown.YAW])
    of_x = math.cos(yaw) * off_x + math.sin(yaw) * off_y
    of_y = math.cos(yaw) * off_y - math.sin(yaw) * off_x
    tilt = 1e-3 * (bench[Unknown.TILT_X] * x + bench[Unknown.TILT_Y] * y)
    return HeightMap(
        (piece.height_mm(of_x - _BESIDE_MM, of_y - _BESIDE_MM) + tilt).astype(np.float32), IRON_MM
    )


# ------------------------------------------------------------------------------------------------------------ stress


def preload_stress_mpa(whisker: Whisker, *, preload_mm: float, mu: float) -> float:
    """Peak bending stress M c / I on the land at this preload, MPa.

    Vertical and lateral bending are added (exact at the corners of a rectangle, on the safe side for round
    wire; a planar whisker has no lateral part). Looked at are both ends of every segment and 33 places of a
    taper.
    """
    force = land_force_n(whisker, preload_mm=preload_mm, mu=mu)
    segments = whisker.segments()
    tip = segments[-1].end_mm
    peak = 0.0
    for segment in segments:
        places = np.linspace(0.0, 1.0, 33 if isinstance(segment.section, Taper) else 2)
        _, lateral, vertical = segment.axes
        for t in places:
            section = segment.section_at(float(t))
            point = segment.start_mm + t * (segment.end_mm - segment.start_mm)
            moment = np.cross(tip - point, force)
            up_down = abs(float(moment @ lateral)) * section.c_vertical_mm / section.i_vertical_mm4
            sideways = abs(float(moment @ vertical)) * section.c_lateral_mm / section.i_lateral_mm4
            peak = max(peak, up_down + sideways)
    return peak
