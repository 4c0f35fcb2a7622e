"""Every value shows itself on one short line."""

from __future__ import annotations

import base64
import dataclasses
import importlib
import inspect
import io
import pkgutil
import re
from collections.abc import Iterator, Mapping
from types import ModuleType

import numpy as np
import pytest
from PIL import Image

import glyphs
import whisker_array
from glyphs import HeightMap
from glyphs.surface.display import LONGEST, one_line

LONGEST_LINE = 200


def values_within(value: object) -> Iterator[object]:
    """The dataclass itself and every one that it holds."""
    if dataclasses.is_dataclass(value):
        yield value
        for item in dataclasses.fields(value):
            yield from values_within(getattr(value, item.name))
    elif isinstance(value, Mapping):
        yield from values_within(tuple(value.values()))
    elif isinstance(value, (tuple, list)):
        for each in value:
            yield from values_within(each)


@pytest.fixture(scope="module")
def met() -> list[object]:
    """What comes up on the way from a serial to its relief."""
    part = glyphs.stamp("K7", height_mm=3.0, seed=1, dirt=0.6)
    font = glyphs.load_font("gothic")
    rng = np.random.default_rng(1)
    touch = whisker_array.default_touch(3.0)
    plan = whisker_array.default_plan((0.0, 0.0, *part.height_map.size_mm), character_height_mm=3.0)
    scan = whisker_array.trace_scan(
        part.height_map, touch=touch, plan=plan, fidelity=whisker_array.Fidelity.POINTWISE
    )
    edges = whisker_array.edge_map(scan)
    exemplar = glyphs.Exemplar("K", "gothic", part.height_map.z_mm, "", "2026-01-01T00:00:00+00:00")
    known = glyphs.GlyphDatabase({font.name: font}, {"usual": glyphs.default_die(3.0)}, (exemplar,))
    whisker = whisker_array.default_whisker(3.0)
    roots = [
        part, part.soiled, part.photograph(), glyphs.StampingVariation(), glyphs.draw_light(rng),
        glyphs.draw_camera(rng),
        glyphs.ideal_relief(font.glyph("A"), glyphs.default_die(3.0), height_mm=3.0,
        pitch_mm=0.1, margin_mm=1.0), known, plan, scan, whisker_array.estimate_relief(scan, edges),
        whisker_array.draw_sensor_chain(8, rng=rng), whisker_array.land_friction(scan), whisker,
    ]  # fmt: skip
    return [value for root in roots for value in values_within(root)]


def public_values(package: ModuleType) -> Iterator[type]:
    for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
        for name, kind in vars(importlib.import_module(module.name)).items():
            own = inspect.isclass(kind) and kind.__module__ == module.name and not name.startswith("_")
            if own and dataclasses.is_dataclass(kind):
                yield kind


def test_what_a_reading_passes_through_shows_itself_on_one_line(met: list[object]) -> None:
    assert len({type(value) for value in met}) > 25
    for value in met:
        assert "\n" not in repr(value)
        assert len(repr(value)) < LONGEST_LINE, repr(value)


def test_no_public_value_prints_its_arrays(met: list[object]) -> None:
    kinds = [kind for package in (glyphs, whisker_array) for kind in public_values(package)]
    assert len(kinds) > 50
    shown = {type(value) for value in met}
    long = re.compile(r"NDArray|tuple|Mapping|Vector|Matrix|Lines|Values|Field")
    for kind in kinds:
        own = [item for item in dataclasses.fields(kind) if item.repr]
        plain = len(own) <= 6 and not any(long.search(str(item.type)) for item in own)
        assert kind.__repr__ is one_line or kind in shown or plain, kind


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
