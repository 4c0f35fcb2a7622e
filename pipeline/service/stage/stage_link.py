"""Link a real stage to a worker: the driver stays in the service's process, passes go through a connection.

    worker: reader --pass--> LinkedStage <== connection ==> StageLink: the driver's session --> whiskers

The driver's session is closed when the worker has done, has failed, or is gone.
"""

from __future__ import annotations

import asyncio
import contextlib
import secrets
import threading
from collections.abc import Callable
from functools import partial
from multiprocessing.connection import Client, Connection, Listener
from operator import attrgetter
from typing import TYPE_CHECKING, Any

from pipeline.service.stage.devices import ScanOrder
from pipeline.service.stage.driver_thread import StageDownError
from whisker_array.scan.stage_error import StageError

if TYPE_CHECKING:
    from pipeline.service.stage.driver_thread import DriverThread
    from whisker_array.scan.session import Fitting, SessionStage, StageSession
    from whisker_array.scan.sweep import Sweep
    from whisker_array.whisker.passes import Pass

_LOST = (EOFError, OSError)
_LOOK_S = 0.02


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
