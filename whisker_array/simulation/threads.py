"""Divide the rows of a map among threads."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

import numba


def in_threads(work: Callable[[int, int], None], rows: int) -> None:
    """Call work(first, last), which releases the GIL, for ranges that cover all rows, one for each numba thread."""
    count = max(min(numba.get_num_threads(), rows), 1)
    if count == 1:
        work(0, rows)
        return
    ends = [rows * i // count for i in range(count + 1)]
    with ThreadPoolExecutor(count - 1) as others:
        begun = [others.submit(work, *stretch) for stretch in pairwise(ends[1:])]
        work(*ends[:2])
        for future in begun:
            future.result()
