"""The stage and the camera of the service, each with its own thread, and the link of a real stage to a worker.

    worker: reader --pass--> LinkedStage <== connection ==> StageLink: the driver's session --> whiskers

* A real stage feels one part at a time; a simulated one works in the workers, as many at once as there are.
* A driver that hangs is refused from then on, until it answers again; `trouble` says so.
* The driver of a real stage stays in the service's process; its session is closed when the worker has done, has failed,
  or is gone.
"""

from __future__ import annotations

import asyncio
import contextlib
import secrets
import shutil
import threading
from collections.abc import AsyncIterator, Callable
from functools import partial
from multiprocessing.connection import Client, Connection, Listener
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.common.records import EvidenceKind
from pipeline.service.stage.devices import Camera, ScanOrder, SimulatedStage, Stage, has_sessions
from pipeline.service.stage.driver_thread import DriverThread, StageDownError
from pipeline.service.web.uploads import Upload
from whisker_array.scan.stage_error import StageError

if TYPE_CHECKING:
    from pipeline.service.stage.driver_thread import DriverThread
    from whisker_array.scan.session import Fitting, SessionStage, StageSession
    from whisker_array.scan.sweep import Sweep
    from whisker_array.whisker.passes import Pass

_LOST = (EOFError, OSError)
_LOOK_S = 0.02
_PLANS = 2.0
"""Times a plan's own duration after which its stage is taken to hang."""


class LinkedStage:
    """The stage in a worker, with the one session that it opens.

    Attributes:
        address: address of the connection.
        fitting: fitting reported by the driver, once it is open.
    """

    fitting: Fitting
    _connection: Connection

    def __init__(self, address: Any, key: bytes) -> None:
        """Set the address, and the key by which the service recognises its worker."""
        self.address, self._key = address, key

    def open(self, order: ScanOrder) -> StageSession:
        """Have the service's driver open a session.

        Raises:
            StageError: it cannot.
        """
        self._connection = Client(self.address, authkey=self._key)
        try:
            self.fitting = self._answer(order)
        except StageError:
            self.close()
            raise
        return self

    def feel(self, order: Pass) -> Sweep:
        """Feel one pass.

        Raises:
            StageError: it could not be felt.
        """
        sweep: Sweep = self._answer(order)
        return sweep

    def close(self) -> None:
        """Let the service close the driver's session."""
        self._connection.close()

    def _answer(self, question: Any) -> Any:
        try:
            self._connection.send(question)
            answer = self._connection.recv()
        except _LOST as error:
            raise StageError("the service has released the stage", "feel the part again") from error
        if isinstance(answer, StageError):
            raise answer
        return answer


class StageLink:
    """The service's end: serve one session of a driver to one worker.

    Attributes:
        stage: stage for the worker.
        down: fault that kept the driver from answering; None if it has answered every call.
    """

    def __init__(self, stage: SessionStage[ScanOrder], thread: DriverThread) -> None:
        """Wait for the worker.

        Args:
            stage: the driver.
            thread: thread that it is called in.
        """
        key = secrets.token_bytes(32)
        self._driver = thread
        self.down: StageDownError | None = None
        self._listener = Listener(authkey=key)
        self.stage = LinkedStage(self._listener.address, key)
        self._serving = threading.Thread(target=self._serve, args=(stage,), name="stage-link", daemon=True)
        self._serving.start()

    async def close(self) -> None:
        """Wait until the driver's session is closed, or has not answered in time."""
        if self._serving.is_alive():
            # a worker that never came is still waited for: a stranger's call, which is refused, ends that
            with contextlib.suppress(*_LOST):
                Client(self.stage.address).close()
        while (
            self._serving.is_alive()
        ):  # not joined: the end of the service need not wait for a driver that hangs
            await asyncio.sleep(_LOOK_S)

    def _serve(self, stage: SessionStage[ScanOrder]) -> None:
        from multiprocessing import AuthenticationError

        with self._listener:
            try:
                connection = self._listener.accept()
            except (*_LOST, AuthenticationError):
                return
        session = None
        with connection, contextlib.suppress(*_LOST):
            try:
                session = self._answered(connection, stage.open, attrgetter("fitting"))
                while session is not None:
                    self._answered(connection, session.feel)
            finally:
                if session is not None:
                    with contextlib.suppress(StageError):  # the log has it
                        self._driver.call(session.close)

    def _answered(
        self,
        connection: Connection,
        work: Callable[[Any], Any],
        shown: Callable[[Any], Any] = lambda made: made,
    ) -> Any:
        """Answer the worker's next question, and return the result; None if it fails.

        The worker is sent the error, or `shown` of the result.
        """
        question, made = connection.recv(), None
        try:
            made = self._driver.call(partial(work, question))
            answer = shown(made)
        except StageError as error:
            answer = StageError(error.what, error.hint)
            self.down = error if isinstance(error, StageDownError) else self.down
        except OSError as error:
            answer = StageError(
                f"the stage cannot be used ({error.strerror or error})", "see that it is connected"
            )
        connection.send(answer)
        return made


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
            # a driver may have a recording elsewhere, which stays there
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
