"""The stage and the camera that the settings name; a driver of an integrator is found by its name.

driver = "press_hall.stage:open_stage"        open_stage() returns an object with `open`, `feel` or both
                                              (`pipeline.service.stage`)
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from glyphs.errors import FileError
from glyphs.named import load_named
from pipeline.common.settings import SettingsError
from pipeline.service.stage.devices import Camera, FolderCamera, ScanOrder, SimulatedStage, Stage

if TYPE_CHECKING:
    from pipeline.service.settings import CameraSettings, StageSettings
    from whisker_array.scan.session import SessionStage


def stage_of(settings: StageSettings) -> Stage | SessionStage[ScanOrder] | None:
    """The stage of the service; None if it has none.

    Raises:
        FileError: no such folder, or an unusable bench file.
        SettingsError: no such driver.
    """
    if settings.driver:
        stage: Stage = load_driver(settings.driver, verbs=("open", "feel"))
        return stage
    if settings.bench is not None:
        from pipeline.bench.settings import read_bench
        from pipeline.service.stage.bench_stage import BenchStage

        return BenchStage(read_bench(settings.bench))
    return None if settings.folder is None else SimulatedStage(_there(settings.folder, "height maps"))


def camera_of(settings: CameraSettings) -> Camera | None:
    """The camera of the service; None if it has none.

    Raises:
        FileError: no such folder.
        SettingsError: no such driver.
    """
    if settings.driver:
        camera: Camera = load_driver(settings.driver, verbs=("take",))
        return camera
    return None if settings.folder is None else FolderCamera(_there(settings.folder, "photographs"))


def load_driver(named: str, *, verbs: Sequence[str]) -> Any:
    """Call the callable of that name for a driver.

    Args:
        named: module and callable, "module:callable"; called without arguments.
        verbs: methods of which the driver must have one: open, feel, take.

    Raises:
        SettingsError: no such module or callable, or a driver without any of the methods.
    """
    made = load_named(named, what="driver", error=SettingsError)()
    if not any(callable(getattr(made, verb, None)) for verb in verbs):
        wanted = " or ".join(map(repr, verbs))
        raise SettingsError(f"what {named!r} gives has no method {wanted}", hint="see pipeline.service.stage")
    return made


def _there(folder: Path, what: str) -> Path:
    if not folder.is_dir():
        raise FileError(folder, "is no folder", f"name the folder of the parts' {what}, or make it first")
    return folder
