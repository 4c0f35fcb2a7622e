"""Names of parts: 26 characters that sort by time, in the form of a ULID.

01KAKQ4Y6R 4T2M9XJ3V8QWZC5D
milliseconds 80 random bits; within one millisecond the previous name plus 1
"""

from __future__ import annotations

import re
import secrets
import threading
import time

_DIGITS = "0123456789ABCDEFGHJKMNPQRSTVWXYZ"
_LENGTH = 26
_RANDOM_BITS = 80
_FORM = re.compile(r"[0-7][0-9A-HJKMNP-TV-Z]{25}")

_lock = threading.Lock()
_last = 0


def new_part_id() -> str:
    """New unique name, greater than every name this process has made before."""
    global _last
    drawn = (time.time_ns() // 1_000_000) << _RANDOM_BITS | secrets.randbits(_RANDOM_BITS)
    with _lock:
        # also if the clock was set back
        same_millisecond = drawn >> _RANDOM_BITS <= _last >> _RANDOM_BITS
        _last = _last + 1 if same_millisecond else drawn
        number = _last
    return "".join(_DIGITS[number >> 5 * k & 31] for k in reversed(range(_LENGTH)))


def is_part_id(text: str) -> bool:
    """Whether a text has the form of a part's name."""
    return _FORM.fullmatch(text) is not None
