"""Maps as pictures of 16 bit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from glyphs.errors import FileError
from pipeline.benchmark.export.exported_part import FINEST, step_of, write_layer


@pytest.mark.parametrize("most", [1e-5, 0.3, 3.2767, 3.3, 50.0])
def test_values_come_back_to_half_a_step(tmp_path: Path, most: float) -> None:
    values = np.linspace(-most, most, 30).reshape(5, 6)
    values[2, 3] = np.nan
    step = write_layer(tmp_path / "a.png", values, unit="mm", pitch_mm=0.05, origin_mm=(0.5, -1.0))
    with Image.open(tmp_path / "a.png") as picture:
        text: dict[str, str] = picture.text  # type: ignore[attr-defined]
        pixels = np.asarray(picture)
    assert pixels.dtype == np.uint16
    assert pixels[2, 3] == 0
    found = np.where(pixels == 0, np.nan, (pixels.astype(float) - int(text["zero"])) * float(text["step"]))
    np.testing.assert_allclose(found, values, atol=0.5001 * step)
    assert (text["unit"], text["pitch_mm"], text["origin_mm"]) == ("mm", "0.05", "0.5 -1")
    assert step == step_of(values)
    assert step == FINEST or step / 2 * 32767 < most  # the least that fits


def test_only_png(tmp_path: Path) -> None:
    with pytest.raises(FileError, match="unsupported output format"):
        write_layer(tmp_path / "a.jpg", np.zeros((4, 4)), unit="mm", pitch_mm=0.1, origin_mm=(0.0, 0.0))
