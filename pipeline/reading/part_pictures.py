"""Pictures for the operator's page, drawn without matplotlib because a part waits for them, with their place: `x0_mm`,
`y0_mm` of the middle of the first pixel, and `mm_per_pixel`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from glyphs.errors import FileError
from pipeline.common.records import EvidenceKind

if TYPE_CHECKING:
    from glyphs.camera.photo import Photo
    from glyphs.surface.maps import EdgeMap
    from recognition.decide.reading import Reading

MOST_PIXELS_A_SIDE = 1600
# width of an edge map's picture: small maps are enlarged, so that strokes can be seen
LEAST_EDGE_PIXELS = 900
QUALITY = 88
_STRONGEST_PERCENT = 99.0
_SAMPLED = 200_000
_NOT_FELT = 225
_BLUE, _WHITE, _RED = (27, 78, 145), (252, 252, 252), (160, 24, 38)


@dataclass(frozen=True)
class Picture:
    """A picture of a part, for evidence: the encoded file, its name for a download, `meta` as in `EvidenceRecord`."""

    kind: EvidenceKind
    name: str
    content: bytes
    media_type: str
    meta: Mapping[str, float]


def pictures_of(reading: Reading, *, photo: bool = True) -> tuple[Picture, ...]:
    """Pictures of a part: its photograph, if wanted, and the edge map of touch, as far as available."""
    photos = [photo_picture(reading.trace.photo)] if photo and reading.trace.photo is not None else []
    edges = None if reading.touch is None else reading.touch.trace.edge_map
    return (*photos, *([] if edges is None else [edges_picture(edges)]))


def photo_picture(photo: Photo) -> Picture:
    """The photograph, upright, in its own frame."""
    from recognition.see.photo_frame import photo_origin_mm, photo_pitch_mm

    pixels = photo.eight_bit[..., ::-1] if photo.pixels.ndim == 3 else photo.eight_bit
    return _encode(
        EvidenceKind.PHOTO_PICTURE,
        "photo.jpg",
        pixels,
        origin_mm=photo_origin_mm(photo),
        pitch_mm=photo_pitch_mm(photo),
    )


def edges_picture(edges: EdgeMap) -> Picture:
    """Touch's edge map in the plate frame: land white, falls blue, rises red."""
    # in the mean, relief that only some directions show is weaker than relief that all show
    value = edges.enhancement.mean(axis=0)
    top = max(_strongest(np.abs(value), edges.valid), 1e-3)
    index = np.clip(127.5 + 127.5 * value / top, 0.0, 255.0).astype(np.uint8)
    colours = _diverging()[index]
    colours[~edges.valid] = _NOT_FELT
    return _encode(
        EvidenceKind.EDGES_PICTURE,
        "edges.jpg",
        colours,
        origin_mm=edges.origin_mm,
        pitch_mm=edges.pitch_mm,
        least=LEAST_EDGE_PIXELS,
    )


def _strongest(size: NDArray[np.float32], valid: NDArray[np.bool_]) -> float:
    known = size[valid]
    if not known.size:
        return 0.0
    return float(np.percentile(known[:: max(1, known.size // _SAMPLED)], _STRONGEST_PERCENT))


def _diverging() -> NDArray[np.uint8]:
    """(256, 3) blue to white to red, as OpenCV orders colours."""
    values = np.array([0.0, 127.5, 255.0])
    stops = np.array([_BLUE, _WHITE, _RED], dtype=np.float64)[:, ::-1]
    return np.stack([np.interp(np.arange(256), values, stops[:, k]) for k in range(3)], axis=1).astype(
        np.uint8
    )


def _encode(
    kind: EvidenceKind,
    name: str,
    pixels: NDArray[Any],
    *,
    origin_mm: tuple[float, float],
    pitch_mm: float,
    least: int = 0,
) -> Picture:
    from glyphs.opencv import cv2

    shape = pixels.shape[:2]
    scale = min(max(1.0, least / shape[1]), MOST_PIXELS_A_SIDE / max(shape))
    height, width = (max(1, round(side * scale)) for side in shape)
    if (height, width) != shape:
        how = cv2.INTER_AREA if width < shape[1] else cv2.INTER_LINEAR
        pixels = cv2.resize(pixels, (width, height), interpolation=how)
    done, encoded = cv2.imencode(".jpg", np.ascontiguousarray(pixels), (cv2.IMWRITE_JPEG_QUALITY, QUALITY))
    if not done:
        raise FileError(name, "could not be drawn", "report it")
    size = pitch_mm * shape[1] / width
    meta = {
        # both pictures have the same border, but not the same middle of the first pixel
        "x0_mm": origin_mm[0] + 0.5 * (size - pitch_mm),
        "y0_mm": origin_mm[1] + 0.5 * (size - pitch_mm),
        "mm_per_pixel": size,
        "width": float(width),
        "height": float(height),
    }
    return Picture(kind, name, encoded.tobytes(), "image/jpeg", meta)
