"""Parts that were drawn and felt, one file each: a reader reads them again without drawing and simulating.

    part --save_part--> number.h5 --load_part--> the same part, to the last bit

What the virtual array felt is kept by what determines it: surface, dirt, whiskers and sweep. A reader that scans
otherwise misses those sweeps, and they are simulated. After a change of the simulation all parts are drawn again.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, fields, is_dataclass
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from typing import Any, TypeAlias
from unittest import mock

import h5py
import numpy as np
from numpy.typing import NDArray

from glyphs.atomic import replacing
from glyphs.camera.photo import Photo
from glyphs.soiling.soil import Soil
from glyphs.surface.maps import HeightMap
from whisker_array.scan import scan
from whisker_array.scan.mounting import Mounted
from whisker_array.scan.sweep import Sweep
from whisker_array.simulation.traces import Fidelity
from whisker_array.whisker.passes import SweepPlan

Felt: TypeAlias = tuple[NDArray[np.float32], NDArray[np.uint8], NDArray[np.float32]]
"""Moments, flags and moments in air of a `Sweep`."""
SOIL_ARRAYS = ("thickness_mm", "hardness_mpa", "friction")


@dataclass(frozen=True, eq=False)
class DrawnPart:
    """A part with everything that it was drawn from."""

    number: int
    generator: str
    severity: float
    font: str
    format: str
    soil: str
    text: str
    height_mm: float
    height_map: HeightMap
    photo: Photo
    soil_layer: Soil | None = None

    @property
    def facts(self) -> dict[str, Any]:
        """All but surface, photograph and layer of soil."""
        return {f.name: getattr(self, f.name) for f in fields(self)[:8]}


@dataclass
class KeptSweeps:
    """Sweeps of the virtual array by digest; one that is missing is simulated and joins them.

    Attributes:
        felt: sweeps by digest.
        simulated: number of sweeps that were missing.
    """

    felt: dict[str, Felt] = field(default_factory=dict)
    simulated: int = 0

    @contextmanager
    def in_place_of_simulation(self) -> Iterator[None]:
        """Within the block, scans of the virtual array take their sweeps from here."""
        with mock.patch.object(scan, "Mounted", self._mount):
            yield

    def _mount(self, surface: HeightMap, **bench: Any) -> _KeptBench:
        return _KeptBench(self, surface, bench)


@dataclass(frozen=True, eq=False)
class _KeptBench:
    """Stands for `Mounted`; the surface is only prepared for a sweep that is missing."""

    kept: KeptSweeps
    surface: HeightMap
    bench: dict[str, Any]

    @property
    def fidelity(self) -> Fidelity:
        return Fidelity(self.bench["fidelity"])

    @cached_property
    def _mounted(self) -> Mounted:
        return Mounted(self.surface, **self.bench)

    def __post_init__(self) -> None:
        _ = self._digest  # of the random generator before any noise is drawn

    @cached_property
    def _digest(self) -> str:
        return _digest(self.surface, self.bench)

    def feel(self, sweep: SweepPlan, **rates: Any) -> Sweep:
        key, felt = _digest(self._digest, sweep, rates), self.kept.felt
        if key not in felt:
            simulated = self._mounted.feel(sweep, **rates)
            felt[key] = (simulated.moment_n_mm, simulated.flags, simulated.air_n_mm)
            self.kept.simulated += 1
        return Sweep(sweep, *felt[key])


def _digest(*values: object) -> str:
    digest = sha256()
    for chunk in _bytes_of(values):
        digest.update(chunk)
    return digest.hexdigest()[:32]


def _bytes_of(value: object) -> Iterator[bytes]:
    if isinstance(value, np.ndarray):
        yield f"{value.dtype}{value.shape}".encode()
        yield value.tobytes()
    elif is_dataclass(value):
        for item in fields(value):
            yield from _bytes_of(getattr(value, item.name))
    elif isinstance(value, np.random.Generator):
        yield from _bytes_of(value.bit_generator.state)
    elif isinstance(value, dict):
        yield from _bytes_of(sorted(value.items()))
    elif isinstance(value, tuple | list):
        for item in value:
            yield from _bytes_of(item)
    else:
        yield f"{value!r};".encode()


def save_part(path: Path, part: DrawnPart, sweeps: KeptSweeps, **figures: float) -> None:
    """Write a part and what was felt of it; the file appears whole or not at all.

    Args:
        path: file to write.
        part: the part, with a photograph of one light.
        sweeps: its sweeps.
        figures: further attributes of the file, such as the seconds that drawing took.
    """
    with replacing(path) as temporary, h5py.File(temporary, "w") as file:
        file.attrs.update(part.facts | figures)
        arrays: dict[str, NDArray[Any]] = {"surface": part.height_map.z_mm, "photo": part.photo.pixels}
        if part.soil_layer is not None:
            arrays |= {f"soil/{name}": getattr(part.soil_layer, name) for name in SOIL_ARRAYS}
        for digest, felt in sweeps.felt.items():
            arrays |= {f"felt/{digest}/{k}": np.asarray(array) for k, array in enumerate(felt)}
        for name, array in arrays.items():
            file.create_dataset(name, data=array, chunks=array.shape, compression=4, shuffle=True)
        file["surface"].attrs["pitch_mm"] = part.height_map.pitch_mm
        places = {"pitch_mm": part.photo.pitch_mm, "centre_mm": part.photo.centre_mm}
        file["photo"].attrs.update({name: value for name, value in places.items() if value is not None})


def load_part(path: Path) -> tuple[DrawnPart, KeptSweeps]:
    """Read a part and what was felt of it."""
    with h5py.File(path, "r") as file:
        facts = {f.name: _plain(file.attrs[f.name]) for f in fields(DrawnPart)[:8]}
        photo = dict(file["photo"].attrs)
        centre = photo.get("centre_mm")
        part = DrawnPart(
            **facts,
            height_map=HeightMap(file["surface"][()], float(file["surface"].attrs["pitch_mm"])),
            photo=Photo(
                file["photo"][()],
                pitch_mm=float(photo["pitch_mm"]) if "pitch_mm" in photo else None,
                centre_mm=None if centre is None else (float(centre[0]), float(centre[1])),
            ),
            soil_layer=Soil(*(file[f"soil/{name}"][()] for name in SOIL_ARRAYS)) if "soil" in file else None,
        )
        felt = {
            digest: (group["0"][()], group["1"][()], group["2"][()])
            for digest, group in file.get("felt", {}).items()
        }
    return part, KeptSweeps(felt)


def unread_parts(
    drawn: Path, out: Path, *, first: int = 0, step: int = 1, hours: float = 2.0
) -> Iterator[tuple[Path, Path]]:
    """The file of each drawn part that has none in a folder of readings, and the name of its reading there.

    Several runs may share the folders: each takes the parts from `first` on at a distance of `step`. No part is begun
    after `hours`.
    """
    out.mkdir(parents=True, exist_ok=True)
    end = time.monotonic() + 3600.0 * hours
    for source in sorted(drawn.glob("[0-9]*.h5")):
        number, target = int(source.stem), out / f"{source.stem}.pkl"
        if number < first or (number - first) % step or target.exists():
            continue
        if time.monotonic() > end:
            return
        yield source, target


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value
