"""What the camera's reader believed, on disk: a scan that comes later is fused with it, not with the photograph anew.

An `.npz` without pickles: `record` holds the reading and all else that is text or numbers as JSON, `edges` the camera's
edge map in half precision, thinned to what touch can be compared with.
"""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from glyphs.errors import FileError, damage_reported, require_file
from pipeline.common.record_json import from_json, to_json

if TYPE_CHECKING:
    from glyphs.surface.maps import EdgeMap, HeightMap
    from recognition.lattice import Lattice
    from recognition.reading import Reading, ReadingTrace

FORMAT_VERSION = 1
_MAX_BYTES = 200_000_000
_FINEST_HEIGHTS = 0.0125
"""Pitch of the edges kept, character heights at least: registration compares at three times that."""


@dataclass(frozen=True, eq=False)
class KeptVision:
    """A reading of a photograph as a later job needs it.

    Attributes:
        vision: the reading; its edges may be thinned.
        middle_mm: photo frame (x, y) of the middle of the picture; None where its scale is unknown.
        expected: text that the reading was opened for; empty for none.
    """

    vision: Reading
    middle_mm: tuple[float, float] | None = None
    expected: str = ""

    @classmethod
    def of(cls, vision: Reading, *, expected: str = "") -> KeptVision:
        """What to keep of a reading of a photograph."""
        from recognition.vision_frame import photo_middle_mm

        photo = vision.trace.photo
        middle = photo_middle_mm(photo) if photo is not None and photo.pitch_mm is not None else None
        return cls(vision, middle, expected)

    def vision_for(self, expected: str) -> Reading:
        """The reading, to verify this text with: its own beliefs where it was not opened for it."""
        trace = self.vision.trace
        known = trace.open_lattice is not None and expected == self.expected
        return self.vision if known else self.vision.traced(open_lattice=trace.lattice)


def over(kept: KeptVision, surface: HeightMap | None) -> KeptVision:
    """The same with the middle of the picture over that of a height map, where both are known."""
    if surface is None or kept.middle_mm is None:
        return kept
    width, height = surface.size_mm
    return moved(kept, 0.5 * width - kept.middle_mm[0], 0.5 * height - kept.middle_mm[1])


def moved(kept: KeptVision, x_mm: float, y_mm: float) -> KeptVision:
    """The same in a frame that lies otherwise: all coordinates grow by so much."""
    reading, trace = kept.vision, kept.vision.trace
    edges, place = trace.edge_map, trace.place
    if edges is not None:
        x0, y0 = edges.origin_mm
        edges = replace(edges, origin_mm=(x0 + x_mm, y0 + y_mm))
    if place is not None:
        place = replace(place, middle_mm=(place.middle_mm[0] + x_mm, place.middle_mm[1] + y_mm))
    lattices = {name: _shifted_lattice(own, x_mm, y_mm) for name, own in trace.by_engine.items()}
    characters = tuple(replace(c, box=_shifted(c.box, x_mm, y_mm)) for c in reading.characters)
    box = None if reading.box is None else _shifted(reading.box, x_mm, y_mm)
    middle = kept.middle_mm
    return replace(
        kept,
        vision=replace(reading, characters=characters, box=box).traced(
            lattice=_shifted_lattice(trace.lattice, x_mm, y_mm),
            open_lattice=_shifted_lattice(trace.open_lattice, x_mm, y_mm),
            edge_map=edges,
            place=place,
            by_engine=MappingProxyType(lattices),
        ),
        middle_mm=None if middle is None else (middle[0] + x_mm, middle[1] + y_mm),
    )


def _shifted(box: Any, x_mm: float, y_mm: float) -> Any:
    return type(box)(box.x0_mm + x_mm, box.y0_mm + y_mm, box.x1_mm + x_mm, box.y1_mm + y_mm)


def _shifted_lattice(lattice: Lattice | None, x_mm: float, y_mm: float) -> Lattice | None:
    if lattice is None:
        return None
    return replace(lattice, boxes=tuple(_shifted(b, x_mm, y_mm) for b in lattice.boxes))


def save_vision(path: Path, kept: KeptVision) -> None:
    """Write it; the file appears whole or not at all.

    Raises:
        FileError: it cannot be written.
    """
    from pipeline.common.atomic import replacing

    reading, trace = kept.vision, kept.vision.trace
    record: dict[str, Any] = {
        "version": FORMAT_VERSION,
        "reading": _reading_members(reading),
        "engine": trace.engine,
        "place": None if trace.place is None else to_json(trace.place),
        "lattice": _lattice_members(trace.lattice),
        "by_engine": {name: _lattice_members(lattice) for name, lattice in trace.by_engine.items()},
        "middle_mm": kept.middle_mm,
        "open_lattice": _lattice_members(trace.open_lattice),
        "expected": kept.expected,
    }
    arrays: dict[str, NDArray[Any]] = {}
    if trace.edge_map is not None:
        edges = _thinned(trace.edge_map, trace.place.height_mm if trace.place is not None else 0.0)
        arrays = {
            "edges": edges.enhancement.astype(np.float16),
            "valid": np.packbits(edges.valid),
        }
        record["edges"] = {
            "directions": [int(d) for d in edges.directions],
            "pitch_mm": edges.pitch_mm,
            "origin_mm": edges.origin_mm,
        }
    # JSON has no infinities; a character that cannot be stands as null
    text = json.dumps(record, allow_nan=False).encode("utf-8")
    with replacing(path) as temporary, temporary.open("wb") as stream:
        np.savez(stream, record=np.frombuffer(text, dtype=np.uint8), **arrays)  # type: ignore[arg-type]


def _reading_members(reading: Reading) -> dict[str, Any]:
    """All of a reading but its trace."""
    members = {f.name: getattr(reading, f.name) for f in fields(reading) if f.name != "trace"}
    return to_json({**members, "seconds": dict(reading.seconds)})


def _reading(members: Mapping[str, Any], trace: ReadingTrace) -> Reading:
    from recognition.box import Box
    from recognition.reading import CharacterReading, Decision, Reading, ReadingFlag

    made = {
        "characters": tuple(from_json(CharacterReading, c) for c in members["characters"]),
        "decision": Decision(members["decision"]),
        "flags": ReadingFlag(members["flags"]),
        "box": None if members["box"] is None else from_json(Box, members["box"]),
        "spaces_after": frozenset(members["spaces_after"]),
        "seconds": MappingProxyType(dict(members["seconds"])),
        "notes": tuple(members["notes"]),
    }
    return Reading(**{**members, **made, "trace": trace})


def _lattice_members(lattice: Lattice | None) -> dict[str, Any] | None:
    if lattice is None:
        return None
    return {
        "chars": "".join(lattice.chars),
        "log_belief": [[v if np.isfinite(v) else None for v in row] for row in lattice.log_belief.tolist()],
        "boxes": [[b.x0_mm, b.y0_mm, b.x1_mm, b.y1_mm] for b in lattice.boxes],
        "spaces_after": sorted(lattice.spaces_after),
    }


def _thinned(edges: EdgeMap, height_mm: float) -> EdgeMap:
    """Means over squares of pixels, where they are far smaller than touch is compared at."""
    step = int(_FINEST_HEIGHTS * height_mm / edges.pitch_mm)
    if step < 2 or min(edges.shape) < 8 * step:
        return edges
    rows, cols = (n // step for n in edges.shape)
    count = edges.valid[: rows * step, : cols * step].reshape(rows, step, cols, step).sum(axis=(1, 3))
    layers = edges.enhancement[:, : rows * step, : cols * step].reshape(-1, rows, step, cols, step)
    total = layers.sum(axis=(2, 4), dtype=np.float32)
    x0, y0 = edges.origin_mm
    half = 0.5 * (step - 1) * edges.pitch_mm
    return replace(
        edges,
        enhancement=np.asarray(total / np.maximum(count, 1), dtype=np.float32),
        valid=2 * count > step * step,
        pitch_mm=edges.pitch_mm * step,
        origin_mm=(x0 + half, y0 + half),
    )


def load_vision(path: Path) -> KeptVision:
    """Read what `save_vision` wrote.

    Raises:
        FileError: it is no such file, or damaged.
    """
    require_file(path, most_bytes=_MAX_BYTES)
    with damage_reported(path, kind="kept reading of a photograph"):
        # in memory: the file may be expired while it is read
        with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as held:
            arrays = {name: held[name] for name in held.files}
        record: Mapping[str, Any] = json.loads(bytes(arrays["record"]).decode("utf-8"))
        if record["version"] != FORMAT_VERSION:
            raise FileError(path, f"is of version {record['version']}", "read the photograph again")
        return _kept(record, arrays)


def _kept(record: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> KeptVision:
    from recognition.reading import ReadingTrace
    from recognition.vision_frame import LinePlace

    by_engine = {name: _lattice(own) for name, own in record["by_engine"].items()}
    middle = record["middle_mm"]
    trace = ReadingTrace(
        lattice=_lattice(record["lattice"]),
        open_lattice=_lattice(record["open_lattice"]),
        edge_map=_edges(record["edges"], arrays) if "edges" in record else None,
        engine=str(record["engine"]),
        place=None if record["place"] is None else from_json(LinePlace, record["place"]),
        by_engine=MappingProxyType({n: own for n, own in by_engine.items() if own is not None}),
    )
    return KeptVision(
        _reading(record["reading"], trace),
        None if middle is None else (float(middle[0]), float(middle[1])),
        str(record["expected"]),
    )


def _lattice(record: Mapping[str, Any] | None) -> Lattice | None:
    from recognition.box import Box
    from recognition.lattice import Lattice

    if record is None:
        return None
    chars = tuple(record["chars"])
    rows = [[-np.inf if v is None else float(v) for v in row] for row in record["log_belief"]]
    return Lattice(
        chars,
        np.array(rows, dtype=np.float64).reshape(len(rows), len(chars)),
        boxes=tuple(Box(*(float(v) for v in box)) for box in record["boxes"]),
        spaces_after=frozenset(int(k) for k in record["spaces_after"]),
    )


def _edges(record: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> EdgeMap:
    from glyphs.surface.maps import EdgeMap, TraceDirection

    layers = arrays["edges"].astype(np.float32)
    rows, cols = layers.shape[1:]
    valid = np.unpackbits(arrays["valid"], count=rows * cols).reshape(rows, cols).astype(np.bool_)
    return EdgeMap(
        enhancement=layers,
        directions=tuple(TraceDirection(d) for d in record["directions"]),
        valid=valid,
        pitch_mm=float(record["pitch_mm"]),
        origin_mm=(float(record["origin_mm"][0]), float(record["origin_mm"][1])),
    )
