"""An emulated bench for tests: a small plate, and the settings that drive it."""

from __future__ import annotations

from typing import Any

from glyphs.surface.maps import HeightMap, TraceDirection
from pipeline.bench.settings import BenchSettings
from pipeline.formats.synth import SynthSpec, make_part
from whisker_array.whisker.passes import Pass

HEIGHT_MM, PITCH_MM, WHISKERS = 3.0, 3.0, 3
FIRMWARE = ("grbl", "marlin")


def bench_settings(firmware: str = "grbl", **stage: Any) -> BenchSettings:
    """A bench for three whiskers; its comb's tips stand beside the turning axis."""
    return BenchSettings.model_validate(
        {
            "stage": {
                "firmware": firmware,
                "port": "none",
                "origin_mm": (30.0, 90.0),
                "land_z_mm": -30.0,
                "travel_mm": ((0.0, 120.0), (0.0, 120.0), (-40.0, 0.0)),
                "turn_axis": "A",
                "tip_mm": (2.0, 0.5),
                "answer_s": 3.0,
                **stage,
            },
            "comb": {"n_whiskers": WHISKERS, "pitch_mm": PITCH_MM, "character_height_mm": HEIGHT_MM},
            "plate": {"field_mm": (0.0, 0.0, 14.0, 10.0)},
            "daq": {"kind": "line", "port": "none", "rate_hz": 3000.0, "range_v": 5.0},
        }
    )


def stamped() -> HeightMap:
    """A plate with two characters."""
    return make_part(SynthSpec("A9", seed=4, height_mm=HEIGHT_MM), 0).height_map


def a_pass(direction: int = 0, *, length_mm: float = 6.0, at_mm: tuple[float, float] = (6.0, 5.0)) -> Pass:
    """A pass about a place of the plate."""
    way = TraceDirection(direction)
    along, across = at_mm if way.along_x else at_mm[::-1]
    return Pass(
        way,
        tuple(across + PITCH_MM * (i - 0.5 * (WHISKERS - 1)) for i in range(WHISKERS)),
        (along - 0.5 * length_mm, along + 0.5 * length_mm),
        sample_pitch_mm=HEIGHT_MM / 80.0,
        speed_mm_s=40.0,
    )
