"""The paper's experiment: one whisker traces a test piece, in either fidelity, and the step F is read off."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.plots.drawing import FigureSettings, StepRow
from pipeline.plots.step_reading import StepError, StepReading, read_step
from pipeline.plots.wedge import Wedge
from whisker_array.scan.sensor import SensorChain, measure
from whisker_array.simulation.contact import trace_contact
from whisker_array.simulation.pointwise import trace_pointwise
from whisker_array.simulation.surface import prepare_surface, sample_lines
from whisker_array.simulation.traces import Fidelity, SampleFlag
from whisker_array.whisker.enhancement import enhancement_factor
from whisker_array.whisker.sections import Round
from whisker_array.whisker.shapes import LShaped, straight_whisker

L1_MM = 30.0
WIRE_MM = 0.3
PRELOAD_MM = 1.0
TIP_RADIUS_MM = 0.03
DEPTH_MM = 0.5
SAMPLE_MM = 0.001
"""Fine: slopes are central differences, which blur the foot by a sample to either side, and a sample of a 60 degree
slope is 0.35 % of what is left of the lift."""
_LAND_MM = 0.6
_VIEW_MM = 1.3
_SAMPLE_RATE_HZ = 1000.0


@dataclass(frozen=True)
class StepCase:
    """One whisker on one test piece.

    Attributes:
        k: l2 / l1; 0 is the straight whisker.
        alpha_deg: intersection angle, degrees.
        mu: friction coefficient.
    """

    k: float
    alpha_deg: float
    mu: float


@dataclass(frozen=True, eq=False)
class FeltStep:
    """A trace over a test piece, and what was read off it.

    Attributes:
        case: what was traced.
        fidelity: how the touch was simulated.
        wedge: the test piece.
        place_mm: (samples,) commanded place of the tip, mm after the edge.
        moment_n_mm: (samples,) moment, N mm.
        predicted: F of eq. (16).
        reading: the step read off.
    """

    case: StepCase
    fidelity: Fidelity
    wedge: Wedge
    place_mm: NDArray[np.float64]
    moment_n_mm: NDArray[np.float64]
    predicted: float
    reading: StepReading

    def row(self, figure: str) -> StepRow:
        """The line of the table."""
        case, reading = self.case, self.reading
        return StepRow(
            figure, case.k, case.alpha_deg, case.mu, self.fidelity.value, self.predicted, reading.factor,
            reading.factor / self.predicted - 1.0, reading.peak,
        )  # fmt: skip


def paper_whisker(k: float) -> LShaped:
    """Music wire, l1 = 30 mm, beta = 0, l3 = l2 = k l1; straight at k = 0.

    The test piece is alike across the trace, so that a wire as soft sideways as upwards does no harm.
    """
    if k == 0.0:
        return straight_whisker(L1_MM, 0.0, Round(WIRE_MM))
    return LShaped(L1_MM, k * L1_MM, None, 0.0, Round(WIRE_MM))


def piece_of(alpha_deg: float) -> Wedge:
    """The test piece of an angle: land, slope to half the preload, floor to the end of the view."""
    run = DEPTH_MM / math.tan(math.radians(alpha_deg))
    return Wedge(math.radians(alpha_deg), DEPTH_MM, _LAND_MM, max(0.3, _VIEW_MM - run))


def feel_step(
    case: StepCase,
    fidelity: Fidelity,
    settings: FigureSettings | None = None,
    *,
    tip_radius_mm: float = TIP_RADIUS_MM,
) -> FeltStep:
    """Trace the test piece once, and read the step off.

    Raises:
        StepError: the tip jams or leaves the surface, or no step can be read off.
        WhiskerError: eq. (16) has no answer.
    """
    settings = settings or FigureSettings()
    wedge, tip = piece_of(case.alpha_deg), paper_whisker(case.k).tip_model()
    surface = prepare_surface(
        wedge.height_map(pitch_mm=SAMPLE_MM), tip_radius_mm=tip_radius_mm, friction=case.mu
    )
    line, samples = np.array([SAMPLE_MM]), surface.shape[1]
    if fidelity is Fidelity.POINTWISE:
        heights, mu, _ = sample_lines(
            surface, lines_mm=line, start_mm=0.0, step_mm=SAMPLE_MM, n_samples=samples
        )
        traces = trace_pointwise(heights, tip, step_mm=SAMPLE_MM, preload_mm=PRELOAD_MM, friction=mu)
    else:
        traces = trace_contact(
            surface, tip, lines_mm=line, start_mm=0.0, step_mm=SAMPLE_MM, n_samples=samples,
            preload_mm=PRELOAD_MM, nominal_friction=case.mu,
        )  # fmt: skip
    wrong = SampleFlag(int(np.bitwise_or.reduce(traces.flags, axis=None)))
    if wrong:
        raise StepError(f"k = {case.k}, {case.alpha_deg:g} degrees, mu = {case.mu}: {wrong.describe()}")
    moment = traces.moment_n_mm
    if settings.noise > 0.0:
        rms = settings.noise * abs(float(moment[0, samples // 10]))
        chain = SensorChain(np.ones(1), np.zeros(1), noise_n_mm=rms)
        rng = np.random.default_rng(settings.seed)
        moment, _ = measure(moment, chain=chain, sample_rate_hz=_SAMPLE_RATE_HZ, rng=rng)
    place = np.asarray(np.arange(samples) * SAMPLE_MM - wedge.land_mm, dtype=np.float64)
    felt = np.asarray(moment[0], dtype=np.float64)
    return FeltStep(
        case, fidelity, wedge, place, felt,
        predicted=enhancement_factor(tip, alpha_rad=wedge.alpha_rad, mu=case.mu),
        reading=read_step(place, felt, wedge=wedge, preload_mm=PRELOAD_MM, blur_mm=SAMPLE_MM),
    )  # fmt: skip
