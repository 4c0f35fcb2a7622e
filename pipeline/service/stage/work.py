"""The stage and the camera of the service, each with its own thread. A real stage feels one part at a time; a simulated
one works in the workers. A driver that hangs is refused until it answers again."""

from __future__ import annotations

import asyncio
import contextlib
import math
import shutil
import time
from collections import deque
from collections.abc import AsyncIterator, Awaitable, Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.common.file_stamp import FileStamp, picture_key, stamp_of
from pipeline.common.records import EvidenceKind
from pipeline.formats.kinds import is_cut_short
from pipeline.formats.part_files import set_of
from pipeline.service.stage.devices import (
    Camera,
    FolderCamera,
    ScanOrder,
    SimulatedStage,
    Stage,
    has_sessions,
)
from pipeline.service.stage.driver import DriverThread, StageDownError, StageLink
from pipeline.service.web.uploads import Upload
from whisker_array.scan.stage_error import StageError

if TYPE_CHECKING:
    from whisker_array.scan.session import SessionStage

_HINT = "put the part back and release it"
# durations of a whole plan that are added to the time limit of a stage
_PLANS = 2.0
# seconds between looks for a picture in the camera's folder
_LOOK_S = 0.1
# seconds for which a picture, or a set of them, must stand unchanged: a set may get another light
_STILL_S, _SET_STILL_S = 0.3, 2.0


async def _stays() -> bool:
    return False


@dataclass(frozen=True)
class TouchCall:
    """A call, until a monotonic time, during which a part lies under the whiskers unless its caller has gone."""

    until_s: float = math.inf
    has_gone: Callable[[], Awaitable[bool]] = _stays


NO_LIMIT = TouchCall()


class StageWork:
    """The stage at work, `by_pass` or the whole plan; `timeout_s` is for one call, beside the plan's own time."""

    def __init__(self, stage: Stage | SessionStage[ScanOrder] | None, *, timeout_s: float = 60.0) -> None:
        self._stage, self.there = stage, stage is not None
        self.by_pass = stage is not None and has_sessions(stage)
        self.knows_place = callable(getattr(stage, "is_in_place", None))
        self.thread = DriverThread("stage", timeout_s=timeout_s)
        self._one_at_a_time = asyncio.Lock()

    @contextlib.asynccontextmanager
    async def for_worker(self, part_name: str, call: TouchCall) -> AsyncIterator[SessionStage[ScanOrder]]:
        """Lend the stage to a worker during a call. Raises StageDownError: no answer. StageError: no such part."""
        if self._stage is None or not has_sessions(self._stage):
            raise TypeError("the stage has no sessions")
        if isinstance(self._stage, SimulatedStage):
            yield self._stage
            await self._check_place(part_name, call)
            return
        async with self._one_at_a_time:
            await self._check_begin(part_name, call)
            if self.thread.trouble:  # known before a worker is asked
                raise StageDownError(self.thread.trouble, "see that the stage and its driver work")
            link = StageLink(self._stage, self.thread)
            try:
                yield link.stage
                await self._check_place(part_name, call)
            except StageError:
                if link.down is not None:
                    raise link.down from None
                raise
            finally:
                await link.close()

    async def scan(self, order: ScanOrder, folder: Path, call: TouchCall) -> Path:
        """Record the whole plan into a folder. Raises StageDownError, StageError: as in `for_worker`, or it fails."""
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
            await self._check_begin(order.part_name, call)
            timeout_s = self.thread.timeout_s + _PLANS * order.plan.seconds
            path = await self.thread.call_async(scanned, timeout_s=timeout_s)
            await self._check_place(order.part_name, call)
            return path

    async def _check_begin(self, part_name: str, call: TouchCall) -> None:
        if await call.has_gone():
            raise StageError(f"{part_name} may no longer lie under the whiskers: its caller has gone", _HINT)
        await self._check_place(part_name, call)

    async def _check_place(self, part_name: str, call: TouchCall) -> None:
        if time.monotonic() > call.until_s:
            raise StageError(
                f"{part_name} may no longer lie under the whiskers: the time of its trigger is over", _HINT
            )
        is_in_place = getattr(self._stage, "is_in_place", None)
        if is_in_place is not None and not await self.thread.call_async(partial(is_in_place, part_name)):
            raise StageError(
                f"the stage's driver says that {part_name} does not lie under the whiskers", _HINT
            )


@dataclass(frozen=True)
class CameraPictures:
    """Copies of the camera's pictures, and keys of the originals, from which no other part may be read."""

    photos: list[Upload]
    keys: tuple[str, ...] = ()


class CameraWork:
    """The camera at work, if there is one; `timeout_s` is for the photographs of a part."""

    def __init__(self, camera: Camera | FolderCamera | None, *, timeout_s: float = 30.0) -> None:
        self._camera, self._timeout_s = camera, timeout_s
        self.thread = DriverThread("camera", timeout_s=timeout_s)
        # keys of the latest pictures taken, of which the store may not know yet
        self._taken_keys: deque[str] = deque(maxlen=1000)

    async def take(
        self, name: str, folder: Path, *, known: Callable[[Iterable[str]], Collection[str]]
    ) -> CameraPictures:
        """Photograph the part of that name, and copy the photographs into the folder. `known` finds keys of pictures
        that already belong to a part. Raises StageDownError: no answer. StageError: no photograph. OSError."""
        camera = self._camera
        if camera is None:
            raise StageError("this service has no camera", "send a photograph of the part instead")
        if isinstance(camera, FolderCamera):
            return await self._wait_for_pictures(camera, name, folder, known)

        def photograph() -> CameraPictures:
            files = camera.take(name)
            return CameraPictures(_copies((files,) if isinstance(files, Path) else files, folder))

        return await self.thread.call_async(photograph)

    async def _wait_for_pictures(
        self,
        camera: FolderCamera,
        name: str,
        folder: Path,
        known: Callable[[Iterable[str]], Collection[str]],
    ) -> CameraPictures:
        look = partial(camera.pictures, name)
        began_s, earliest_ns = time.monotonic(), time.time_ns() - round(1e9 * camera.early_s)
        before = await self.thread.call_async(look)
        old = {path: stamp for path, stamp in before.items() if not camera.early_s or stamp[1] < earliest_ns}
        latest, since_s = dict[Path, FileStamp](), began_s
        while True:
            look_s = time.monotonic()
            pictures = await self.thread.call_async(look)
            new = {path: stamp for path, stamp in pictures.items() if old.get(path) != stamp}
            keys = {picture_key(str(path), stamp): path for path, stamp in new.items()}
            used = {*(await asyncio.to_thread(known, keys) if keys else ()), *self._taken_keys}
            new = {path: new[path] for key, path in keys.items() if key not in used}
            if new and not set_of(next(iter(new)).name):
                new = dict([next(iter(new.items()))])
            now_s = time.monotonic()
            if new != latest:
                latest, since_s = new, now_s
            late = now_s - began_s >= self._timeout_s
            still = now_s - since_s >= (_SET_STILL_S if any(set_of(path.name) for path in new) else _STILL_S)
            if new and (late or still):
                new_keys = tuple(picture_key(str(path), stamp) for path, stamp in new.items())
                self._taken_keys.extend(new_keys)
                photos = await self.thread.call_async(partial(_copies_if_whole, new, folder, as_is=late))
                if photos is not None:
                    return CameraPictures(photos, new_keys)
                for key in new_keys:
                    self._taken_keys.remove(key)
            elif late:
                raise camera.missing(name, older=bool(pictures), waited_s=self._timeout_s)
            await asyncio.sleep(max(_LOOK_S, now_s - look_s))


def _copies_if_whole(pictures: Mapping[Path, FileStamp], folder: Path, *, as_is: bool) -> list[Upload] | None:
    if not as_is and any(map(is_cut_short, pictures)):
        return None
    photos = _copies(pictures, folder)
    return (
        photos if as_is or all(stamp_of(path.stat()) == stamp for path, stamp in pictures.items()) else None
    )


def _copies(files: Iterable[Path], folder: Path) -> list[Upload]:
    return [
        Upload(
            shutil.copyfile(file, folder / f"taken-{n}{file.suffix.lower()}"), file.name, EvidenceKind.PHOTO
        )
        for n, file in enumerate(files, start=1)
    ]
