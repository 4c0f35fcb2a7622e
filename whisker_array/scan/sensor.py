"""From the moment at each whisker's base to the number on the wire, and back.

    moment --x (1 + vibration)--hysteresis, creep--x gain--+ offset--+ drift--+ noise--ADC--> raw      (measure)
    raw    --- offset, / gain ---> moment in N mm                                            (apply_calibration)

One lead-in before each scan gives the calibration: the whiskers first hang in air (no moment), then run over
clean land (the moment that the whisker model expects)::

    raw |             ________________          raw_air  = offset
        |            /   land                   raw_land = offset + gain * expected land moment
        |  _air_____/
        +------------------------------> sample

Hysteresis and creep are those of `sensor_memory`. The axis of whiskers is the last but one, the axis of samples the
last. Moments are in N mm; all drawing is by the rng given.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from glyphs.errors import MarksError
from glyphs.surface.display import one_line
from whisker_array.scan.sensor_memory import SensorMemory, SensorState, draw_memory, lifted, reading_of

NOISE = 2e-4
"""Rms noise of one sample, of the largest load, as recorded of whiskers."""
DRIFT_A_MINUTE = 3e-3
"""How far the zero walks in a minute, rms, of the largest load, as recorded of whiskers."""
MIN_LEAD_IN_SAMPLES = 16
"""Fewest samples of air, and of land, from which a calibration is taken."""
MAX_GAIN_UNCERTAINTY = 0.01
"""Largest standard error of an estimated gain, as a share of it."""


class SensorError(MarksError):
    """A sensor chain, signal or lead-in that cannot be used."""


def _per_whisker(name: str, values: ArrayLike) -> NDArray[np.float64]:
    array = np.array(values, dtype=np.float64)
    if array.ndim != 1 or array.size == 0 or not np.isfinite(array).all():
        raise SensorError(f"{name} has shape {array.shape}", hint="it needs a finite number for each whisker")
    array.flags.writeable = False
    return array


def _same_length(gain: NDArray[np.float64], offset: NDArray[np.float64]) -> None:
    if gain.shape != offset.shape:
        raise SensorError(
            f"{gain.size} gains but {offset.size} offsets", hint="give one of each for every whisker"
        )
    if (gain == 0.0).any():
        raise SensorError(
            f"whisker {int(np.argmin(np.abs(gain)))} has a gain of 0: it is dead", hint="leave it out"
        )


def _not_negative(name: str, value: float) -> float:
    number = float(value)
    if not math.isfinite(number) or number < 0.0:
        raise SensorError(f"{name} is {value}", hint="it must be finite and not negative")
    return number


@dataclass(frozen=True, eq=False)
class SensorChain:
    """Gauge, amplifier and converter of every whisker of an array.

    Attributes:
        gain: (n,) float64, output per true moment, nominally 1.
        offset_n_mm: (n,) float64, output without a moment, N mm.
        noise_n_mm: rms of the white gauge and amplifier noise of one sample, N mm.
        drift_n_mm_per_sqrt_s: random walk of the zero, rms N mm after one second.
        vibration: rms of the base's mechanical vibration as a share of the preload; the same for all whiskers
            at one sample since they share the base.
        adc_range_n_mm: full scale to either side, N mm; inf with adc_bits None.
        adc_bits: resolution, 2 to 32 bits for the whole range from - to +; None: no conversion.
        memory: creep and hysteresis; None: gauges that know nothing of earlier loads.

    Raises:
        SensorError: arrays that do not agree, negative rms values, a gain of 0, a converter that cannot be.
    """

    gain: NDArray[np.float64]
    offset_n_mm: NDArray[np.float64]
    noise_n_mm: float = 0.0
    drift_n_mm_per_sqrt_s: float = 0.0
    vibration: float = 0.0
    adc_range_n_mm: float = math.inf
    adc_bits: int | None = None
    memory: SensorMemory | None = None

    __repr__ = one_line

    def __post_init__(self) -> None:
        gain, offset = _per_whisker("gain", self.gain), _per_whisker("offset_n_mm", self.offset_n_mm)
        _same_length(gain, offset)
        object.__setattr__(self, "gain", gain)
        object.__setattr__(self, "offset_n_mm", offset)
        if self.memory is not None and self.memory.creep.shape[0] != gain.size:
            raise SensorError(
                f"{gain.size} gains but a memory of {self.memory.creep.shape[0]} whiskers",
                hint="give one of each for every whisker",
            )
        for name in ("noise_n_mm", "drift_n_mm_per_sqrt_s", "vibration"):
            object.__setattr__(self, name, _not_negative(name, getattr(self, name)))
        if not self.adc_range_n_mm > 0.0:
            raise SensorError(f"adc_range_n_mm is {self.adc_range_n_mm}", hint="full scale must be positive")
        if self.adc_bits is not None:
            if not 2 <= self.adc_bits <= 32:
                raise SensorError(f"adc_bits is {self.adc_bits}", hint="it must be 2 to 32, or None")
            if math.isinf(self.adc_range_n_mm):
                raise SensorError(
                    "a converter needs a finite adc_range_n_mm", hint="give one, or adc_bits=None"
                )

    @property
    def n_whiskers(self) -> int:
        """Number of whiskers."""
        return int(self.gain.size)

    @property
    def adc_step_n_mm(self) -> float:
        """One count of the converter, N mm; 0 without one."""
        return 0.0 if self.adc_bits is None else 2.0 * self.adc_range_n_mm / 2.0**self.adc_bits

    def of(self, whiskers: Sequence[int]) -> SensorChain:
        """The chain of some of the whiskers."""
        chosen = list(whiskers)
        memory = None if self.memory is None else self.memory.of(chosen)
        return replace(self, gain=self.gain[chosen], offset_n_mm=self.offset_n_mm[chosen], memory=memory)

    def at_rest(self) -> SensorState:
        """Where its gauges stand when they have hung in air for long."""
        return SensorState.at_rest(self.n_whiskers, self.memory)

    @classmethod
    def ideal(cls, n_whiskers: int) -> SensorChain:
        """A chain that hands every moment on as it is: gain 1, no offset, noise, drift or converter."""
        _check_count(n_whiskers)
        return cls(np.ones(n_whiskers), np.zeros(n_whiskers))


def _check_count(n_whiskers: int) -> None:
    if n_whiskers < 1:
        raise SensorError(f"n_whiskers is {n_whiskers}", hint="an array has at least one")


def draw_sensor_chain(
    n_whiskers: int,
    *,
    rng: np.random.Generator,
    full_scale_n_mm: float = 20.0,
    gain_sd: float = 0.03,
    offset_sd_n_mm: float | None = None,
    noise_n_mm: float | None = None,
    drift_n_mm_per_sqrt_s: float | None = None,
    vibration: float = 0.002,
    adc_bits: int | None = 16,
    memory: bool = True,
) -> SensorChain:
    """A chain as it comes from the bench: every whisker a little different, by the generator.

    Args:
        n_whiskers: how many.
        rng: draws the gains and offsets.
        full_scale_n_mm: converter range to either side, N mm. About three times the land moment leaves room
            for enhancement (20 suits default_whisker(5.0) with 6.5 N mm). The defaults below scale with it.
        gain_sd: standard deviation of the gain about 1; draws are kept within 3.
        offset_sd_n_mm: standard deviation of the offset, N mm; None: 1 % of full scale.
        noise_n_mm: rms noise, N mm; None: `NOISE` of full scale, which is taken for the largest load.
        drift_n_mm_per_sqrt_s: random walk, N mm per root second; None: `DRIFT_A_MINUTE` of full scale.
        vibration: rms vibration of the base as a share of the preload.
        adc_bits: converter, None for none.
        memory: whether the gauges creep and lag, as `draw_memory` draws it.

    Raises:
        SensorError: anything that a SensorChain refuses, no whisker, or a gain_sd of 1/3 or more.
    """
    _check_count(n_whiskers)
    if not 0.0 <= gain_sd < 1.0 / 3.0:
        raise SensorError(f"gain_sd is {gain_sd}", hint="beyond 1/3 a whisker could have no gain at all")
    if not (math.isfinite(full_scale_n_mm) and full_scale_n_mm > 0.0):
        raise SensorError(f"full_scale_n_mm is {full_scale_n_mm}", hint="it must be positive")
    offset_sd = (
        0.01 * full_scale_n_mm if offset_sd_n_mm is None else _not_negative("offset_sd_n_mm", offset_sd_n_mm)
    )
    walk = DRIFT_A_MINUTE / math.sqrt(60.0) * full_scale_n_mm
    # of a generator of its own: the same seed gives the same gains, offsets and noise with memory and without
    remembering = rng.spawn(1)[0]
    return SensorChain(
        gain=1.0 + gain_sd * np.clip(rng.standard_normal(n_whiskers), -3.0, 3.0),
        offset_n_mm=offset_sd * rng.standard_normal(n_whiskers),
        noise_n_mm=NOISE * full_scale_n_mm if noise_n_mm is None else noise_n_mm,
        drift_n_mm_per_sqrt_s=walk if drift_n_mm_per_sqrt_s is None else drift_n_mm_per_sqrt_s,
        memory=draw_memory(n_whiskers, rng=remembering, largest_n_mm=full_scale_n_mm) if memory else None,
        vibration=vibration,
        adc_range_n_mm=full_scale_n_mm if adc_bits is not None else math.inf,
        adc_bits=adc_bits,
    )


def _check_signal(name: str, signal: NDArray[np.floating], n_whiskers: int) -> None:
    if signal.ndim < 2 or signal.shape[-2] != n_whiskers:
        raise SensorError(
            f"{name} has shape {signal.shape}", hint=f"it must be (..., {n_whiskers} whiskers, samples)"
        )


def convert(
    signal_n_mm: NDArray[np.float32], chain: SensorChain
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """The converter alone: round to the nearest count and clip to the range.

    Returns:
        The converted signal, float32, and where it was clipped, bool. NaN stays NaN and is not clipped.
    """
    if chain.adc_bits is None:
        return signal_n_mm, np.zeros(signal_n_mm.shape, dtype=np.bool_)
    step, half = chain.adc_step_n_mm, 2.0 ** (chain.adc_bits - 1)
    counts = np.rint(signal_n_mm.astype(np.float64) / step)
    saturated = (counts < -half) | (counts > half - 1.0)
    return (np.clip(counts, -half, half - 1.0) * step).astype(np.float32), saturated


def measure(
    moment_n_mm: NDArray[np.floating],
    *,
    chain: SensorChain,
    sample_rate_hz: float,
    rng: np.random.Generator,
    state: SensorState | None = None,
    pause_s: float = 0.0,
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """What the chain makes of the true moments.

    Args:
        moment_n_mm: (..., whiskers, samples), N mm, passes in the order in which they were run; NaN (no contact) stays
            NaN.
        chain: the sensor chain, as many whiskers.
        sample_rate_hz: samples per second: sets how far the zero drifts between two samples.
        rng: draws vibration, noise and drift; the same seed gives the same raw signal.
        state: where the gauges stand before, moved on; at rest unless given.
        pause_s: how long the whiskers hang in air before each pass, beside the samples given of it.

    Returns:
        raw (float32, same shape, N mm as if gain were 1) and saturated (bool, same shape): clipped
        by the converter.

    Raises:
        SensorError: a shape that does not fit the chain, a rate that is not positive.
    """
    moment = np.asarray(moment_n_mm)
    _check_signal("moment_n_mm", moment, chain.n_whiskers)
    if not (math.isfinite(sample_rate_hz) and sample_rate_hz > 0.0):
        raise SensorError(f"sample_rate_hz is {sample_rate_hz}", hint="it must be positive")
    n, samples = moment.shape[-2:]
    raw = np.empty((math.prod(moment.shape[:-2]), n, samples), dtype=np.float32)
    saturated = np.zeros(raw.shape, dtype=np.bool_)
    walk = chain.drift_n_mm_per_sqrt_s / math.sqrt(sample_rate_hz)
    state = chain.at_rest() if state is None else state
    passes = moment.reshape(raw.shape)
    for i in range(raw.shape[0]):
        shake = _noise(rng, chain.vibration, samples)
        load = passes[i].astype(np.float32) * (1.0 + shake)
        if chain.memory is not None:
            lifted(chain.memory, state, seconds=pause_s)
            held = reading_of(load, memory=chain.memory, state=state, step_s=1.0 / sample_rate_hz)
            load = held.astype(np.float32)
        if walk > 0.0 and pause_s > 0.0:
            state.drift_n_mm += _noise(rng, chain.drift_n_mm_per_sqrt_s * math.sqrt(pause_s), n)
        for w in range(n):
            trace = load[w] * np.float32(chain.gain[w]) + np.float32(chain.offset_n_mm[w])
            trace = trace + _noise(rng, chain.noise_n_mm, samples)
            if walk > 0.0:
                drift = state.drift_n_mm[w] + np.cumsum(_noise(rng, walk, samples), dtype=np.float64)
                state.drift_n_mm[w] = drift[-1]
                trace = trace + drift.astype(np.float32)
            raw[i, w], saturated[i, w] = convert(trace.astype(np.float32), chain)
    return raw.reshape(moment.shape), saturated.reshape(moment.shape)


def _noise(rng: np.random.Generator, rms: float, samples: int) -> NDArray[np.float32]:
    if rms == 0.0:
        return np.zeros(samples, dtype=np.float32)
    return rng.standard_normal(samples, dtype=np.float32) * np.float32(rms)


@dataclass(frozen=True, eq=False)
class Calibration:
    """Gain and offset of every whisker as estimated from a lead-in.

    Attributes:
        gain: (n,) float64, raw per moment, not 0.
        offset_n_mm: (n,) float64, raw without a moment, N mm.
        from_land: the gains were read off land at the nominal friction, so moments say nothing of the true one;
            otherwise they come from a bench.

    Raises:
        SensorError: arrays that do not agree or are not finite, or a gain of 0.
    """

    gain: NDArray[np.float64]
    offset_n_mm: NDArray[np.float64]
    from_land: bool = False

    __repr__ = one_line

    def __post_init__(self) -> None:
        gain, offset = _per_whisker("gain", self.gain), _per_whisker("offset_n_mm", self.offset_n_mm)
        _same_length(gain, offset)
        object.__setattr__(self, "gain", gain)
        object.__setattr__(self, "offset_n_mm", offset)


def apply_calibration(raw: NDArray[np.floating], calibration: Calibration) -> NDArray[np.float32]:
    """The moment, N mm, from the raw signal: (raw - offset) / gain.

    Args:
        raw: (..., whiskers, samples), N mm as measured.
        calibration: for as many whiskers.

    Returns:
        float32 of the same shape.

    Raises:
        SensorError: a shape that does not fit.
    """
    raw = np.asarray(raw)
    _check_signal("raw", raw, calibration.gain.size)
    scale = (1.0 / calibration.gain).astype(np.float32)[:, None]
    offset = calibration.offset_n_mm.astype(np.float32)[:, None]
    return np.asarray((raw.astype(np.float32) - offset) * scale, dtype=np.float32)


def calibrate_lead_in(
    air: NDArray[np.floating],
    land: NDArray[np.floating],
    *,
    expected_land_moment_n_mm: float,
    max_gain_uncertainty: float = MAX_GAIN_UNCERTAINTY,
) -> Calibration:
    """Gain and offset of every whisker from its lead-in: first air, then land.

    Args:
        air: (whiskers, samples) raw signal without contact, N mm.
        land: (whiskers, samples) raw signal on undisturbed land, N mm.
        expected_land_moment_n_mm: what the whisker model says of the land, N mm, negative in its frame. An
            error in it, by an unknown friction for instance, goes into every gain alike and leaves
            m / m_land - 1 as it is.
        max_gain_uncertainty: largest standard error of a gain as a share of it.

    Raises:
        SensorError: lead-in too short, not finite or too noisy; a moment on land that does not stand out from
            air; or one of the wrong sign.
    """
    air64, land64 = np.asarray(air, dtype=np.float64), np.asarray(land, dtype=np.float64)
    if air64.ndim != 2 or land64.ndim != 2 or air64.shape[0] != land64.shape[0]:
        raise SensorError(f"air {air64.shape} and land {land64.shape} must both be (whiskers, samples)")
    if not math.isfinite(expected_land_moment_n_mm) or expected_land_moment_n_mm == 0.0:
        raise SensorError(
            f"expected_land_moment_n_mm is {expected_land_moment_n_mm}", hint="it must not be 0"
        )
    for name, signal in (("air", air64), ("land", land64)):
        if signal.shape[1] < MIN_LEAD_IN_SAMPLES:
            raise SensorError(
                f"the lead-in has {signal.shape[1]} samples of {name}",
                hint=f"it needs {MIN_LEAD_IN_SAMPLES} or more",
            )
        if not np.isfinite(signal).all():
            raise SensorError(
                f"the lead-in in {name} is not finite", hint="begin the scan on the part, clear of marks"
            )
    offset = air64.mean(axis=1)
    rise = land64.mean(axis=1) - offset
    error = np.sqrt(air64.var(axis=1, ddof=1) / air64.shape[1] + land64.var(axis=1, ddof=1) / land64.shape[1])
    floor = 1e-6 * abs(expected_land_moment_n_mm)
    faint = np.abs(rise) <= np.maximum(10.0 * error, floor)
    if faint.any():
        raise SensorError(
            f"on whiskers {_names(faint)} the moment on land does not stand out from air: "
            "broken whisker or gauge, no preload, or the tip beyond the part"
        )
    reversed_ = np.sign(rise) != np.sign(expected_land_moment_n_mm)
    if reversed_.any():
        raise SensorError(
            f"on whiskers {_names(reversed_)} the land moment has the wrong sign: gauge wired the other way "
            "round, or air and land exchanged"
        )
    noisy = error > max_gain_uncertainty * np.abs(rise)
    if noisy.any():
        raise SensorError(
            f"on whiskers {_names(noisy)} the lead-in is too noisy for a gain within "
            f"{max_gain_uncertainty:.1%}: take a longer lead-in or more preload"
        )
    return Calibration(gain=rise / expected_land_moment_n_mm, offset_n_mm=offset, from_land=True)


def _names(mask: NDArray[np.bool_]) -> str:
    """Numbers of the whiskers that are set, at most eight of them."""
    numbers = np.flatnonzero(mask)
    return ", ".join(str(i) for i in numbers[:8]) + (", ..." if numbers.size > 8 else "")
