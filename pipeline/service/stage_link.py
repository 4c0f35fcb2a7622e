"""A real stage and the worker that reads: the driver stays in the service's process, passes go through a connection.

    worker: reader --pass--> LinkedSession <== connection ==> StageLink: the driver's session --> whiskers

The driver's session is closed when the worker has done, has failed, or is gone.
"""

from __future__ import annotations

import contextlib
import secrets
import threading
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Client, Connection, Listener
from typing import TYPE_CHECKING, Any

import structlog

from pipeline.service.stage import ScanOrder
from whisker_array.scan.stage_error import StageError

if TYPE_CHECKING:
    from whisker_array.scan.felt_sweep import Sweep
    from whisker_array.scan.session import Fitting, SessionStage, StageSession
    from whisker_array.whisker.passes import Pass

_LOST = (EOFError, OSError)
log = structlog.get_logger("tactile-marks")


@dataclass(frozen=True)
class LinkedStage:
    """The stage as a worker has it; it opens one session.

    Attributes:
        address: of the connection.
        key: that the service knows its worker by.
    """

    address: Any
    key: bytes

    def open(self, order: ScanOrder) -> StageSession:
        """Have the service's driver open a session.

        Raises:
            StageError: it cannot.
        """
        connection = Client(self.address, authkey=self.key)
        try:
            return LinkedSession(connection, order)
        except StageError:
            connection.close()
            raise


class LinkedSession:
    """The driver's session as a worker has it.

    Attributes:
        fitting: as the driver says.
    """

    def __init__(self, connection: Connection, order: ScanOrder) -> None:
        """Open it."""
        self._connection = connection
        self.fitting: Fitting = self._asked(order)

    def feel(self, order: Pass) -> Sweep:
        """Feel one pass.

        Raises:
            StageError: it could not be felt.
        """
        sweep: Sweep = self._asked(order)
        return sweep

    def close(self) -> None:
        """Let the service close the driver's session."""
        self._connection.close()

    def _asked(self, question: Any) -> Any:
        try:
            self._connection.send(question)
            answer = self._connection.recv()
        except _LOST as error:
            raise StageError("the service has let the stage go", "feel the part again") from error
        if isinstance(answer, StageError):
            raise answer
        return answer


class StageLink:
    """The service's end: serves one session of a driver to one worker.

    Attributes:
        stage: for the worker.
    """

    def __init__(self, stage: SessionStage[ScanOrder]) -> None:
        """Wait for the worker, in a thread."""
        key = secrets.token_bytes(32)
        self._listener = Listener(authkey=key)
        self.stage = LinkedStage(self._listener.address, key)
        self._thread = threading.Thread(target=self._serve, args=(stage,), name="stage", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Wait until the driver's session is closed."""
        if self._thread.is_alive():
            # a worker that never came is still waited for: a stranger's call, which is refused, ends that
            with contextlib.suppress(*_LOST):
                Client(self.stage.address).close()
        self._thread.join()
        self._listener.close()

    def _serve(self, stage: SessionStage[ScanOrder]) -> None:
        from multiprocessing import AuthenticationError

        try:
            connection = self._listener.accept()
        except (*_LOST, AuthenticationError):
            return
        session = None
        with connection, contextlib.suppress(*_LOST):
            try:
                session = _answered(connection, stage.open, _fitting)
                while session is not None:
                    _answered(connection, session.feel)
            finally:
                if session is not None:
                    _closed(session)


def _fitting(session: StageSession) -> Fitting:
    return session.fitting


def _answered(
    connection: Connection, work: Callable[[Any], Any], shown: Callable[[Any], Any] = lambda made: made
) -> Any:
    """What comes of the next question, None of one that fails; the worker is sent the error, or what is shown of it."""
    question, made = connection.recv(), None
    try:
        made = work(question)
        answer = shown(made)
    except StageError as error:
        answer = error
    except Exception as error:
        log.exception("fault of the stage's driver")
        said = f"the stage's driver has a fault ({type(error).__name__}: {error})"
        answer = StageError(said, "the service's log has more of it")
    connection.send(answer)
    return made


def _closed(session: StageSession) -> None:
    try:
        session.close()
    except Exception:
        log.exception("fault of the stage's driver", at="close")
