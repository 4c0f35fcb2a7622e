"""Memory of gauges: hysteresis, creep, and the zero shift that both cause.

    load x --+-- w0 ---------------------------+
             |                                 |
             +-- plays, each with slack +-r_j -+--> h --+-- 1 --------------------------+--> reading y
                 |<-- 2 r -->|   x w_j                  |                               |
                                                        +-- springs on dashpots, x c_i -+
                                                            tau_i dq/dt = h - q

    load  |  ________          reading |  ___-----          h lags, so it is higher on the way down,
          | |        |                 | |        |         q follows in seconds and minutes: what is left of
          |_|        |____             |_|        |___---   q and h after unloading is the shift of the zero

Hysteresis is a sum of play operators (Prandtl-Ishlinskii; Visintin, Differential Models of Hysteresis, 1994, III.2;
Kuhnen, European Journal of Control 9, 2003, 407-418)::

    p_j(n) = max(x(n) - r_j, min(x(n) + r_j, p_j(n - 1))),      h = w0 x + sum_j w_j p_j

with w0 such that the first rise to the largest load L gives h = L. Creep is a chain of Kelvin-Voigt elements
behind it (the generalised standard linear solid, a Prony series; Findley, Lai and Onaran, Creep and Relaxation of
Nonlinear Viscoelastic Materials, 1976, chapter 5)::

    y = h + sum_i c_i q_i,      q_i(n) = a_i q_i(n - 1) + (1 - a_i) h(n),      a_i = exp(-dt / tau_i)

Loads and readings are in N mm; the axis of whiskers is the last but one, the axis of samples the last.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from glyphs.compiled import kernel, read_only
from glyphs.errors import MarksError
from glyphs.ranges import freeze_arrays, require_positive
from glyphs.surface.display import OneLine

RELAX_S = (0.3, 3.0, 60.0)
"""Relaxation times of the creep terms, roughly from a pass's duration to a scan's; the first two have equal shares."""
PLAYS = (0.1, 0.2, 0.3, 0.4)
"""Half widths of the plays, as shares of the largest load; equal weights, so that small loads shift the zero less."""
HOLD_S = 11.0
"""Time, s, for which the load is held and then removed in the tests behind the figures below."""
CYCLES = 10
CREEP = (0.009, 0.027)
"""Growth of a held load's reading in `HOLD_S`, share of the largest load: least and most of recorded whiskers."""
ZERO_SHIFT = (0.016, 0.027)
"""Reading right after the first unloading, share of the largest load: least and most."""
SHIFT_AFTER_CYCLES = 0.035
"""Reading right after the last of `CYCLES` unloadings, share of the largest load."""


@dataclass(frozen=True, eq=False, repr=False)
class SensorMemory(OneLine):
    """Creep and hysteresis of the gauges of an array.

    Attributes:
        creep: (n, terms) float64, c_i: final creep of each term, share of the load.
        relax_s: (terms,), tau_i, seconds.
        play_weight: (n, plays) float64, w_j.
        play_n_mm: (plays,), r_j, N mm.
        largest_n_mm: L, N mm, up to which the first loading is linear.

    Raises:
        MarksError: shapes that do not agree, numbers that are negative or not finite, or plays with a weight of 1
            or more.
    """

    creep: NDArray[np.float64]
    relax_s: NDArray[np.float64]
    play_weight: NDArray[np.float64]
    play_n_mm: NDArray[np.float64]
    largest_n_mm: float

    def __post_init__(self) -> None:
        creep, play = ("whiskers", "terms"), ("whiskers", "plays")
        shapes = {"creep": creep, "relax_s": creep[1:], "play_weight": play, "play_n_mm": play[1:]}
        freeze_arrays(MarksError, self, shapes, least=0.0)
        shortest = float(self.relax_s.min(initial=1.0))
        require_positive(MarksError, largest_n_mm=self.largest_n_mm, shortest_s=shortest)
        if (self.straight <= 0.0).any():
            raise MarksError("the plays of a sensor's memory weigh 1 or more", hint="give smaller weights")

    @property
    def straight(self) -> NDArray[np.float64]:
        """(n,) w0, the share of the reading without slack."""
        return np.asarray(1.0 - (self.play_weight * (1.0 - self.play_n_mm / self.largest_n_mm)).sum(axis=1))

    @property
    def n_whiskers(self) -> int:
        """Number of whiskers."""
        return int(self.creep.shape[0])

    def of(self, whiskers: Sequence[int]) -> SensorMemory:
        """The memory of some of the whiskers."""
        chosen = list(whiskers)
        return replace(self, creep=self.creep[chosen], play_weight=self.play_weight[chosen])


@dataclass(eq=False, repr=False)
class SensorState(OneLine):
    """State of the gauges of an array; `measure` updates it in place.

    Attributes:
        play_n_mm: (n, plays) float64, p_j.
        strain_n_mm: (n, terms) float64, q_i.
        drift_n_mm: (n,) float64, present drift of the zero.
    """

    play_n_mm: NDArray[np.float64]
    strain_n_mm: NDArray[np.float64]
    drift_n_mm: NDArray[np.float64]

    @classmethod
    def at_rest(cls, n_whiskers: int, memory: SensorMemory | None) -> SensorState:
        """State of whiskers after a long time in air."""
        terms, plays = (0, 0) if memory is None else (memory.relax_s.size, memory.play_n_mm.size)
        return cls(np.zeros((n_whiskers, plays)), np.zeros((n_whiskers, terms)), np.zeros(n_whiskers))

    def part(self, whiskers: slice) -> SensorState:
        """View of the state of neighbouring whiskers; changing it changes the whole state."""
        return SensorState(self.play_n_mm[whiskers], self.strain_n_mm[whiskers], self.drift_n_mm[whiskers])


def read_gauges(
    load_n_mm: NDArray[np.floating], *, memory: SensorMemory, state: SensorState, step_s: float
) -> NDArray[np.float64]:
    """Compute the reading of a load, sample by sample, by the equations of the module.

    Args:
        load_n_mm: (whiskers, samples), N mm; NaN (no contact) stays NaN and counts as no load.
        memory: memory of the same number of whiskers.
        state: state before the first sample, which is updated.
        step_s: time between two samples; the load of a sample holds for the step before it.

    Returns:
        (whiskers, samples), N mm.
    """
    load = read_only(load_n_mm, np.float64)
    reading = np.empty(load.shape)
    keep = np.exp(-step_s / memory.relax_s)
    _read(
        load, read_only(memory.straight), read_only(memory.play_weight), read_only(memory.play_n_mm),
        read_only(memory.creep), read_only(keep), state.play_n_mm, state.strain_n_mm, reading,
    )  # fmt: skip
    return reading


def rest_gauges(memory: SensorMemory, state: SensorState, *, seconds: float) -> None:
    """Advance the state by a time without load, in one step: the decay of the terms is exact."""
    read_gauges(np.zeros((memory.n_whiskers, 1)), memory=memory, state=state, step_s=seconds)


@kernel()
def _read(load, straight, weight, width, creep, keep, play, strain, reading):  # type: ignore[no-untyped-def]
    for w in range(load.shape[0]):
        for n in range(load.shape[1]):
            x = load[w, n]
            if x != x:
                x = 0.0
            h = straight[w] * x
            for j in range(width.size):
                p = play[w, j]
                if p > x + width[j]:
                    p = x + width[j]
                if p < x - width[j]:
                    p = x - width[j]
                play[w, j] = p
                h += weight[w, j] * p
            y = h
            for i in range(keep.size):
                q = keep[i] * strain[w, i] + (1.0 - keep[i]) * h
                strain[w, i] = q
                y += creep[w, i] * q
            reading[w, n] = y if load[w, n] == load[w, n] else np.nan


def fit_memory(
    creep: NDArray[np.float64], zero_shift: NDArray[np.float64], *, largest_n_mm: float
) -> SensorMemory:
    """Fit the memory to figures of each whisker, and to `SHIFT_AFTER_CYCLES` for all.

    The creep of a hold is still there right after it, so hysteresis causes the rest of the first zero shift:
    sum_j w_j r_j = zero_shift - creep. After n holds of T, with rests of T between them, the state of a term is::

        g_n(tau) = (1 - exp(-T / tau)) sum_(k < n) exp(-2 k T / tau)

    and the shares f of the quick terms (g: their mean) and s of the slow one (g') solve f g_1 + s g'_1 = creep and
    f g_10 + s g'_10 = the shift after ten cycles minus that of hysteresis. Creep of the load left in the plays is
    ignored (0.05 % of L).

    Args:
        creep: (n,) growth of a held load's reading in `HOLD_S`, share of the largest load, within `CREEP`.
        zero_shift: (n,) reading right after unloading, within `ZERO_SHIFT`, at least the creep.
        largest_n_mm: L, N mm.

    Raises:
        MarksError: impossible figures.
    """
    crept, shift = np.asarray(creep, dtype=np.float64), np.asarray(zero_shift, dtype=np.float64)
    tau, widths = np.array(RELAX_S), np.array(PLAYS)
    lag = shift - crept
    decay = np.exp(-2.0 * HOLD_S / tau)
    once = 1.0 - np.exp(-HOLD_S / tau)
    often = once * (1.0 - decay**CYCLES) / (1.0 - decay)
    share = np.array([0.5, 0.5, 0.0])
    system = np.array([[share @ once, once[-1]], [share @ often, often[-1]]])
    quick, slow = np.linalg.solve(system, np.stack([crept, SHIFT_AFTER_CYCLES - lag]))
    weight = lag[:, None] / np.minimum(widths, 1.0 - widths).sum() * np.ones(widths.size)
    return SensorMemory(
        creep=quick[:, None] * share + slow[:, None] * (share == 0.0),
        relax_s=tau,
        play_weight=weight,
        play_n_mm=widths * largest_n_mm,
        largest_n_mm=largest_n_mm,
    )


def draw_memory(n_whiskers: int, *, rng: np.random.Generator, largest_n_mm: float) -> SensorMemory:
    """Draw creep and hysteresis of whiskers, uniform between the least and greatest recorded figures.

    Args:
        n_whiskers: number of whiskers.
        rng: random generator of the figures.
        largest_n_mm: largest load, N mm.
    """
    shift = rng.uniform(*ZERO_SHIFT, size=n_whiskers)
    return fit_memory(rng.uniform(CREEP[0], shift), shift, largest_n_mm=largest_n_mm)
