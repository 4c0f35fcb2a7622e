"""Divide the rows of a map among threads."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numba


def in_threads(work: Callable[[int, int], None], rows: int) -> None:
    """Call work(first, last), which releases the GIL, for ranges that cover all rows, one for each numba thread."""
    count = max(min(numba.get_num_threads(), rows), 1)
    ends = [rows * i // count for i in range(count + 1)]
    with ThreadPoolExecutor(count) as pool:
        list(pool.map(work, ends[:-1], ends[1:]))
