"""How beliefs become confidences, from readings whose text is known; and other ways to do it, to compare with.

    way                log odds of a confidence                                     numbers
    as believed        log odds of the belief p                                     0
    temperature        a * log odds of p                                            1
    log odds           a * log odds of p + c       (what serves: `Calibration`)     2
    beta               a * ln p - b * ln(1 - p) + c                                 3
    isotonic           any that rises: steps                                        as many as readings

Maximum likelihood with a, b >= 0, so that each rises with the belief. Platt, in Advances in Large Margin Classifiers,
1999; Guo, Pleiss, Sun and Weinberger, ICML 2017 (temperature); Kull, Silva Filho and Flach, AISTATS 2017 (beta);
Zadrozny and Elkan, KDD 2002 (isotonic).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from recognition.belief.calibration import Calibration

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
FEWEST_WRONG = 10
"""Wrong readings, and right ones, below which nothing is fitted."""
OFF, FEWEST_MEASURED = 0.01, 100
"""Share of readings beyond the worse end of a range, and readings below which there is none."""
_LEAST = 1e-6
_LEAST_SLOPE, _MOST_SLOPE = 0.05, 20.0
Way = Callable[[Floats, Bools, Floats], Floats]
"""(beliefs, right) of known readings and beliefs of others to the confidences of these."""


def fit_calibration(beliefs: Floats, right: Bools) -> Calibration:
    """The calibration under which known readings surprise least.

    Args:
        beliefs: (n,) of readings, 0 to 1.
        right: (n,) whether their text is.

    Raises:
        ValueError: too few right or wrong ones.
    """
    slope, bias = _fitted(_log_odds(beliefs)[:, None], right, bias=True)
    return Calibration(float(slope), float(bias))


def fit_ground(
    measures: Sequence[Mapping[str, float]], *, worse_below: Collection[str] = ()
) -> dict[str, tuple[float, float]]:
    """Ranges of shares that were measured of readings: all but the worst `OFF`, and whatever is better.

    Args:
        measures: by name, of each reading; what hardly any has gets no range.
        worse_below: names of those that are worse the less there is; the others are worse the more.
    """
    found = {}
    for name in sorted({name for one in measures for name in one}):
        values = [one[name] for one in measures if name in one]
        low, high = (float(f"{edge:.3g}") for edge in np.quantile(values, (OFF, 1.0 - OFF)))
        if len(values) >= FEWEST_MEASURED:
            found[name] = (low, 1.0) if name in worse_below else (0.0, high)
    return found


def loss(confidences: Floats, right: Bools) -> float:
    """Mean surprise at what was right, nats a reading; none surprises by more than 1 in 10,000 would."""
    said = np.clip(confidences, 1e-4, 1.0 - 1e-4)
    return float(-np.mean(np.log(np.where(right, said, 1.0 - said))))


def _as_believed(_: Floats, __: Bools, others: Floats) -> Floats:
    return others


def _by_temperature(beliefs: Floats, right: Bools, others: Floats) -> Floats:
    slope, _ = _fitted(_log_odds(beliefs)[:, None], right, bias=False)
    return _shares(slope * _log_odds(others))


def _by_log_odds(beliefs: Floats, right: Bools, others: Floats) -> Floats:
    made = fit_calibration(beliefs, right)
    return np.array([made.confidence(belief) for belief in others])


def _by_beta(beliefs: Floats, right: Bools, others: Floats) -> Floats:
    *powers, bias = _fitted(_both_logs(beliefs), right, bias=True)
    return _shares(_both_logs(others) @ np.array(powers) + bias)


def _by_steps(beliefs: Floats, right: Bools, others: Floats) -> Floats:
    from scipy.optimize import isotonic_regression

    order = np.argsort(beliefs)
    steps = isotonic_regression(right[order].astype(np.float64)).x
    return np.asarray(np.interp(others, beliefs[order], steps))


WAYS: Mapping[str, Way] = MappingProxyType(
    {
        "as believed": _as_believed,
        "temperature": _by_temperature,
        "log odds": _by_log_odds,
        "beta": _by_beta,
        "isotonic": _by_steps,
    }
)
"""All, the simplest first."""


def _fitted(columns: Floats, right: Bools, *, bias: bool) -> Floats:
    """Logistic regression on (n, k) columns with weights of at least 0: (k + 1,), the bias last."""
    from scipy.optimize import minimize

    if min(int(right.sum()), int((~right).sum())) < FEWEST_WRONG:
        raise ValueError(
            f"{right.sum()} right and {(~right).sum()} wrong readings are too few; give {FEWEST_WRONG} of each"
        )
    width = columns.shape[1]
    sign = np.where(right, -1.0, 1.0)

    def surprise(values: Floats) -> tuple[float, Floats]:
        odds = columns @ values[:width] + values[width]
        slopes = sign * _shares(sign * odds) / right.size
        gradient = np.array([*(slopes @ columns), slopes.sum()])
        return float(np.logaddexp(0.0, sign * odds).mean()), gradient

    bounds = [(_LEAST_SLOPE, _MOST_SLOPE)] * width + [(None, None) if bias else (0.0, 0.0)]
    found = minimize(surprise, np.r_[np.ones(width), 0.0], jac=True, method="L-BFGS-B", bounds=bounds)
    return np.asarray(found.x)


def _log_odds(shares: Floats) -> Floats:
    inside = np.clip(shares, _LEAST, 1.0 - _LEAST)
    return np.asarray(np.log(inside) - np.log1p(-inside))


def _both_logs(shares: Floats) -> Floats:
    inside = np.clip(shares, _LEAST, 1.0 - _LEAST)
    return np.stack([np.log(inside), -np.log1p(-inside)], axis=1)


def _shares(log_odds: Floats) -> Floats:
    from scipy.special import expit

    return np.asarray(expit(log_odds))
