"""The stage and the camera at work for the service, each in a thread of its own.

part that waits for touch --> StageWork.feel  --> readings, recording      (pass by pass, or the whole plan)
name of a part            --> CameraWork.take --> photographs in a folder

* A real stage feels one part at a time; a simulated one works in the workers, as many at once as there are.
* A driver that hangs is refused from then on, until it answers again; `trouble` says so.
"""

from __future__ import annotations

import asyncio
import shutil
from collections.abc import Awaitable, Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.common.records import EvidenceRecord, PartRecord
from pipeline.reading.part_orders import Done
from pipeline.service.stage.devices import Camera, NoStage, ScanOrder, SimulatedStage, Stage, has_sessions
from pipeline.service.stage.driver_thread import DriverThread, StageDownError
from pipeline.service.stage.stage_link import StageLink
from pipeline.service.web.uploads import Upload
from whisker_array.scan.stage_error import StageError

if TYPE_CHECKING:
    from pipeline.service.reading_orders import ReadingOrders
    from whisker_array.scan.session import SessionStage

Felt = tuple[Done, list[EvidenceRecord]]
_PLANS = 2.0
"""Times that a plan's own seconds may be gone over before its stage is taken to hang."""


class StageWork:
    """Has the stage feel parts."""

    def __init__(
        self, stage: Stage, orders: ReadingOrders, *, active: bool = False, timeout_s: float = 60.0
    ) -> None:
        """Take what it works with.

        Args:
            stage: the driver.
            orders: who has files read and keeps them.
            active: feel parts pass by pass, by a stage with sessions; else every part is scanned by its whole plan.
            timeout_s: for one call of a real stage; a whole plan may take its own time beside.
        """
        self._stage, self._orders, self._active = stage, orders, active
        self._thread = DriverThread("stage", timeout_s=timeout_s)
        self._one_at_a_time = asyncio.Lock()

    @property
    def there(self) -> bool:
        """Whether there is a stage."""
        return not isinstance(self._stage, NoStage)

    @property
    def trouble(self) -> str:
        """What is wrong with the stage now, in words; empty where nothing is."""
        return self._thread.trouble

    async def feel(self, part: PartRecord, *, expected: str, earlier_photos: tuple[Path, ...]) -> Felt:
        """Feel a part and read it; keep the recording and what was made of it.

        Args:
            part: with its plan.
            expected: text that it should read.
            earlier_photos: of the part.

        Raises:
            StageDownError: the stage does not answer, or its driver has a fault.
            StageError: it could not be felt.
            Problem: as `ReadingOrders.read`.
        """
        if part.plan is None:
            raise ValueError(f"the part {part.id} has no plan of what to feel")
        order = ScanOrder(part_name=part.name, plan=part.plan)
        orders, stage = self._orders, self._stage
        if self._active and has_sessions(stage):
            felt = partial(
                orders.feel,
                order=order,
                expected=expected,
                database=part.database,
                job_name=part.job,
                earlier_photos=earlier_photos,
            )
            # a simulated stage works in the worker, a real one here
            return await (felt(stage) if isinstance(stage, SimulatedStage) else self._linked(stage, felt))
        with orders.work_folder() as folder:
            path = await self._scanned(order, folder)
            return await orders.read(
                (),
                Upload(path, path.name),
                name=part.name,
                expected=expected,
                database=part.database,
                job_name=part.job,
                earlier_photos=earlier_photos,
            )

    async def _linked(
        self, stage: SessionStage[ScanOrder], felt: Callable[[SessionStage[ScanOrder]], Awaitable[Felt]]
    ) -> Felt:
        async with self._one_at_a_time:
            if self.trouble:  # known before a worker is asked
                raise StageDownError(self.trouble, "see that the stage and its driver work")
            link = StageLink(stage, self._thread)
            try:
                return await felt(link.stage)
            except StageError:
                if link.down is not None:
                    raise link.down from None
                raise
            finally:
                await link.close()

    async def _scanned(self, order: ScanOrder, folder: Path) -> Path:
        """The recording of the whole plan."""
        scan = partial(self._stage.feel, order, folder)
        if isinstance(self._stage, SimulatedStage):
            return await self._orders.in_worker(self._stage.feel, order, folder)
        async with self._one_at_a_time:
            timeout_s = self._thread.timeout_s + _PLANS * order.plan.seconds
            return await self._thread.called(scan, timeout_s=timeout_s)


class CameraWork:
    """Has the camera photograph parts."""

    def __init__(self, camera: Camera, *, timeout_s: float = 30.0) -> None:
        """Take what it works with.

        Args:
            camera: the driver.
            timeout_s: for one call.
        """
        self._camera = camera
        self._thread = DriverThread("camera", timeout_s=timeout_s)

    @property
    def trouble(self) -> str:
        """What is wrong with the camera now, in words; empty where nothing is."""
        return self._thread.trouble

    async def take(self, name: str, folder: Path) -> list[Upload]:
        """Photograph the part of that name, and copy the photographs into the folder.

        Raises:
            StageDownError: the camera does not answer, or its driver has a fault.
            StageError: there is no photograph.
            OSError: one cannot be read.
        """

        def taken() -> list[Upload]:
            made = self._camera.take(name)
            files = (made,) if isinstance(made, Path) else tuple(made)
            photos = [
                Upload(folder / f"taken-{n}{file.suffix.lower()}", file.name)
                for n, file in enumerate(files, start=1)
            ]
            for file, photo in zip(files, photos, strict=True):
                shutil.copyfile(file, photo.path)
            return photos

        return await self._thread.called(taken)
