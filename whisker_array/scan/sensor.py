"""Sensor chain: from the moment at each whisker's base to the recorded number.

    moment --x (1 + vibration)--x gain--+ offset--+ drift--+ noise--ADC--> raw

`calibration` inverts the chain. Creep and hysteresis of gauges, 1 to 3 % of a load, are left out: what is read did not
change with them (docs/notes/sensors.md). The axis of whiskers is the last but one, the axis of samples the last.
Moments are in N mm; all random draws use the given rng.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Annotated, Self

import numpy as np
from numpy.typing import NDArray

from glyphs.errors import MarksError
from glyphs.ranges import (
    NotNegative,
    Range,
    Validated,
    freeze_arrays,
    require_not_negative,
    require_positive,
    require_range,
)
from glyphs.surface.display import OneLine
from whisker_array.arrays import Floats, Mask


class Sensors(StrEnum):
    """Sensors and stage of a simulated array."""

    REAL = "real"
    IDEAL = "ideal"


class SensorError(MarksError):
    """A sensor chain, signal or lead-in that cannot be used."""


@dataclass(frozen=True, eq=False, repr=False)
class Gauges(OneLine, Validated, error=SensorError):
    """Gain (n,) and offset (n,), N mm, of an array's gauges; raises SensorError."""

    gain: Floats
    offset_n_mm: Floats

    def __post_init__(self) -> None:
        super().__post_init__()
        freeze_arrays(SensorError, self, {"gain": ("whiskers",), "offset_n_mm": ("whiskers",)})
        if not self.gain.size:
            raise SensorError("there is no gain", hint="give one for each whisker")
        if (self.gain == 0.0).any():
            dead = int(np.argmin(np.abs(self.gain)))
            raise SensorError(f"whisker {dead} has a gain of 0: it is dead", hint="leave it out")

    @property
    def n_whiskers(self) -> int:
        return int(self.gain.size)

    def of(self, whiskers: Sequence[int]) -> Self:
        chosen = list(whiskers)
        return replace(self, gain=self.gain[chosen], offset_n_mm=self.offset_n_mm[chosen])


@dataclass(frozen=True, eq=False, repr=False)
class SensorChain(Gauges):
    """Gauge, amplifier and converter of every whisker; they share the base, and so its vibration."""

    noise_n_mm: NotNegative = 0.0
    drift_n_mm_per_sqrt_s: NotNegative = 0.0
    vibration: NotNegative = 0.0
    adc_range_n_mm: float = math.inf
    adc_bits: Annotated[int, Range(2, 32)] | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.adc_bits is not None or self.adc_range_n_mm != math.inf:
            require_positive(SensorError, adc_range_n_mm=self.adc_range_n_mm)

    @property
    def adc_step_n_mm(self) -> float:
        """One count of the converter, N mm; 0 without a converter."""
        return 0.0 if self.adc_bits is None else 2.0 * self.adc_range_n_mm / 2.0**self.adc_bits


def draw_sensor_chain(
    n_whiskers: int,
    *,
    rng: np.random.Generator,
    full_scale_n_mm: float = 20.0,
    gain_sd: float = 0.03,
    offset_sd: float = 0.01,
    vibration: float = 0.002,
    adc_bits: int | None = 16,
    noise: float = 2e-4,
    drift_a_minute: float = 3e-3,
) -> SensorChain:
    """Draw a typical chain; whiskers differ slightly. Raises SensorError.

    A full scale, N mm, of three times the land moment leaves room for enhancement. The rms noise of a sample and the
    rms drift of the zero in a minute are shares of full scale (the largest load); both were measured on whiskers.
    """
    require_range(SensorError, Range(0.0, 0.33, "beyond 0.33 a gain could be 0"), gain_sd=gain_sd)
    require_positive(SensorError, full_scale_n_mm=full_scale_n_mm)
    require_not_negative(SensorError, offset_sd=offset_sd)
    return SensorChain(
        gain=1.0 + gain_sd * np.clip(rng.standard_normal(n_whiskers), -3.0, 3.0),
        offset_n_mm=offset_sd * full_scale_n_mm * rng.standard_normal(n_whiskers),
        noise_n_mm=noise * full_scale_n_mm,
        drift_n_mm_per_sqrt_s=drift_a_minute / math.sqrt(60.0) * full_scale_n_mm,
        vibration=vibration,
        adc_range_n_mm=full_scale_n_mm if adc_bits is not None else math.inf,
        adc_bits=adc_bits,
    )


def check_signal(name: str, signal: NDArray[np.floating], n_whiskers: int) -> None:
    """Check the number of whiskers of a signal. Raises SensorError: the number of whiskers differs."""
    if signal.ndim < 2 or signal.shape[-2] != n_whiskers:
        raise SensorError(
            f"{name} has shape {signal.shape}", hint=f"it must be (..., {n_whiskers} whiskers, samples)"
        )


def convert(signal_n_mm: NDArray[np.float32], chain: SensorChain) -> tuple[NDArray[np.float32], Mask]:
    """Convert a signal, float32: round to the nearest count and clip to the range; and where it was clipped."""
    if chain.adc_bits is None:
        return signal_n_mm, np.zeros(signal_n_mm.shape, dtype=np.bool_)
    step, half = chain.adc_step_n_mm, 2.0 ** (chain.adc_bits - 1)
    exact: type[np.floating] = np.float64 if chain.adc_bits > 20 else np.float32
    counts = signal_n_mm.astype(exact)
    counts *= exact(1.0 / step)
    np.rint(counts, out=counts)
    saturated = (counts < -half) | (counts > half - 1.0)
    np.clip(counts, -half, half - 1.0, out=counts)
    counts *= exact(step)
    return counts.astype(np.float32, copy=False), saturated


def measure(
    moment_n_mm: NDArray[np.floating],
    *,
    chain: SensorChain,
    sample_rate_hz: float,
    rng: np.random.Generator,
    drift_n_mm: Floats | None = None,
    pause_s: float = 0.0,
) -> tuple[NDArray[np.float32], Mask]:
    """Measure true moments (..., whiskers, samples), N mm, with a sensor chain; NaN (no contact) stays NaN.

    `drift_n_mm` (whiskers,), the zeros before the first sample, is updated; `pause_s` in air precedes each pass.
    Returns raw (float32, N mm as if gain were 1) and where it was clipped (bool). Raises SensorError.
    """
    moment = np.asarray(moment_n_mm)
    check_signal("moment_n_mm", moment, chain.n_whiskers)
    require_positive(SensorError, sample_rate_hz=sample_rate_hz)
    n, samples = moment.shape[-2:]
    passes = moment.reshape(-1, n, samples).astype(np.float32)
    drift = np.zeros(n) if drift_n_mm is None else drift_n_mm
    raw = passes * (1.0 + _noise(rng, chain.vibration, (len(passes), 1, samples)))
    raw *= chain.gain.astype(np.float32)[:, None]
    raw += chain.offset_n_mm.astype(np.float32)[:, None]
    raw += _noise(rng, chain.noise_n_mm, raw.shape)
    if chain.drift_n_mm_per_sqrt_s > 0.0 and samples:
        # the zero of each whisker walks from pass to pass, and along a straight line within each: what a walk departs
        # from it within a second is below the noise of a sample
        seconds = samples / sample_rate_hz
        paused, during = (
            _noise(rng, chain.drift_n_mm_per_sqrt_s * math.sqrt(t), raw.shape[:2]) for t in (pause_s, seconds)
        )
        after = drift + np.cumsum(paused + during, axis=0, dtype=np.float64)
        raw += (after - during).astype(np.float32)[..., None]
        raw += during[..., None] * np.linspace(0.0, 1.0, samples, dtype=np.float32)
        drift[:] = after[-1]
    raw, saturated = convert(raw, chain)
    return raw.reshape(moment.shape), saturated.reshape(moment.shape)


def _noise(rng: np.random.Generator, rms: float, shape: tuple[int, ...]) -> NDArray[np.float32]:
    if rms == 0.0:
        return np.zeros(shape, dtype=np.float32)
    noise = rng.standard_normal(shape, dtype=np.float32)
    noise *= np.float32(rms)
    return noise
