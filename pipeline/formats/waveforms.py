"""TDMS waveforms whose channels begin at different times, or were sampled at different rates, on one clock."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import DataError
from pipeline.formats.traces_file import Column

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Wave:
    """Clock of a channel.

    Attributes:
        step_s: from sample to sample.
        offset_s: of the first sample after `start_ns`.
        start_ns: nanoseconds since 1970; 0 where the file does not say.
    """

    step_s: float
    offset_s: float = 0.0
    start_ns: int = 0

    def begins_after_s(self, other: Wave) -> float:
        """How much later than another this channel begins."""
        return (self.start_ns - other.start_ns) * 1e-9 + self.offset_s - other.offset_s


def wave_of(properties: Mapping[str, Any]) -> Wave | None:
    """The clock in the properties of a channel; None without an increment."""
    increment = float(properties.get("wf_increment") or 0.0)
    if not increment > 0.0:
        return None
    start = properties.get("wf_start_time")
    start_ns = 0 if start is None else int(np.datetime64(start, "ns").astype(np.int64))
    return Wave(increment, float(properties.get("wf_start_offset") or 0.0), start_ns)


def laid_together(
    columns: Mapping[Column, Floats], waves: Mapping[Column, Wave], states: Collection[Column]
) -> dict[Column, Floats]:
    """Channels on the samples of the first one, over the stretch that all of them cover.

    Args:
        columns: of each channel.
        waves: their clocks.
        states: channels that hold a value until it changes; the others are joined by straight lines.

    Raises:
        DataError: a channel without a clock, or none at the same time as the others.
    """
    bare = next((name for name in columns if name not in waves), None)
    if bare is not None:
        raise DataError(
            f"has channels that begin at different times, and channel {bare!r} without wf_increment",
            "record all channels as waveforms, or together",
        )
    first = waves[next(iter(columns))]
    starts = {name: wave.begins_after_s(first) for name, wave in waves.items() if name in columns}
    ends = {name: starts[name] + (columns[name].size - 1) * waves[name].step_s for name in columns}
    tolerance = 1e-6 * first.step_s
    begin, end = max(starts.values()) - tolerance, min(ends.values()) + tolerance
    k = np.arange(int(np.ceil(begin / first.step_s)), int(np.floor(end / first.step_s)) + 1)
    if k.size < 2:
        late, early = max(starts, key=lambda name: starts[name]), min(ends, key=lambda name: ends[name])
        raise DataError(
            f"has channel {late!r} begin {starts[late] - ends[early]:.3f} s after channel {early!r} ends",
            "record all channels at the same time",
        )
    made: dict[Column, Floats] = {}
    for name, values in columns.items():
        at = (k * first.step_s - starts[name]) / waves[name].step_s
        if name in states:
            made[name] = values[np.clip(np.floor(at + 1e-3).astype(np.intp), 0, values.size - 1)]
        else:
            made[name] = np.interp(at, np.arange(values.size), values)
    return made
