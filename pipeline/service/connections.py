"""Limits of connections that HTTP, TCP and OPC UA share, and a log that callers cannot flood."""

from __future__ import annotations

import asyncio
import errno
import ipaddress
import logging
import time
from collections import Counter
from collections.abc import Collection
from typing import Any, TypeVar

from glyphs.plain_text import visible

# seconds between two lines of the log of one kind
LOG_EVERY_S = 10.0
# seconds within which a caller must read an answer
WRITE_S = 30.0
# connections that the system holds until they are accepted; asyncio logs as many errors for each failed accept
BACKLOG = 256
# maximum number of kinds that are remembered: callers may invent addresses
_MOST_KINDS = 1000
# open files and connections that the process allows itself, if the system does
_DESCRIPTORS = 8192
MOST_CONNECTIONS = 1000
_NO_ROOM = (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM)
_log = logging.getLogger(__name__)


class SparingLog(logging.Handler):
    """Log a message of each kind once in a while, without its traceback."""

    def __init__(self, port: str) -> None:
        super().__init__(logging.ERROR)
        self._port = port
        self._last_s: dict[str, float] = {}

    def emit(self, record: logging.LogRecord) -> None:
        error = record.exc_info[1] if record.exc_info else None
        why = f": {type(error).__name__}: {error}" if error is not None else ""
        self.say(f"{record.name}:{record.lineno}", f"{record.getMessage()}{why}")

    def say(self, kind: str, message: str) -> None:
        now = time.monotonic()
        if now - self._last_s.get(kind, -LOG_EVERY_S) < LOG_EVERY_S:
            return
        if len(self._last_s) >= _MOST_KINDS:
            self._last_s.clear()
        self._last_s[kind] = now
        _log.warning("%s: %s", self._port, visible(message[:300]))


class Peer:
    """The other end of an open connection; `address` is empty if it has gone, `block` is its `address_block`."""

    transport: Any
    address = block = ""
    heard_s = 0.0  # of its last bytes, by the monotonic clock

    def identify(self, transport: asyncio.BaseTransport | asyncio.StreamWriter) -> None:
        self.address = str((transport.get_extra_info("peername") or ("",))[0])
        self.block, self.heard_s = address_block(self.address), time.monotonic()


C = TypeVar("C", bound=Peer)


def address_block(address: str) -> str:
    """The addresses that one caller has: an IPv4 address, or the /64 network of an IPv6 address."""
    try:
        parsed = ipaddress.ip_address(address.partition("%")[0])
    except ValueError:
        return address
    if isinstance(parsed, ipaddress.IPv4Address):
        return str(parsed)
    mapped = parsed.ipv4_mapped
    return str(mapped or ipaddress.ip_network((parsed, 64), strict=False))


def longest_idle_of_busiest(connections: Collection[C]) -> C:
    """The connection to close if there is no room: the longest idle one of the caller with the most."""
    counts = Counter(connection.block for connection in connections)
    return min(connections, key=lambda connection: (-counts[connection.block], connection.heard_s))


def most_connections() -> int:
    """Number of connections that the service may hold; files, workers and the store need half of the descriptors."""
    return min(MOST_CONNECTIONS, raise_descriptor_limit() // 2)


def connections_of_address(most: int) -> int:
    """Number of connections that one address may have: a fifth of all."""
    return max(1, most // 5)


def raise_descriptor_limit() -> int:
    """Raise the soft limit of open files and connections towards the hard one; return the limit."""
    try:
        import resource
    except ImportError:  # Windows has no such limit
        return _DESCRIPTORS
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = _DESCRIPTORS if hard == resource.RLIM_INFINITY else min(_DESCRIPTORS, hard)
    if soft != resource.RLIM_INFINITY and soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))
    return wanted


def log_failed_accepts_sparingly() -> None:
    """Have the running loop log connections that the system has no room for once in a while, without tracebacks."""
    log = SparingLog("connections")

    def handle(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        error = context.get("exception")
        if isinstance(error, OSError) and error.errno in _NO_ROOM and "socket" in context:
            log.say(
                "accept", f"no connection can be accepted ({error.strerror}); raise the limit (ulimit -n)"
            )
        else:
            loop.default_exception_handler(context)

    asyncio.get_running_loop().set_exception_handler(handle)
