"""Pictures: drawn for every kind of reading, in the plate frame; sheets of fonts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from glyphs.errors import FileError
from glyphs.surface.maps import HeightMap
from pipeline.common.texts import same_text
from pipeline.plots.pictures import save_figure
from recognition.decide.picture import moment_image
from whisker_array.scan.scan import Scan, trace_scan
from whisker_array.simulation.traces import Fidelity
from whisker_array.whisker.array import RasterPlan, WhiskerArray
from whisker_array.whisker.touch import default_touch


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
