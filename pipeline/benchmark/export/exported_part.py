"""Export one part of an exam as files: surface, photograph, views by touch, cropped lines and truth.

parts/NAME.npz          surface and soil              photos/NAME.png          photograph
ideal/NAME.png          heights, 16 bit               lines/NAME-VIEW.png      the line, as peers see it
felt/NAME-relief.png    heights as felt, 8 bit        felt/NAME-relief-16.png  the same, 16 bit
felt/NAME-edges.png     strongest edge, 8 bit         felt/NAME-edges-DEG-16.png  one direction of travel each
labels/NAME.json        text, places, levels, scales, hashes of the files above

In a 16 bit picture, value = (pixel - ZERO) * step, and pixel 0 means unknown. The PNG's text has `step`, `zero`,
`unit`, `pitch_mm` and `origin_mm`, the position of the first pixel.
"""

from __future__ import annotations

import hashlib
import json
import math
import tempfile
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from glyphs.atomic import replacing
from glyphs.camera.photo import Photo
from glyphs.errors import MarksError
from pipeline.benchmark.exam.designed_parts import DesignedParts
from pipeline.benchmark.exam.specimens import Box, Item, Specimen
from pipeline.benchmark.readers.mode import PartReadings
from pipeline.benchmark.readers.pictures import PICTURES, draw_edges, draw_heights
from pipeline.common.output_paths import check_writable
from pipeline.formats.photos import write_photo
from pipeline.formats.synth import write_surface
from recognition.language.orientation import Orientation
from recognition.reader import Reader
from recognition.see.photo_frame import photo_origin_mm, photo_pitch_mm

if TYPE_CHECKING:
    from pipeline.benchmark.readers.mode import FeltMaps
    from whisker_array.scan.scan import Scan


LABELS = "labels"
FOLDERS = ("parts", "photos", "felt", "ideal", "lines", LABELS)
ZERO = 32768
# step of a map with values within ±3.2766: a tenth of a micrometre for heights, below the resolution of touch
FINEST = 1e-4
_MOST = ZERO - 1


def export_part(parts: DesignedParts, item: Item) -> tuple[dict[str, Any], dict[str, bytes]]:
    """Make a part; its label, and the contents of its files by path. Raises MarksError: it cannot be made."""
    specimen = parts.make(item)
    height_mm = parts.spec(item.condition).height_mm
    with tempfile.TemporaryDirectory() as scratch:
        writer = _Writer(
            Path(scratch), specimen, PartReadings(specimen, Reader(orientation=Orientation.UPRIGHT))
        )
        writer.write()
        paths = sorted(p for p in Path(scratch).rglob("*") if p.is_file())
        files = {p.relative_to(scratch).as_posix(): p.read_bytes() for p in paths}
    label: dict[str, Any] = {
        "part": item.part,
        "text": specimen.truth,
        "levels": item.condition.levels,
        "height_mm": height_mm,
        "line_mm": specimen.line_mm,
        "beside_mm": specimen.beside_mm,
        "characters": [
            {"char": c, "box_mm": b} for c, b in zip(specimen.truth, specimen.boxes_mm, strict=True)
        ],
        "views": writer.views,
        "lines": writer.lines,
        "scan": writer.scan,
        "files": {path: hashlib.sha256(data).hexdigest() for path, data in files.items()},
    }
    text = json.dumps(label, indent=1, ensure_ascii=False)
    return json.loads(text), {**files, label_path(item.part): (text + "\n").encode()}


def label_path(part: str) -> str:
    """Path of the label of a part, within the folder."""
    return f"{LABELS}/{part}.json"


@dataclass
class _Writer:
    folder: Path
    specimen: Specimen
    senses: PartReadings
    views: dict[str, dict[str, Any]] = field(default_factory=dict)
    lines: dict[str, str] = field(default_factory=dict)
    scan: dict[str, Any] = field(default_factory=dict)

    def write(self) -> None:
        for name in FOLDERS:
            (self.folder / name).mkdir()
        part, surface = self.specimen.part, self.specimen.height_map
        write_surface(self.folder / f"parts/{part}.npz", surface, self.specimen.soil)
        photo = self.senses.photo
        photo_grid = _grid(photo_pitch_mm(photo), photo_origin_mm(photo), photo.shape)
        self._picture("photo", f"photos/{part}.png", photo, photo_grid)
        plate = _grid(surface.pitch_mm, (0.0, 0.0), surface.z_mm.shape)
        self._layer("ideal", f"ideal/{part}.png", surface.z_mm, "mm", plate)
        self._add_felt_views(self.senses.felt, f"felt/{part}")
        for view in (view for view in PICTURES if view in self.views):
            path = f"lines/{part}-{view}.png"
            try:
                drawn = Photo(PICTURES[view](self.senses))
            except MarksError:  # fewer than 8 pixels of the line lie in the picture
                continue
            write_photo(self.folder / path, drawn)
            self.lines[view] = path

    def _add_felt_views(self, maps: FeltMaps, stem: str) -> None:
        self.scan, edges, relief = _scan(maps.scan), maps.edges, maps.relief
        if edges is not None:
            grid = _grid(edges.pitch_mm, edges.origin_mm, edges.shape)
            drawn = Photo(draw_edges(edges), pitch_mm=edges.pitch_mm)
            self._picture("edges", f"{stem}-edges.png", drawn, grid)
            for direction, layer in zip(edges.directions, edges.enhancement, strict=True):
                view, values = f"edges-{direction:d}-16", np.where(edges.valid, layer, np.nan)
                self._layer(view, f"{stem}-{view}.png", values, "enhancement", grid)
        if relief is not None:
            grid = _grid(relief.pitch_mm, relief.origin_mm, relief.height_mm.shape)
            heights = draw_heights(relief.height_mm, pitch_mm=relief.pitch_mm)
            self._picture("relief", f"{stem}-relief.png", Photo(heights, pitch_mm=relief.pitch_mm), grid)
            self._layer("relief-16", f"{stem}-relief-16.png", relief.height_mm, "mm", grid)

    def _picture(self, view: str, path: str, photo: Photo, grid: _Grid) -> None:
        write_photo(self.folder / path, photo)
        self.views[view] = {"file": path, **grid}

    def _layer(self, view: str, path: str, values: NDArray[np.floating], unit: str, grid: _Grid) -> None:
        place = {name: grid[name] for name in ("pitch_mm", "origin_mm")}
        step = write_layer(self.folder / path, values, unit=unit, **place)
        self.views[view] = {"file": path, **grid, "step": step, "unit": unit}


# position of the pixels of a view on the plate, in the form of its label
_Grid = dict[str, Any]


def _grid(pitch_mm: float, origin_mm: tuple[float, float], shape: tuple[int, ...]) -> _Grid:
    origin = [round(float(v), 6) for v in origin_mm]
    return {"pitch_mm": float(pitch_mm), "origin_mm": origin, "shape": list(shape[:2])}


def _scan(scan: Scan) -> dict[str, Any]:
    return {
        "directions_deg": [int(direction) for direction in scan.directions],
        "line_pitch_mm": scan.line_pitch_mm,
        "sample_pitch_mm": scan.sweeps[0].plan.step_mm,
        "sample_rate_hz": scan.sample_rate_hz,
        "preload_mm": scan.touch.preload_mm,
        "tip_radius_mm": scan.touch.tip_radius_mm,
        "whisker": scan.touch.whisker,
    }


def polygon_px(box_mm: Box, view: dict[str, Any]) -> list[list[float]]:
    """The corners of a box in the pixels of a view, clockwise from the top left, within the picture."""
    (x, y), pitch, (rows, cols) = view["origin_mm"], view["pitch_mm"], view["shape"]
    columns = [min(max(0.0, (v - x) / pitch), cols - 1.0) for v in (box_mm[0], box_mm[2])]
    lines = [min(max(0.0, (v - y) / pitch), rows - 1.0) for v in (box_mm[1], box_mm[3])]
    corners = ((0, 0), (1, 0), (1, 1), (0, 1))
    return [[round(columns[i], 1), round(lines[j], 1)] for i, j in corners]


def step_of(values: NDArray[np.floating]) -> float:
    """Step of integers that cover a map's range: `FINEST`, doubled as often as needed."""
    most = float(np.nanmax(np.abs(values), initial=0.0))
    return FINEST * 2.0 ** max(0, math.ceil(math.log2(max(most, 1e-12) / (FINEST * _MOST))))


def write_layer(
    path: Path, values: NDArray[np.floating], *, unit: str, pitch_mm: float, origin_mm: tuple[float, float]
) -> float:
    """Write a map (rows, cols), NaN where unknown, as PNG; return its step. Raises FileError: it cannot be written."""
    from PIL import Image
    from PIL.PngImagePlugin import PngInfo

    check_writable(path, (".png",))
    step = step_of(values)
    known = np.isfinite(values)
    pixels = np.where(known, np.rint(np.where(known, values, 0.0) / step) + ZERO, 0.0).astype(np.uint16)
    text = PngInfo()
    scale = {"step": step, "zero": ZERO, "unit": unit, "pitch_mm": pitch_mm}
    for name, value in scale.items():
        text.add_text(name, str(value))
    text.add_text("origin_mm", "{:g} {:g}".format(*origin_mm))
    with replacing(path) as temporary:
        Image.fromarray(pixels).save(temporary, "PNG", compress_level=6, pnginfo=text)
    return step
