"""The fits of score, thresholds and fusion: known weights come back, folds are left out, the shipped fit is that of the
kept readings."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import expit

from pipeline.common.shares import CONFIDENCE_LEVEL, share_bounds
from recognition.decide.score import SOURCES, Measure, Score, Term
from recognition.language.lattice import Lattice
from tests.benchmarks import fit_score, kept_readings
from tests.benchmarks.fit_score import (
    FusionPlaces,
    Judged,
    KnownReading,
    accepts,
    disagree,
    find_thresholds,
    fit,
    fit_fusion,
    read,
)
from tests.benchmarks.fit_score import (
    fit_score as fit_terms,
)
from tests.benchmarks.kept_readings import CHARS, KeptPart, KeptReading

LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"
N_PLACES = 3


def sense(rng: np.random.Generator, text: str, *, slip: float, temperature: float = 1.0) -> KeptReading:
    """What a sense reads: each place shows its character in noise, or, at a slip, another one.

    Args:
        rng: source of chance.
        text: text on the part.
        slip: probability that a place shows another character.
        temperature: factor of the log-likelihood ratios that the sense reports; 1 is calibrated.
    """
    log = np.full((len(text), len(CHARS)), -np.inf)
    for k, char in enumerate(text):
        shown = char if rng.random() >= slip else str(rng.choice(list(LETTERS)))
        evidence = rng.normal(0.0, 1.5, len(LETTERS))
        evidence[LETTERS.index(shown)] += 1.5**2 * 2.0
        values = 2.0 * temperature * evidence / 1.5
        log[k, [CHARS.index(letter) for letter in LETTERS]] = values - np.logaddexp.reduce(values)
    lattice = Lattice(tuple(CHARS), np.minimum(log, 0.0))
    return KeptReading(lattice.text, False, 1.0, {}, lattice, None)


def drawn_parts(seed: int, total: int, *, slip: float = 0.02, camera: float = 1.0) -> list[KeptPart]:
    """Parts of two generators, in four fonts, at two severities."""
    rng = np.random.default_rng(seed)
    parts = []
    for number in range(total):
        text = "".join(rng.choice(list(LETTERS), size=N_PLACES))
        touch = sense(rng, text, slip=slip)
        vision = sense(rng, text, slip=2.0 * slip, temperature=camera)
        fused = KeptReading("", False, 1.0, {}, None, None)
        readings = {"tactile": touch, "vision": vision, "fused": fused}
        parts.append(
            KeptPart(
                number,
                "own" if number % 2 else "other",
                f"font{number % 4}-a",
                0.3 * (number % 3 > 0),
                "AAA",
                text,
                readings,
            )
        )
    return parts


def known(odds: float, right: bool, **measures: float) -> KnownReading:
    nothing = KeptReading("", False, 1.0, {}, None, None)
    part = KeptPart(0, "own", "font", 0.0, "A", "A", dict.fromkeys(SOURCES, nothing))
    values = {Measure.ODDS: odds, **{Measure[name]: value for name, value in measures.items()}}
    return KnownReading(part, "tactile", "A" if right else "B", False, values)


def test_the_weights_by_which_texts_were_drawn_come_back() -> None:
    rng = np.random.default_rng(3)
    readings = []
    for _ in range(20_000):
        odds, twins = float(rng.normal(1.0, 3.0)), float(rng.integers(0, 4))
        right = bool(rng.random() < expit(0.6 * odds - 0.5 - 0.7 * twins))
        readings.append(known(odds, right, TWINS=twins))
    fitted = fit_terms("tactile", readings)
    # some five standard errors of 20,000 readings
    assert fitted.slope == pytest.approx(0.6, abs=0.04)
    assert fitted.bias == pytest.approx(-0.5, abs=0.15)
    assert fitted.terms[Measure.TWINS].nats(3.0) == pytest.approx(-2.1, abs=0.3)
    scores = np.array([fitted.probability(reading.measures) for reading in readings])
    assert scores.mean() == pytest.approx(np.mean([reading.right for reading in readings]), abs=2e-3)


def test_a_measure_never_counts_the_wrong_way() -> None:
    rng = np.random.default_rng(4)
    readings = []
    for _ in range(2000):
        odds, twins = float(rng.normal(1.0, 3.0)), float(rng.integers(0, 4))
        # more twins are better here, by chance
        readings.append(known(odds, bool(rng.random() < expit(odds + twins)), TWINS=twins))
    assert set(fit_terms("tactile", readings).terms) == {Measure.ODDS}


def test_readings_that_are_all_right_fit_nothing() -> None:
    with pytest.raises(ValueError, match="right and wrong readings"):
        fit_terms("tactile", [known(2.0, True) for _ in range(100)])


@pytest.mark.parametrize("camera", [1.0, 2.5])
def test_a_camera_that_exaggerates_gets_the_weight_that_corrects_it(camera: float) -> None:
    """Of independent senses the ratios add; one that reports its ratios too large by a factor is divided by it."""
    weights = fit_fusion(drawn_parts(5, 1500, slip=0.0, camera=camera))
    assert weights.camera / weights.touch == pytest.approx(1.0 / camera, rel=0.2)


def test_the_gradient_of_the_conditional_logit_is_that_of_its_loss() -> None:
    places = FusionPlaces.of(drawn_parts(6, 20))
    qualities = np.random.default_rng(1).normal(size=(places.truth.size, 2))
    weights = np.array([0.9, 0.4, 0.1, -0.2, 0.3, 0.05])
    gradient = places.loss(weights, qualities)[1].sum(axis=0)
    for k, step in enumerate(np.eye(weights.size) * 1e-6):
        upper, lower = (places.loss(weights + sign * step, qualities)[0].sum() for sign in (1, -1))
        assert gradient[k] == pytest.approx((upper - lower) / 2e-6, rel=1e-4, abs=1e-4)


def test_a_part_that_one_sense_has_read_is_scored_as_one_of_that_sense() -> None:
    part, *others = drawn_parts(7, 400, slip=0.1)
    fitted = fit(others)
    blind = replace(part.readings["vision"], text="", recognised=None)
    by_touch = read(replace(part, readings={**part.readings, "vision": blind}), "fused", fitted)
    assert by_touch is not None
    assert by_touch.source == "tactile"
    assert by_touch.measures == read(part, "tactile", fitted).measures  # type: ignore[union-attr]
    by_camera = read(replace(part, readings={**part.readings, "tactile": blind}), "fused", fitted)
    assert by_camera is not None
    assert by_camera.source == "vision"
    both = read(part, "fused", fitted)
    assert both is not None
    assert both.source == "fused"
    nothing = {**part.readings, "tactile": blind, "vision": blind}
    assert read(replace(part, readings=nothing), "fused", fitted) is None


def test_senses_that_are_sure_of_different_texts_disagree() -> None:
    rng = np.random.default_rng(8)
    part = drawn_parts(8, 1)[0]
    doubtful = {name: Score(name, -9.0, {Measure.ODDS: Term(((0.0, 0.0), (1.0, 1.0)))}) for name in SOURCES}
    same = {**part.readings, "vision": part.readings["tactile"]}
    assert not disagree(replace(part, readings=same), part.readings["tactile"].text, doubtful)
    other = sense(rng, "XYZ" if "X" not in part.text else "QQQ", slip=0.0, temperature=4.0)
    assert disagree(replace(part, readings={**part.readings, "vision": other}), part.text, doubtful)


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 2**20))
def test_accepted_readings_reach_the_threshold_of_their_source(seed: int) -> None:
    rng = np.random.default_rng(seed)
    judged = [
        Judged("tactile", known(1.0, bool(rng.random() < 0.995)), float(score), {})
        for score in expit(rng.normal(3.0, 2.0, 600))
    ]
    thresholds = find_thresholds(judged)
    for risk in (0.05, 0.01, 0.001):
        tests = [test for tested, test in thresholds["tactile"].items() if tested <= risk]
        accepted = [reading for reading in judged if accepts(reading, thresholds, risk)]
        assert bool(accepted) == bool(tests)
        if tests:
            assert len(accepted) == max(test.accepted for test in tests)
    broken = replace(judged[0].reading, broken=True)
    assert not accepts(Judged("tactile", broken, 1.0, {}), thresholds, 0.05)


def test_the_shipped_fit_is_that_of_the_kept_readings() -> None:
    parts = kept_readings.load(kept_readings.KEPT)
    judged, thresholds, fitted = fit_score.fit_all(parts)
    # with both senses, a part that one of them reads alone counts as well
    for source in SOURCES:
        for risk in thresholds[source]:
            accepted = [one for one in judged if one.mode == source and accepts(one, thresholds, risk)]
            wrong = sum(not one.reading.right for one in accepted)
            assert share_bounds(wrong, len(accepted), confidence=CONFIDENCE_LEVEL)[1] <= risk
    for path, content in fit_score.contents_of(parts, thresholds, fitted).items():
        assert_same(json.loads(json.dumps(content)), json.loads(path.read_text(encoding="utf-8")))


def assert_same(fitted: Any, shipped: Any) -> None:
    """Equal, but for the last digits, in which optimisers differ between machines."""
    if isinstance(shipped, dict):
        assert set(fitted) == set(shipped)
        for name in shipped:
            assert_same(fitted[name], shipped[name])
    elif isinstance(shipped, list):
        assert len(fitted) == len(shipped)
        for number, other in zip(fitted, shipped, strict=True):
            assert_same(number, other)
    elif isinstance(shipped, str):
        assert fitted == shipped
    else:
        assert fitted == pytest.approx(shipped, rel=0.01, abs=0.01)
