"""Height maps: what they keep and refuse, their blur, and how every value shows itself."""

from __future__ import annotations

import base64
import dataclasses
import io
import re
from collections.abc import Mapping

import numpy as np
import pytest
from PIL import Image

from glyphs.surface.blur import gaussian_blur, sample_bilinear
from glyphs.surface.display import LONGEST, one_line
from glyphs.surface.maps import EdgeMap, HeightMap, MapError, TraceDirection

# -------------------------------------------------------------------------------------------------------------- maps

PLANE = np.zeros((3, 4), np.float32)


def test_height_map_keeps_what_it_was_given_read_only():
    source = np.arange(12.0).reshape(3, 4)
    heights = HeightMap(source, 0.5)
    source[0, 0] = 99.0
    assert heights.z_mm[0, 0] == 0.0
    assert heights.z_mm.dtype == np.float32
    assert heights.shape == (3, 4)
    assert heights.size_mm == (1.5, 1.0)
    with pytest.raises(ValueError, match="read-only"):
        heights.z_mm[0, 0] = 1.0


def test_height_map_leaves_a_float32_source_writeable():
    source = PLANE.copy()
    heights = HeightMap(source, 0.1)
    source[0, 0] = 5.0
    assert heights.z_mm[0, 0] == 0.0


@pytest.mark.parametrize(
    ("z", "pitch_mm", "message"),
    [
        (np.zeros(5), 0.1, "rows and columns"),
        (np.zeros((1, 5)), 0.1, "rows and columns"),
        (np.full((3, 3), np.nan), 0.1, "no finite height"),
        (np.full((3, 3), np.inf), 0.1, "infinit"),
        (np.zeros((3, 3), complex), 0.1, "real numbers"),
        (np.array([["a", "b"], ["c", "d"]]), 0.1, "real numbers"),
        (PLANE, 0.0, "pitch_mm"),
        (PLANE, -1.0, "pitch_mm"),
        (PLANE, float("nan"), "pitch_mm"),
        (np.broadcast_to(np.float32(0), (9000, 9000)), 0.1, "limit"),
    ],
)
def test_height_map_refuses(z, pitch_mm, message):
    with pytest.raises(MapError, match=message):
        HeightMap(z, pitch_mm)


def edge_map(**change):
    values = {
        "enhancement": np.zeros((2, 3, 4), np.float32),
        "directions": (TraceDirection.FORWARD_X, TraceDirection.FORWARD_Y),
        "valid": np.ones((3, 4), bool),
        "pitch_mm": 0.1,
    }
    return EdgeMap(**{**values, **change})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"directions": (0,)}, "do not agree"),
        ({"directions": (0, 0)}, "at most once"),
        ({"valid": np.ones((4, 3), bool)}, "do not agree"),
        ({"enhancement": np.full((2, 3, 4), np.nan)}, "finite"),
        ({"pitch_mm": 0.0}, "pitch_mm"),
    ],
)
def test_edge_map_refuses(change, message):
    with pytest.raises(MapError, match=message):
        edge_map(**change)


@pytest.mark.parametrize("shape", [(60, 90), (3, 5), (2, 40), (1, 1)])
@pytest.mark.parametrize("sigma", [0.0, 0.1, 0.7, 3.0, 12.0])
@pytest.mark.parametrize("truncate", [3.0, 4.0])
def test_blurred_is_scipys_filter(shape: tuple[int, int], sigma: float, truncate: float) -> None:
    from scipy.ndimage import gaussian_filter

    z = np.random.default_rng(1).standard_normal(shape, dtype=np.float32)
    expected = gaussian_filter(z, sigma, mode="nearest", truncate=truncate)
    np.testing.assert_array_equal(gaussian_blur(z, sigma, truncate=truncate), expected)
    wide = np.repeat(z[:, :, None], 2, axis=2)[:, :, 1]  # not contiguous
    np.testing.assert_array_equal(gaussian_blur(wide, sigma, truncate=truncate), expected)


def test_sampled_is_scipys_interpolation_inside_and_beyond() -> None:
    from scipy.ndimage import map_coordinates

    rng = np.random.default_rng(2)
    z = rng.standard_normal((40, 70), dtype=np.float32)
    row, col = rng.uniform(-5.0, 45.0, (30, 50)), rng.uniform(-5.0, 75.0, (30, 50))
    row[0], col[1], row[2], col[3] = 7.0, 11.0, 39.0, 69.0  # on samples and on the last ones
    expected = map_coordinates(
        z, np.stack([row, col]), output=np.float32, order=1, mode="mirror", prefilter=False
    )
    np.testing.assert_array_equal(sample_bilinear(z, row, col), expected)


# ----------------------------------------------------------------------------------------------------------- display


@dataclasses.dataclass(frozen=True)
class Sample:
    array: object = None
    text: str = ""
    many: tuple[float, ...] = ()
    named: Mapping[str, int] = dataclasses.field(default_factory=dict)
    number: float = 0.0

    __repr__ = one_line


@pytest.mark.parametrize(
    ("sample", "line"),
    [
        (Sample(), "Sample()"),
        (Sample(np.array([[1.0, np.nan], [3.0, -2.0]])), "Sample(array=[2 x 2, -2..3])"),
        (Sample(np.array([0.5, 2.0])), "Sample(array=[0.5, 2])"),
        (Sample(np.full((3, 3), np.nan)), "Sample(array=[3 x 3 float64])"),
        (Sample(np.ones((2, 2), dtype=bool)), "Sample(array=[2 x 2 bool])"),
        (Sample(text="a\nb"), r"Sample(text='a\nb')"),
        (Sample(many=(1.0,), number=1 / 3), "Sample(many=(1,), number=0.3333)"),
        (Sample(many=tuple(range(9))), "Sample(many=(9 x int))"),
        (Sample(named={"a": 1}), "Sample(named={1 entries})"),
        (Sample(Sample(text="x" * 50)), "Sample(array=Sample(...))"),
    ],
)  # fmt: skip
def test_a_line_names_what_differs_from_the_defaults(sample: Sample, line: str) -> None:
    assert repr(sample) == line


def test_a_long_line_ends_in_dots() -> None:
    kind = dataclasses.make_dataclass("Wide", [(f"field_{k}", str) for k in range(20)])
    kind.__repr__ = one_line
    line = repr(kind(*("some words" for _ in range(20))))
    assert line.endswith(", ...)")
    assert len(line) < LONGEST + 20
    assert len(repr(Sample(text="x" * 500))) < 60


def test_a_notebook_gets_a_small_picture() -> None:
    z = np.zeros((900, 3000), dtype=np.float32)
    z[:, 1500:] = 1.0
    z[0, 0] = np.nan
    shown = HeightMap(z, 0.1)._repr_html_()
    found = re.search(r"base64,([^']+)'", shown)
    image = np.asarray(Image.open(io.BytesIO(base64.b64decode(found[1]))))
    assert image.shape == (150, 500)
    assert (image[:, 0].max(), image[:, -1].min()) == (0, 255)
    assert "<code>HeightMap(z_mm=[900 x 3000, 0..1], pitch_mm=0.1)</code>" in shown
