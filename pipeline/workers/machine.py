"""Limits of a service that follow from the machine: memory of a worker, sizes of files, number of waiting parts."""

from __future__ import annotations

import os
from dataclasses import dataclass, field

from glyphs.surface.maps import MAX_PIXELS
from pipeline.common.settings import Limits

# parts that may wait for each worker; a part takes a second or two, so the last one waits for about a minute
WAITING_PER_WORKER = 32
# memory that a worker may use on any machine, MB; the largest map takes most of it
LEAST_WORKER_MB = 4096
# memory of a worker for each pixel of a photograph and each sample of a height map, bytes: 4096 MB are enough
# for 40 million pixels or 30 million samples
_PIXEL_BYTES, _SAMPLE_BYTES = 100, 136
LEAST_UPLOAD = 100_000_000
# memory of a worker for each byte of a request: 4096 MB are enough for 100 MB
_MEMORY_OF_UPLOAD = 40


@dataclass(frozen=True)
class Machine:
    """Limits of a service on one machine: memory of a worker (0: no limit), waiting parts, sizes of files."""

    worker_memory_mb: int = LEAST_WORKER_MB
    waiting_parts: int = 2 * WAITING_PER_WORKER
    files: Limits = field(default_factory=Limits)
    upload_bytes: int = LEAST_UPLOAD

    @classmethod
    def of(cls, workers: int, memory_mb: int | None = None) -> Machine:
        """The limits for so many workers on this machine, each with `memory_mb` (0: no limit; default: its share)."""
        share_mb = max(LEAST_WORKER_MB, memory_share_mb(workers))
        size = 1_000_000 * (memory_mb or share_mb)
        files = Limits(min(size // _PIXEL_BYTES, MAX_PIXELS), min(size // _SAMPLE_BYTES, MAX_PIXELS))
        return cls(
            share_mb if memory_mb is None else memory_mb,
            WAITING_PER_WORKER * workers,
            files,
            max(LEAST_UPLOAD, size // _MEMORY_OF_UPLOAD),
        )


def memory_share_mb(workers: int) -> int:
    """A worker's share of the machine's memory, in MB; 0 if unknown."""
    try:
        total = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, OSError, ValueError):
        return 0
    return max(1024, int(0.9 * total / (1 << 20) / max(1, workers)))
