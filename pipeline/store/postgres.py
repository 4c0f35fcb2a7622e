"""Connections to PostgreSQL with a time limit, also for a frozen server that keeps its sockets open.

statement --sent--> answered                     as without a limit
                    silent for SILENT_S          the connection is closed: OperationalError

A commit that had been sent may still be carried out: the caller asks again with its idempotency key.
"""

from __future__ import annotations

import time
from collections.abc import Generator
from typing import TYPE_CHECKING, Any, TypeVar

import psycopg

if TYPE_CHECKING:
    from psycopg.abc import PQGen
    from psycopg.waiting import Ready, Wait

# longest wait for a sign of life, s: longer than for a lock, which the server itself limits
SILENT_S = 30.0
# a lock that is never released must not block requests for ever
LOCK_S = 20.0
# limits for a connection whose other end has vanished: in seconds, the last in milliseconds
PATIENCE = {"connect_timeout": 10, "keepalives_idle": 30, "tcp_user_timeout": 30_000}
# an answer means that it is on the disk, whatever the server's default
_SETTINGS = (
    "SET TIME ZONE 'UTC'",
    "SELECT set_config('synchronous_commit', 'on', false) WHERE current_setting('synchronous_commit') = 'off'",
    f"SELECT set_config('lock_timeout', '{LOCK_S:g}s', false) WHERE current_setting('lock_timeout') = '0'",
)
T = TypeVar("T")


class PatientConnection(psycopg.Connection[tuple[Any, ...]]):
    """A connection that is closed when the server has been silent for `silent_s`; None: as long as it takes."""

    silent_s: float | None = None

    def wait(self, gen: PQGen[T], *arguments: Any, **options: Any) -> T:
        """Carry out a conversation. Raises psycopg.OperationalError: the server is silent; the connection is closed."""
        bounded = gen if self.silent_s is None else self._end_if_silent(gen, self.silent_s)
        return super().wait(bounded, *arguments, **options)

    def _end_if_silent(self, gen: PQGen[T], silent_s: float) -> Generator[Wait, Ready | int, T]:
        heard_s = time.monotonic()
        try:
            wanted = next(gen)
            while True:
                ready = yield wanted  # without waiting, several times a second
                if ready:
                    heard_s = time.monotonic()
                elif time.monotonic() - heard_s > silent_s:
                    self.close()
                    raise psycopg.OperationalError(f"the server has been silent for {silent_s:g} s")
                wanted = gen.send(ready)
        except StopIteration as done:
            answer: T = done.value
            return answer


def connect(*arguments: Any, **options: Any) -> PatientConnection:
    """Connect, with the settings of a store."""
    connection = PatientConnection.connect(*arguments, **options)
    connection.silent_s = SILENT_S
    for setting in _SETTINGS:
        connection.execute(setting)
    connection.commit()
    return connection
