"""Callers by address: those of named networks, and the user of a program on this machine (Linux, by its sockets)."""

from __future__ import annotations

import ipaddress
import os
import sys
from pathlib import Path

_PROC = Path("/proc/net")
# a socket whose program has closed it has no user any more
_ESTABLISHED = "01"
# columns of the table
_LOCAL, _REMOTE, _STATE, _UID = 1, 2, 3, 7


Networks = tuple[ipaddress.IPv4Network | ipaddress.IPv6Network, ...]


def is_in(address: str, networks: Networks) -> bool:
    """Whether an address is in one of the networks; never where it is no address."""
    try:
        found = ipaddress.ip_address(address)
    except ValueError:
        return False
    found = getattr(found, "ipv4_mapped", None) or found
    return any(found in network for network in networks)


def is_own_user(client: tuple[str, int], server: tuple[str, int]) -> bool:
    """Whether a connection comes from a program of the user that runs this one.

    True where that cannot be determined: on systems other than Linux, and for callers without a socket.

    Args:
        client: address and port of the caller.
        server: address and port that it has called.
    """
    uid = user_of(client, server)
    return uid is None or uid == os.geteuid()


def user_of(client: tuple[str, int], server: tuple[str, int]) -> int | None:
    """User id of the program at the client's end; -1 where no open socket of this machine is there, None where that
    cannot be seen."""
    if sys.platform != "linux":
        return None
    try:
        address = ipaddress.ip_address(client[0])
        table = (_PROC / ("tcp" if address.version == 4 else "tcp6")).read_text(encoding="ascii")
        wanted = (_in_hex(*client[:2]), _in_hex(*server[:2]), _ESTABLISHED)
    except (OSError, ValueError):
        return None
    for line in table.splitlines()[1:]:
        row = line.split()
        if (row[_LOCAL], row[_REMOTE], row[_STATE]) == wanted:
            return int(row[_UID])
    return -1


def _in_hex(host: str, port: int) -> str:
    """An address as the table has it: words of 32 bits in the machine's byte order."""
    packed = ipaddress.ip_address(host).packed
    words = (packed[k : k + 4] for k in range(0, len(packed), 4))
    shown = "".join(f"{int.from_bytes(word, sys.byteorder):08X}" for word in words)
    return f"{shown}:{port:04X}"
