"""Settings of the gallery's figures, and a figure with its tables."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from matplotlib.figure import Figure

from pipeline.common.settings import SettingsError
from pipeline.plots.estimator_trial import TrialRow
from whisker_array.whisker.defaults import NOMINAL_FRICTION


@dataclass(frozen=True)
class FigureSettings:
    """Settings of the gallery.

    Attributes:
        mu: friction coefficient, where a figure is not about it.
        noise: rms noise of one sample as a share of the moment on the land; 0: an ideal sensor.
        seed: of the noise.

    Raises:
        SettingsError: a value out of range.
    """

    mu: float = NOMINAL_FRICTION
    noise: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        for name, most, hint in (
            ("mu", 1.0, "friction of metal on metal lies between 0 and 1"),
            ("noise", 0.02, "it is a share of the land's moment, between 0 and 0.02"),
            ("seed", math.inf, "it cannot be negative"),
        ):
            if not 0.0 <= (value := getattr(self, name)) <= most:
                raise SettingsError(f"--{name} is {value}", hint=hint)


@dataclass(frozen=True)
class StepRow:
    """One line of figures.csv: a step by eq. (16) and as read off a trace.

    Attributes:
        figure: where it is drawn.
        k: l2 / l1.
        alpha_deg: intersection angle, degrees.
        mu: friction coefficient.
        fidelity: how the trace was simulated.
        f_predicted: F of eq. (16).
        f_read_off: F read off the trace.
        error: f_read_off / f_predicted - 1.
        peak: the highest moment of the trace over the land's: what the eye sees of F.
    """

    figure: str
    k: float
    alpha_deg: float
    mu: float
    fidelity: str
    f_predicted: float
    f_read_off: float
    error: float
    peak: float


@dataclass(frozen=True, eq=False)
class Drawing:
    """A figure, and the steps or the estimators' errors it shows, if any."""

    figure: Figure
    rows: tuple[StepRow, ...] = field(default=())
    trial: tuple[TrialRow, ...] = field(default=())
