"""Height maps that are felt by choice: what a photograph beside them saves."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from glyphs.camera.photo import Photo
from glyphs.surface.maps import HeightMap
from pipeline.common.settings import ReadSettings
from pipeline.formats.npz import write_npz
from pipeline.formats.part_files import PartFiles
from pipeline.formats.photos import write_photo
from pipeline.formats.synth import SynthSpec, make_part
from pipeline.reading.part_reader import PartReader
from recognition.reader import Reader
from whisker_array.scan.pass_log import PassLog

HEIGHT_MM, BUDGET_S, LAND_MM = 3.0, 60.0, 12.0


def on_more_land(spec: SynthSpec, folder: Path) -> PartFiles:
    """A part whose plate goes on above and below its line, and a photograph of it."""
    made = make_part(spec, 0)
    photo = made.photograph()
    assert photo.pitch_mm is not None

    def above_and_below(values: NDArray[Any], pitch_mm: float) -> NDArray[Any]:
        rows = round(LAND_MM / pitch_mm)
        return np.pad(values, [(rows, rows), *[(0, 0)] * (values.ndim - 1)], mode="edge")

    pitch = made.height_map.pitch_mm
    write_npz(folder / "part.npz", HeightMap(above_and_below(made.height_map.z_mm, pitch), pitch))
    pixels = above_and_below(photo.pixels, photo.pitch_mm)
    write_photo(folder / "part.png", Photo(pixels, photo.pitch_mm))
    return PartFiles("part", str(folder / "part.npz"), "", (str(folder / "part.png"),))


def test_the_camera_tells_touch_where_to_feel(tmp_path: Path) -> None:
    spec = SynthSpec("A9", seed=4, height_mm=HEIGHT_MM)
    part = on_more_land(spec, tmp_path)
    reader = Reader(format="A9", fonts=("gothic",), height_mm=HEIGHT_MM)

    def log(mode: Any) -> PassLog:
        found = PartReader(reader, ReadSettings(mode=mode, active=True, budget_s=BUDGET_S)).read(part)
        assert (found.text, found.decision) == (make_part(spec, 0).text, "accept")
        touch = found.trace.touch if mode == "fused" else found
        assert touch is not None
        assert touch.trace.scan is not None
        assert touch.trace.scan.log is not None
        return touch.trace.scan.log

    alone, told = log("tactile"), log("fused")
    (_, y0, _, y1), (_, top, _, bottom) = told.field_mm, alone.field_mm
    # the line and a character above and below it, of a plate three times as high
    assert y0 > top + 0.5 * LAND_MM
    assert y1 < bottom - 0.5 * LAND_MM
    assert told.stage_s < 0.8 * alone.stage_s
