"""The whisker stage and the camera of the service: an integrator's, a bench, or simulated ones.

    open(order) -> session;  feel(pass) ...;  close()          `SessionStage`: pass by pass until the serial is sure
    feel(order, into) -> recording                             `Stage`: one scan of the whole plan
    device = "press_hall.stage:open_stage"                     open_stage() returns an object with `open` or `feel`

A stage is given the region in the photograph's frame, and what lies under the middle of the photograph. It knows where
its camera's axis meets the plate, and hands the recording back in the frame of the order, so that the scan lies over
the photograph. A session speaks that frame too: its field is the order's region, as far as the part reaches.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeGuard

from glyphs.errors import FileError, MarksError
from glyphs.named import load_named
from pipeline.common.file_stamp import FileStamp, stamp_of
from pipeline.common.reading_records import ScanPlanRecord
from pipeline.common.settings import ReadSettings, SettingsError
from pipeline.formats.kinds import PHOTO_SUFFIXES
from pipeline.formats.part_files import set_of
from whisker_array.scan.stage_error import StageError

if TYPE_CHECKING:
    from pipeline.bench.bench import Bench
    from pipeline.bench.settings import BenchSettings
    from pipeline.service.settings import CameraSettings, StageSettings
    from whisker_array.scan.session import SessionStage, StageSession

_MAP_SUFFIXES = (".npz", ".x3p", ".sdf")
# bytes of a part's name as a file's, which has 255 with its suffix
_LONGEST_NAME = 240
_DRIVER = re.compile(r"[A-Za-z_][\w.]+:\w+")  # no drive of Windows: C:parts
# minimum extent of a region on the plate in either direction, character heights
_LEAST_HEIGHTS = 1.0


@dataclass(frozen=True)
class ScanOrder:
    """Order to a stage to scan a part; the plan has region, directions and pitches."""

    part_name: str
    plan: ScanPlanRecord

    def frame(
        self, field_mm: tuple[float, float, float, float], *, camera_mm: tuple[float, float] | None = None
    ) -> dict[str, Any]:
        """Frame of a session for the order, as `FramedSession` takes it. `field_mm` is (x0, y0, x1, y1) of the stage on
        the plate, `camera_mm` the camera's axis there (default: its middle). Raises StageError: off the field."""
        import numpy as np

        ends = np.reshape(field_mm, (2, 2))
        axis, middle = ends.mean(axis=0) if camera_mm is None else camera_mm, self.plan.middle_mm
        shift = np.zeros(2) if middle is None else np.subtract(axis, middle)
        low = np.maximum(ends[0] - shift, self.plan.region_mm[:2])
        high = np.minimum(ends[1] - shift, self.plan.region_mm[2:])
        if (high - low).min() < _LEAST_HEIGHTS * self.plan.height_mm:
            width, height = ends[1] - ends[0]
            what = f"the region {self.plan.region_mm} mm is not on the field of {width:.1f} x {height:.1f} mm"
            raise StageError(
                what, "check where the camera stands over the stage: camera_mm and field_mm of a bench"
            )
        field = tuple(float(v) for v in (*low, *high))
        return {"x_mm": float(shift[0]), "y_mm": float(shift[1]), "field_mm": field}


class Stage(Protocol):
    """Move the whiskers over a part.

    A stage may also have `is_in_place(part_name: str) -> bool`, asked before and after a part is felt: with it a part
    that could not be felt is tried again as long as it lies there; without it a person gets the part.
    """

    def feel(self, order: ScanOrder, into: Path) -> Path:
        """Feel the part; return the recording (.h5), in the frame of the order's region. Raises StageError."""


def has_sessions(stage: Stage | SessionStage[ScanOrder]) -> TypeGuard[SessionStage[ScanOrder]]:
    """Whether a stage feels pass by pass: it has `open(order)`."""
    return callable(getattr(stage, "open", None))


class Camera(Protocol):
    """Take photographs of parts."""

    def take(self, part_name: str) -> Path | Sequence[Path]:
        """Photograph the part under the camera, once or under several lights. Raises StageError: no photograph."""


@dataclass(frozen=True)
class FolderCamera:
    """A folder of a camera's photographs, named as parts; they may be older than the trigger by `early_s`."""

    folder: Path
    early_s: float = 0.0

    def pictures(self, part_name: str) -> dict[Path, FileStamp]:
        """The part's photographs now, one named as the part before a set. Raises StageError: an impossible name."""
        return {path: stamp_of(path.stat()) for path in _files_of(self.folder, part_name, PHOTO_SUFFIXES)}

    def missing(self, part_name: str, *, older: bool, waited_s: float) -> StageError:
        """The error if no new photograph has come in time; `older`: there is one from before the trigger."""
        return _no_file(
            self.folder,
            part_name,
            PHOTO_SUFFIXES,
            f"{'new ' if older else ''}photograph",
            when=f" after {waited_s:g} s",
            hint="for a camera that is triggered before the service, set camera.early_s" if older else "",
        )


@dataclass(frozen=True)
class SimulatedStage:
    """Feel height maps of a folder, named as the parts, with the virtual array and its `seed`; .npz with its soil."""

    folder: Path
    reading: ReadSettings = field(default_factory=ReadSettings)
    seed: int = 0

    def open(self, order: ScanOrder) -> StageSession:
        """Mount the part's height map, its middle under the camera's axis. Raises StageError: it cannot be scanned."""
        from pipeline.formats.touch_file import read_part_map
        from pipeline.reading.readers import virtual_array
        from pipeline.reading.scan_plan import FramedSession
        from recognition.see.virtual_bench import VirtualBench

        maps = _files_of(self.folder, order.part_name, _MAP_SUFFIXES)
        if not maps:
            raise _no_file(self.folder, order.part_name, _MAP_SUFFIXES, "height map")
        path = maps[0]
        try:
            top = read_part_map(path)
            height_map = top.height_map
            frame = order.frame((0.0, 0.0, *height_map.size_mm))
            bench = VirtualBench(
                height_map,
                order.plan.height_mm,
                replace(virtual_array(self.reading), seed=self.seed),
                soil=top.soil,
                part_id=order.part_name,
            )
            session = bench.mounted().open_session()
        except FileError as problem:
            raise StageError(f"{problem.path.name} {problem.what}", problem.hint) from problem
        except StageError:
            raise
        except MarksError as error:
            hint = error.hint or "check the plan and the map"
            raise StageError(f"{path.name} cannot be scanned: {error.what}", hint) from error
        return FramedSession(session, **frame)


class BenchStage:
    """A real bench: opened with the first part, homed if needed, lifted after each part."""

    def __init__(self, settings: BenchSettings) -> None:
        self._settings = settings
        self._bench: Bench | None = None

    def open(self, order: ScanOrder) -> StageSession:
        """The part under the comb, in the frame of the order's region; the camera's axis meets the plate at
        `camera_mm`. Raises StageError: the bench cannot be opened or homed, or the region is off its field."""
        from pipeline.bench.bench import Bench
        from pipeline.reading.scan_plan import FramedSession

        plate = self._settings.plate
        frame = order.frame(plate.field_mm, camera_mm=plate.camera_mm)
        if self._bench is not None and self._bench.stage.lost:
            self._bench.close()  # a port that was pulled out opens anew
            self._bench = None
        if self._bench is None:
            self._bench = Bench(self._settings)
        return FramedSession(self._bench.session(order.part_name), **frame)


def stage_of(settings: StageSettings, reading: ReadSettings) -> Stage | SessionStage[ScanOrder] | None:
    """The stage of the service, if any. Raises FileError, SettingsError: no such folder, bench file or driver."""
    if not settings.device:
        return None
    if is_driver(settings.device):
        stage: Stage = load_driver(settings.device, verbs=("open", "feel"))
        return stage
    path = Path(settings.device)
    if path.suffix == ".toml" or (path.exists() and not path.is_dir()):
        from pipeline.bench.settings import read_bench

        return BenchStage(read_bench(path))
    return SimulatedStage(_there(path, "height maps"), reading)


def camera_of(settings: CameraSettings) -> Camera | FolderCamera | None:
    """The camera of the service; None if it has none. Raises FileError, SettingsError: no such folder or driver."""
    if not settings.device:
        return None
    if is_driver(settings.device):
        camera: Camera = load_driver(settings.device, verbs=("take",))
        return camera
    return FolderCamera(_there(Path(settings.device), "photographs"), settings.early_s)


def is_driver(device: str) -> bool:
    """Whether the setting of a device names a driver, module:callable, and no file or folder."""
    return _DRIVER.fullmatch(device) is not None


def load_driver(named: str, *, verbs: Sequence[str]) -> Any:
    """Call "module:callable" for a driver with one of the methods `verbs`. Raises SettingsError: there is none."""
    driver = load_named(named, what="driver", error=SettingsError)()
    if not any(callable(getattr(driver, verb, None)) for verb in verbs):
        wanted = " or ".join(map(repr, verbs))
        raise SettingsError(
            f"the driver of {named!r} has no method {wanted}", hint="see pipeline.service.stage"
        )
    return driver


def _there(folder: Path, what: str) -> Path:
    if not folder.is_dir():
        raise FileError(folder, "is no folder", f"name the folder of the parts' {what}, or make it first")
    return folder


def _files_of(folder: Path, part_name: str, suffixes: Sequence[str]) -> Sequence[Path]:
    """The part's files in the folder, those of its set last. Raises StageError: the name cannot be a file's here."""
    if not part_name:
        raise StageError("the part has no name", "give the name of its file without the ending")
    plain = part_name.isprintable() and len(part_name.encode()) <= _LONGEST_NAME
    if not plain or part_name.startswith(".") or any(c in part_name for c in "/\\:"):
        raise StageError(
            f"{part_name[:40]!r} is not a name of a part on this stage", "name it without folders"
        )
    root = folder.resolve()
    files = (
        p for p in root.glob("*") if part_name in (p.stem, set_of(p.name)) and p.suffix.lower() in suffixes
    )
    by_rank = sorted(files, key=lambda p: (bool(set_of(p.name)), suffixes.index(p.suffix.lower()), p.name))
    # a link may lead out of the folder
    return [p for p in by_rank if p.is_file() and p.resolve().is_relative_to(root)]


def _no_file(
    folder: Path, part_name: str, suffixes: Sequence[str], what: str, *, when: str = "", hint: str = ""
) -> StageError:
    suffix = Path(part_name).suffix
    if suffix.lower() in suffixes:
        hint = f"name the part without {suffix}"
    hint = hint or f"put it there as {part_name}{suffixes[0]}"
    return StageError(f"there is no {what} of {part_name} in the folder {folder.resolve().name}{when}", hint)
