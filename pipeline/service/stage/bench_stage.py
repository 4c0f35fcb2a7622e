"""A bench of iron as the service's stage: opened with the first part, homed when it must be, lifted after each."""

from __future__ import annotations

from pipeline.bench.bench import Bench
from pipeline.bench.settings import BenchSettings
from pipeline.reading.framed_session import FramedSession
from pipeline.service.stage.devices import ScanOrder


class BenchStage:
    """A `SessionStage` over a bench."""

    def __init__(self, settings: BenchSettings) -> None:
        """Take the settings; nothing is opened before there is a part."""
        self._settings = settings
        self._bench: Bench | None = None

    def open(self, order: ScanOrder) -> FramedSession:
        """The part under the comb, in the frame of the order's region.

        The camera's axis meets the plate at `camera_mm` (default: the middle of the field).

        Raises:
            StageError: the bench cannot be opened or homed, or the region is off its field.
        """
        plate = self._settings.plate
        frame = order.frame(plate.field_mm, camera_mm=plate.camera_mm)
        if self._bench is not None and self._bench.stage.lost:
            self._bench.close()  # a port that was pulled out opens anew
            self._bench = None
        if self._bench is None:
            self._bench = Bench(self._settings)
        return FramedSession(self._bench.session(order.part_name), **frame)
