"""Limits of a service that follow from the machine: memory of a worker, sizes of files, number of waiting parts."""

from __future__ import annotations

import contextlib
import os
from dataclasses import dataclass, field
from pathlib import Path

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
    """Limits of a service on one machine: memory of a worker, waiting parts, sizes of files."""

    worker_memory_mb: int = LEAST_WORKER_MB
    waiting_parts: int = 2 * WAITING_PER_WORKER
    files: Limits = field(default_factory=Limits)
    upload_bytes: int = LEAST_UPLOAD

    @classmethod
    def of(cls, workers: int) -> Machine:
        memory_mb = max(LEAST_WORKER_MB, memory_share_mb(workers))
        size = 1_000_000 * memory_mb
        files = Limits(min(size // _PIXEL_BYTES, MAX_PIXELS), min(size // _SAMPLE_BYTES, MAX_PIXELS))
        upload = max(LEAST_UPLOAD, size // _MEMORY_OF_UPLOAD)
        return cls(memory_mb, WAITING_PER_WORKER * workers, files, upload)


def memory_share_mb(workers: int) -> int:
    """A worker's share of the memory of the machine, or of its container or unit, in MB; 0 if unknown."""
    try:
        total = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, OSError, ValueError):
        return 0
    share_mb = max(1024, _share_mb(total, workers))
    group = group_limit()
    return share_mb if group is None else min(share_mb, max(LEAST_WORKER_MB, _share_mb(group, workers)))


def _share_mb(total: int, workers: int) -> int:
    return int(0.9 * total / (1 << 20) / max(1, workers))


def group_limit(
    process: Path = Path("/proc/self/cgroup"), groups: Path = Path("/sys/fs/cgroup")
) -> int | None:
    """Memory limit of a container or unit in bytes (Linux, cgroup v2), the least of its groups; None if it has none."""
    try:
        group = process.read_text(encoding="ascii").partition("0::/")[2].strip()
    except OSError:
        return None
    limits = []
    for folder in (groups / group, *(groups / group).parents):
        if folder.is_relative_to(groups):
            # no file in the root group, and "max" for no limit
            with contextlib.suppress(OSError, ValueError):
                limits.append(int((folder / "memory.max").read_text(encoding="ascii")))
    return min(limits, default=None)
