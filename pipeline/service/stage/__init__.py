"""The stage and the camera: drivers and their calls. A driver of an integrator's own is a `Stage`, a `SessionStage` or
a `Camera`; all it is given is a `ScanOrder`."""

from __future__ import annotations

from pipeline.service.stage.devices import (
    Camera,
    FolderCamera,
    ScanOrder,
    SimulatedStage,
    Stage,
    has_sessions,
)
from whisker_array.scan.stage_error import StageError

__all__ = [
    "Camera",
    "FolderCamera",
    "ScanOrder",
    "SimulatedStage",
    "Stage",
    "StageError",
    "has_sessions",
]
