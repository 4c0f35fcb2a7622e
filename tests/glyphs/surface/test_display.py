"""Every value shows itself on one short line."""

from __future__ import annotations

import base64
import dataclasses
import io
import re
from collections.abc import Mapping

import numpy as np
import pytest
from PIL import Image

from glyphs import HeightMap
from glyphs.surface.display import LONGEST, one_line


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
    assert found is not None
    image = np.asarray(Image.open(io.BytesIO(base64.b64decode(found[1]))))
    assert image.shape == (150, 500)
    assert (image[:, 0].max(), image[:, -1].min()) == (0, 255)
    assert "<code>HeightMap(z_mm=[900 x 3000, 0..1], pitch_mm=0.1)</code>" in shown
