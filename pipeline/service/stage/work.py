"""The stage and the camera of the service, each with its own thread.

* A real stage feels one part at a time; a simulated one works in the workers, as many at once as there are.
* A driver that hangs is refused from then on, until it answers again; `trouble` says so.
"""

from __future__ import annotations

import asyncio
import contextlib
import shutil
from collections.abc import AsyncIterator
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.common.records import EvidenceKind
from pipeline.service.stage.devices import Camera, ScanOrder, SimulatedStage, Stage, has_sessions
from pipeline.service.stage.driver import DriverThread, StageDownError, StageLink
from pipeline.service.web.uploads import Upload
from whisker_array.scan.stage_error import StageError

if TYPE_CHECKING:
    from whisker_array.scan.session import SessionStage

_PLANS = 2.0
"""Durations of a whole plan that are added to the time limit of a stage."""


class StageWork:
    """The stage at work.

    Attributes:
        there: there is a stage.
        thread: thread that its driver is called in; knows its faults.
        by_pass: it feels parts pass by pass; else it scans the whole plan.
    """

    def __init__(self, stage: Stage | SessionStage[ScanOrder] | None, *, timeout_s: float = 60.0) -> None:
        """Take the driver.

        Args:
            stage: the driver; None: scans are sent to the service.
            timeout_s: timeout for one call of a real stage; a whole plan may take its own time beside.
        """
        self._stage, self.there = stage, stage is not None
        self.by_pass = stage is not None and has_sessions(stage)
        self.thread = DriverThread("stage", timeout_s=timeout_s)
        self._one_at_a_time = asyncio.Lock()

    @contextlib.asynccontextmanager
    async def for_worker(self) -> AsyncIterator[SessionStage[ScanOrder]]:
        """Lend the stage to a worker.

        Raises:
            StageDownError: it does not answer.
        """
        if self._stage is None or not has_sessions(self._stage):
            raise TypeError("the stage has no sessions")
        if isinstance(self._stage, SimulatedStage):
            yield self._stage
            return
        async with self._one_at_a_time:
            if self.thread.trouble:  # known before a worker is asked
                raise StageDownError(self.thread.trouble, "see that the stage and its driver work")
            link = StageLink(self._stage, self.thread)
            try:
                yield link.stage
            except StageError:
                if link.down is not None:
                    raise link.down from None
                raise
            finally:
                await link.close()

    async def scan(self, order: ScanOrder, folder: Path) -> Path:
        """Record the whole plan into a folder.

        Raises:
            StageDownError: the stage does not answer, or its driver has a fault.
            StageError: it cannot be recorded.
        """
        stage = self._stage
        if stage is None or has_sessions(stage):
            raise StageError("this service drives no stage that scans", "send a scan of the part instead")
        feel = stage.feel  # type: ignore[union-attr]

        def scanned() -> Path:
            path: Path = feel(order, folder)
            # a recording that the driver has written elsewhere stays there, and is copied
            return (
                path if path.parent == folder else Path(shutil.copyfile(path, folder / f"felt{path.suffix}"))
            )

        async with self._one_at_a_time:
            timeout_s = self.thread.timeout_s + _PLANS * order.plan.seconds
            return await self.thread.call_async(scanned, timeout_s=timeout_s)


class CameraWork:
    """The camera at work; `thread`: the thread of its driver."""

    def __init__(self, camera: Camera | None, *, timeout_s: float = 30.0) -> None:
        """Take the driver; None: photographs are sent to the service. `timeout_s`: for one call."""
        self._camera = camera
        self.thread = DriverThread("camera", timeout_s=timeout_s)

    async def take(self, name: str, folder: Path) -> list[Upload]:
        """Photograph the part of that name, and copy the photographs into the folder.

        Raises:
            StageDownError: the camera does not answer, or its driver has a fault.
            StageError: there is no photograph.
            OSError: one cannot be read.
        """

        camera = self._camera
        if camera is None:
            raise StageError("this service has no camera", "send a photograph of the part instead")

        def photograph() -> list[Upload]:
            made = camera.take(name)
            photos = []
            for n, file in enumerate((made,) if isinstance(made, Path) else made, start=1):
                copy = shutil.copyfile(file, folder / f"taken-{n}{file.suffix.lower()}")
                photos.append(Upload(copy, file.name, EvidenceKind.PHOTO))
            return photos

        return await self.thread.call_async(photograph)
