"""Pictures in the plate frame, and the drawing of a whisker for the workshop: its dimensions are the whisker's."""

from __future__ import annotations

import importlib.util
import itertools
import math
import sys
from pathlib import Path

import lazy_loader
import numpy as np
import pytest
from matplotlib.figure import Figure

from glyphs.errors import FileError
from glyphs.surface.maps import HeightMap
from pipeline.cli.main import main
from pipeline.common.texts import same_text
from pipeline.formats.whisker_file import WhiskerFile
from pipeline.plots.pictures import save_figure
from recognition.decide.picture import moment_image
from whisker_array.scan.scan import Scan, trace_scan
from whisker_array.simulation.traces import Fidelity
from whisker_array.whisker.array import RasterPlan
from whisker_array.whisker.comb import WhiskerArray
from whisker_array.whisker.sections import Rectangle, Round
from whisker_array.whisker.shapes import LShaped, straight_whisker
from whisker_array.whisker.touch import Touch, default_touch


def scan_of(height_map: HeightMap) -> Scan:
    plan = RasterPlan(WhiskerArray(3, 1.0), (0.5, 0.5, 7.0, 4.0), 0.25, 0.1, lead_mm=0.5)
    return trace_scan(height_map, touch=default_touch(5.0), plan=plan, fidelity=Fidelity.POINTWISE)


def test_moments_of_every_direction_lie_alike_in_the_plate() -> None:
    z = np.zeros((50, 80), np.float32)
    z[30:40, 60:75] = -0.3  # below right of the middle
    for sweep in scan_of(HeightMap(z, 0.1)).sweeps:
        values, (left, right, bottom, top) = moment_image(sweep)
        away = np.abs(values - np.nanmedian(values))
        row, col = np.array(np.nonzero(away > 0.5 * np.nanmax(away))).mean(axis=1)
        x = left + (col / (values.shape[1] - 1)) * (right - left)
        y = top + (row / (values.shape[0] - 1)) * (bottom - top)
        assert x == pytest.approx(6.7, abs=0.9)
        assert y == pytest.approx(3.45, abs=0.6)


def test_pictures_that_cannot_be_written_are_refused(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"\.png, \.svg, \.pdf"):
        save_figure(Figure(), tmp_path / "a.jpeg")
    with pytest.raises(FileError, match="cannot be written"):
        save_figure(Figure(), tmp_path / "none" / "a.png")


@pytest.mark.parametrize(
    ("text", "truth", "same"), [("AB C", "ABC", True), ("", "", True), ("AB", "BA", False)]
)
def test_spaces_are_not_stamped(text: str, truth: str, same: bool) -> None:
    assert same_text(text, truth) is same


ezdxf = lazy_loader.load("ezdxf")
NEEDS_EZDXF = pytest.mark.skipif(
    importlib.util.find_spec("ezdxf") is None, reason="the extra `drawing` is not installed"
)
ASKED = ["design", "--alpha=30:60", "--mu=0.1:0.5", "--depth-mm=0.2", "--height-mm=5", "--no-trade-offs"]


def used(shape: LShaped) -> WhiskerFile:
    touch = Touch(tip=shape.tip_model(), preload_mm=0.6, tip_radius_mm=0.05, friction=0.2)
    return WhiskerFile(shape, touch, 5.0, 0.125, 0.0625, 50.0)


L = LShaped(30.0, 2.5, 2.0, math.radians(20.0), Rectangle(0.2, 1.0))
RISE = 30.0 * math.sin(math.radians(20.0))


@NEEDS_EZDXF
@pytest.mark.parametrize(
    ("shape", "lengths", "angles"),
    [
        (L, {30.0 * math.cos(math.radians(20.0)), 2.5, 2.0, 30.0, 2.5 - 0.6 + RISE, 0.6, 0.2, 1.0}, {20.0}),
        (LShaped(30.0, 2.5, 0.0, 0.0, Round(0.3)), {30.0, 2.5, 1.9, 0.6, 0.3}, set()),
        (
            straight_whisker(40.0, math.radians(30.0), Round(0.3)),
            {40.0 * math.cos(math.pi / 6), 40.0, 19.4, 0.6, 0.3},
            {30.0},
        ),
    ],
)
def test_the_dimensions_are_the_whiskers(
    tmp_path: Path, shape: LShaped, lengths: set[float], angles: set[float]
) -> None:
    from pipeline.plots.whisker_drawing import save_drawing

    path = tmp_path / "whisker.dxf"
    save_drawing(used(shape), path)
    drawing = ezdxf.readfile(path)
    assert not drawing.audit().errors
    assert drawing.units == ezdxf.units.MM
    measured: dict[bool, list[float]] = {False: [], True: []}
    for dimension in drawing.modelspace().query("DIMENSION"):
        factor = dimension.override().get("dimlfac", 1.0)
        angular = dimension.dimtype == 5
        measured[angular].append(dimension.get_measurement() * (1.0 if angular else factor))
    assert sorted(measured[False]) == pytest.approx(sorted(lengths), abs=1e-9)
    assert sorted(measured[True]) == pytest.approx(sorted(angles), abs=1e-9)
    # the whisker itself, from free tip to clamp, is drawn in millimetres
    (line,) = [
        p for p in drawing.modelspace().query("LWPOLYLINE") if p.dxf.hasattr("const_width") and not p.closed
    ]
    drawn = [(p[0], p[1]) for p in line.get_points()]
    assert sum(math.dist(a, b) for a, b in itertools.pairwise(drawn)) == pytest.approx(
        sum(math.dist(s.start_mm, s.end_mm) for s in shape.segments())
    )


def test_without_the_library_the_extra_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "ezdxf", None)
    assert main([*ASKED, "--drawing", str(tmp_path / "whisker.dxf")]) == 2
    assert "pip install 'tactile-marks[drawing]'" in capsys.readouterr().err
