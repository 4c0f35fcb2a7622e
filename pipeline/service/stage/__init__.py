"""The stage and the camera: a driver of an integrator's own is a `Stage`, `SessionStage` or `Camera`."""

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
