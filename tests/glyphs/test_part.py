"""A part in one call."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from glyphs import Camera, Light, Soiling, StampingVariation, soil_part, stamp
from glyphs.stamping.errors import StampError


def test_the_same_seed_gives_the_same_part_clean_and_dirty() -> None:
    clean, dirty = (stamp("K7", height_mm=3.0, seed=4, dirt=dirt) for dirt in (0.0, 0.7))
    assert (clean.text, clean.height_mm, clean.soil) == ("K7", 3.0, None)
    np.testing.assert_array_equal(clean.height_map.z_mm, dirty.stamped.height_map.z_mm)
    assert dirty.soil.shape == dirty.height_map.shape
    expected = soil_part(clean.stamped, Soiling(severity=0.7), rng=np.random.default_rng([4, 1]))
    np.testing.assert_array_equal(dirty.height_map.z_mm, expected.height_map.z_mm)
    np.testing.assert_array_equal(dirty.photograph().pixels, dirty.photograph().pixels)
    other = stamp("K7", height_mm=3.0, seed=5)
    assert (
        other.height_map.shape != clean.height_map.shape
        or (other.height_map.z_mm != clean.height_map.z_mm).any()
    )


def test_a_serial_is_drawn_from_its_format() -> None:
    part = stamp(format="A9", height_mm=3.0, seed=(7, 1))
    assert part.text[0].isalpha()
    assert part.text[1].isdigit()
    assert stamp(format="A9", height_mm=3.0, seed=[7, 1]).text == part.text


def test_light_and_camera_may_be_given() -> None:
    part = stamp("1", height_mm=3.0, variation=StampingVariation.none())
    free = part.photograph()
    assert free.pitch_mm == 0.06
    assert part.photograph(pixel_mm=0.1).pitch_mm == 0.1
    assert (part.photograph(light_azimuth_deg=10.0).pixels != free.pixels).any()
    still = Camera(noise=0.0, dark_noise=0.0, bloom=0.0, vignetting=0.0)
    one, other = (part.photograph(light=Light(azimuth_deg=a), camera=still) for a in (0.0, 180.0))
    assert one.shape == other.shape
    assert (one.pixels != other.pixels).any()


@pytest.mark.parametrize(
    ("error", "message", "wrong"),
    [
        (StampError, "give the text to stamp, or the format", {"text": None}),
        (StampError, "give the text to stamp, or the format", {"text": "A", "format": "A"}),
        (StampError, "severity is 2", {"dirt": 2}),
        (StampError, "seed is -1", {"seed": -1}),
        (
            StampError,
            "2 fonts are given; give one: a line is stamped in one font",
            {"fonts": ["gothic", "timesr"]},
        ),
    ],
)
def test_what_cannot_be_stamped(error: type[Exception], message: str, wrong: dict[str, object]) -> None:
    with pytest.raises(error, match=message):
        stamp(**{"text": "A", "height_mm": 3.0, **wrong})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("modules", "heavy"),
    [
        (("glyphs", "whisker_array", "recognition"), {"numpy", "scipy", "numba", "cv2", "matplotlib"}),
        (
            ("glyphs.part", "pipeline.formats.glyph_database"),
            {"numba", "h5py", "fontTools", "HersheyFonts", "matplotlib", "scipy"},
        ),
    ],
)
def test_importing_is_cheap(modules: tuple[str, ...], heavy: set[str]) -> None:
    code = f"import sys, {', '.join(modules)}; print({heavy} & set(sys.modules))"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert out.stdout == "set()\n"
