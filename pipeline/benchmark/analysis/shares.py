"""How sure a share is whose trials belong together: whole parts drawn again."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from pipeline.common.shares import CONFIDENCE_LEVEL

RESAMPLES = 2000
_SEED = 20240229


@lru_cache(maxsize=4)
def drawn_parts(parts: int) -> NDArray[np.float64]:
    """(RESAMPLES, parts) how often each part comes when as many are drawn again, with putting back."""
    rng = np.random.default_rng(_SEED)
    drawn = rng.multinomial(parts, np.full(parts, 1.0 / parts), size=RESAMPLES).astype(np.float64)
    drawn.flags.writeable = False
    return drawn


def resampled(right: Sequence[int], total: Sequence[int]) -> tuple[float, float]:
    """95 % interval of a share of characters, whole parts drawn again (percentile bootstrap).

    Characters of one part share its dirt, so that they are not independent. Where every part is alike nothing
    varies and the interval has no width; Wilson's then tells more.

    Args:
        right: (parts,) characters right.
        total: (parts,) characters.
    """
    k, n = np.asarray(right, dtype=np.float64), np.asarray(total, dtype=np.float64)
    if k.size == 0 or n.sum() == 0.0:
        return (0.0, 1.0)
    drawn = drawn_parts(k.size)
    chars = drawn @ n
    shares = (drawn @ k) / np.where(chars > 0.0, chars, 1.0)
    tail = 50.0 * (1.0 - CONFIDENCE_LEVEL)
    low, high = np.percentile(shares[chars > 0.0], [tail, 100.0 - tail])
    return (float(low), float(high))
