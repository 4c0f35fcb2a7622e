"""What every drawing of the gallery is given, and what it gives back."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from matplotlib.figure import Figure

from pipeline.common.settings import SettingsError
from pipeline.plots.estimator_trial import TrialRow
from whisker_array.simulation.traces import Fidelity
from whisker_array.whisker.defaults import NOMINAL_FRICTION

FIDELITY_COLOURS = {Fidelity.POINTWISE: "#0072B2", Fidelity.CONTACT: "#D55E00"}
"""Blue and vermilion of Okabe and Ito: apart for every eye, and in grey."""


@dataclass(frozen=True)
class FigureSettings:
    """What can be chosen about the gallery.

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
        if not (math.isfinite(self.mu) and 0.0 <= self.mu <= 1.0):
            raise SettingsError(f"--mu is {self.mu}", hint="friction of metal on metal lies between 0 and 1")
        if not (math.isfinite(self.noise) and 0.0 <= self.noise <= 0.02):
            raise SettingsError(
                f"--noise is {self.noise}", hint="it is a share of the land's moment, between 0 and 0.02"
            )
        if self.seed < 0:
            raise SettingsError(f"--seed is {self.seed}", hint="it cannot be negative")


@dataclass(frozen=True)
class StepRow:
    """One line of figures.csv: a step as eq. (16) has it and as a trace shows it.

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
