"""Validity by the exact bent shape, and the frequency at which a scan is quasi-static."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from whisker_array.whisker.array import SAFE_SPEED_MM_S, default_plan
from whisker_array.whisker.defaults import default_preload_mm, default_whisker
from whisker_array.whisker.elastica import linear_error
from whisker_array.whisker.sections import Rectangle, Round, WhiskerError
from whisker_array.whisker.shapes import Chain, LShaped, Straight, Whisker
from whisker_array.whisker.validity import (
    DEFLECTION_LIMIT,
    LINEAR_ERROR_LIMIT,
    QUASI_STATIC_SHARE,
    Validity,
    check_validity,
    deflection_ratio,
    first_bending_frequency_hz,
    linear_beam_messages,
    validity_messages,
)

GOOD = {"preload_mm": 1.0, "mu": 0.2, "mark_depth_mm": 0.2, "speed_mm_s": 5.0, "finest_wavelength_mm": 0.5}
LONG_ARM = LShaped(30.0, 9.0, None, 0.0, Rectangle(0.3, 4.5))
"""k = 0.3: bends by under 10 % of l1 at 1 mm, yet the linear force is wrong by more than 2 %."""


# --- Assumption 1 by the exact bent shape


@pytest.mark.parametrize("height", [2.5, 5.0, 10.0])
def test_default_whisker_gives_no_message(height: float) -> None:
    whisker, preload = default_whisker(height), default_preload_mm(height)
    for mu in (0.0, 0.2, 0.5):
        assert linear_beam_messages(whisker, preload_mm=preload, mark_height_mm=0.05 * height, mu=mu) == ()


def test_strained_beam_is_flagged_only_when_asked() -> None:
    assert deflection_ratio(LONG_ARM, preload_mm=1.0, mu=0.2) < DEFLECTION_LIMIT
    assert linear_error(LONG_ARM, lift_mm=1.0, mu=0.2).force > LINEAR_ERROR_LIMIT
    mild = {**GOOD, "steepest_bevel_rad": math.radians(45)}
    assert check_validity(LONG_ARM, **mild) == Validity.NONE
    assert check_validity(LONG_ARM, **mild, exact=True) == Validity.LINEAR_BEAM_STRAINED
    assert check_validity(default_whisker(5.0), **GOOD, exact=True) == Validity.NONE
    (line,) = validity_messages(Validity.LINEAR_BEAM_STRAINED)
    assert "2 %" in line
    assert f"{100 * LINEAR_ERROR_LIMIT:g} %" in line


def test_message_gives_the_measured_errors() -> None:
    (line,) = linear_beam_messages(LONG_ARM, preload_mm=1.0, mark_height_mm=0.25, mu=0.2)
    error = linear_error(LONG_ARM, lift_mm=1.25, mu=0.2)
    assert "1.25 mm" in line
    assert f"{100 * error.force:+.1f} % in force" in line
    assert f"{100 * error.moment:+.1f} % in moment" in line
    assert f"{100 * deflection_ratio(LONG_ARM, preload_mm=1.25, mu=0.2):.1f} % of l1" in line


def test_mark_height_counts() -> None:
    whisker = default_whisker(5.0)
    assert linear_beam_messages(whisker, preload_mm=2.0, mark_height_mm=0.0, mu=0.2) == ()
    assert len(linear_beam_messages(whisker, preload_mm=2.0, mark_height_mm=2.0, mu=0.2)) == 1


@settings(max_examples=30, deadline=None)
@given(k=st.floats(0.02, 0.4), preload=st.floats(0.2, 5.0), mu=st.floats(0.0, 0.5))
def test_silent_exactly_within_the_limits(k: float, preload: float, mu: float) -> None:
    whisker = LShaped(30.0, 30.0 * k, None, 0.0, Round(0.4))
    lines = linear_beam_messages(whisker, preload_mm=preload, mark_height_mm=0.0, mu=mu)
    error = linear_error(whisker, lift_mm=preload, mu=mu)
    ratio = deflection_ratio(whisker, preload_mm=preload, mu=mu)
    over = max(abs(error.force), abs(error.moment)) > LINEAR_ERROR_LIMIT or ratio > DEFLECTION_LIMIT
    assert len(lines) == int(over)


@pytest.mark.parametrize(
    ("whisker", "mu", "why"),
    [
        (LShaped(30.0, 3.0, None, -1.2, Rectangle(0.3, 4.5)), 0.5, "jams"),
        (Chain(np.array([[0.0, 0, 0], [-20, -2, 0], [-22, -4, 1]]), Round(0.3)), 0.2, "plane"),
        (Straight(1.0, 0.0, Round(0.3)), 0.2, "cannot be"),
    ],
)
def test_no_exact_answer_is_said(whisker: Whisker, mu: float, why: str) -> None:
    (line,) = linear_beam_messages(whisker, preload_mm=1.0, mark_height_mm=0.1, mu=mu)
    assert "cannot be checked" in line
    assert re.search(why, line)


def test_no_exact_answer_is_flagged() -> None:
    short = Straight(1.0, 0.0, Round(0.3))
    assert Validity.LINEAR_BEAM_STRAINED in check_validity(short, **GOOD, exact=True)
    jams = LShaped(30.0, 3.0, None, -1.2, Rectangle(0.3, 4.5))
    flags = check_validity(jams, **{**GOOD, "mu": 0.5}, exact=True)
    assert Validity.JAMMING in flags
    assert Validity.LINEAR_BEAM_STRAINED not in flags  # no state on the land to judge


def test_refusals_say_what_is_wrong() -> None:
    whisker = default_whisker(5.0)
    with pytest.raises(WhiskerError, match="preload_mm"):
        linear_beam_messages(whisker, preload_mm=0.0, mark_height_mm=0.0, mu=0.2)
    for height in (-0.1, math.nan, math.inf):
        with pytest.raises(WhiskerError, match="mark_height_mm"):
            linear_beam_messages(whisker, preload_mm=1.0, mark_height_mm=height, mu=0.2)
    with pytest.raises(WhiskerError, match="mu"):
        linear_beam_messages(whisker, preload_mm=1.0, mark_height_mm=0.0, mu=-0.2)


# --- Assumption 5: the tip is held while it scans


@pytest.mark.parametrize("height", [2.5, 5.0, 10.0])
def test_default_raster_is_quasi_static(height: float) -> None:
    plan = default_plan((0.0, 0.0, 10.0, 10.0), character_height_mm=height)
    use = {
        **GOOD,
        "preload_mm": default_preload_mm(height),
        "mark_depth_mm": 0.04 * height,
        "finest_wavelength_mm": 4.0 * plan.line_pitch_mm,
    }
    assert check_validity(default_whisker(height), **{**use, "speed_mm_s": SAFE_SPEED_MM_S}) == Validity.NONE
    over = check_validity(default_whisker(height), **{**use, "speed_mm_s": 60.0})  # 59 mm/s is the limit
    assert over == Validity.NOT_QUASI_STATIC


def test_quasi_static_is_judged_with_the_tip_held() -> None:
    whisker = default_whisker(5.0)
    for held, flagged in ((True, Validity.NOT_QUASI_STATIC), (False, Validity.NONE)):
        edge = QUASI_STATIC_SHARE * first_bending_frequency_hz(whisker, tip_held=held) * 0.5
        assert check_validity(whisker, **{**GOOD, "speed_mm_s": 0.999 * edge}) == Validity.NONE
        assert check_validity(whisker, **{**GOOD, "speed_mm_s": 1.001 * edge}) == flagged
    (line,) = validity_messages(Validity.NOT_QUASI_STATIC)
    assert "tip held" in line


def test_round_wire_is_no_faster_for_being_held_up() -> None:
    # the surface holds its height, not its sideways swing, which is as slow as that of the free whisker
    wire = Straight(30.0, 0.0, Round(0.3))
    held, free = first_bending_frequency_hz(wire, tip_held=True), first_bending_frequency_hz(wire)
    assert held == pytest.approx(free, rel=1e-9)
