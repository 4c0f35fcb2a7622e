"""A part unlike those that confidences were fitted on is believed less, and told why."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest

from glyphs.camera.photo import Photo
from recognition.belief.calibration import Calibration, shrunk
from recognition.decision import known_ground
from recognition.decision.flags import ReadingFlag
from recognition.decision.known_ground import on_known_ground
from recognition.decision.part_measures import Measure, measures_of
from recognition.decision.reading import Candidate, CharacterReading, Decision, Reading
from recognition.language.box import Box


@dataclass(frozen=True)
class Rules:
    accept_confidence: float = 0.98
    accept_margin: float = 0.3


RULES = Rules()
PLACE = CharacterReading((Candidate("A", 0.999, 0.999),), Box(0.0, 0.0, 1.0, 1.0))


def of_photo(confidence: float = 0.999) -> Reading:
    """An accepted reading of a grainy grey photograph."""
    grey = np.random.default_rng(4).normal(128.0, 10.0, (60, 90))
    made = Reading((PLACE,), Decision.ACCEPT, confidence, source="vision")
    return made.traced(photo=Photo(np.clip(grey, 0, 255).astype(np.uint8)))


READ = of_photo()
GRAIN = measures_of(READ)[Measure.GRAIN]


@pytest.fixture
def fitted_on(monkeypatch: pytest.MonkeyPatch) -> Callable[[float, float], None]:
    """Says on which grains, in parts of this photograph's, confidences were fitted."""

    def fit(low: float, high: float) -> None:
        made = Calibration(ground={"GRAIN": (low * GRAIN, high * GRAIN)})
        monkeypatch.setattr(known_ground, "calibration_of", lambda source: made)

    return fit


def test_on_its_ground_a_reading_stays_as_it_is(fitted_on: Callable[[float, float], None]) -> None:
    fitted_on(0.9, 1.1)
    assert on_known_ground(READ, RULES) is READ


def test_off_it_confidence_shrinks_by_the_widths_and_the_part_goes_to_review(
    fitted_on: Callable[[float, float], None],
) -> None:
    fitted_on(0.2, 0.4)  # it lies three widths above
    made = on_known_ground(READ, RULES)
    assert made.confidence == pytest.approx(shrunk(0.999, 3.0))
    assert made.decision is Decision.REVIEW
    assert made.flags == ReadingFlag.LOW_CONFIDENCE
    (said,) = made.messages()
    assert said == (
        f"unlike the parts that the reader was tried on: grain of the photograph {GRAIN:.2g}, "
        f"there {0.2 * GRAIN:.2g} to {0.4 * GRAIN:.2g} (look at the part)"
    )


def test_a_little_off_it_is_not_worth_a_word(fitted_on: Callable[[float, float], None]) -> None:
    fitted_on(1.2, 3.2)  # a tenth of the width below
    made = on_known_ground(READ, RULES)
    assert made.confidence == pytest.approx(shrunk(0.999, 0.1))
    assert RULES.accept_confidence < made.confidence < READ.confidence
    assert (made.decision, made.messages()) == (Decision.ACCEPT, ())


def test_what_was_in_doubt_anyway_is_not_told_that_it_is_unlike(
    fitted_on: Callable[[float, float], None],
) -> None:
    fitted_on(0.2, 0.4)
    made = on_known_ground(replace(READ, confidence=0.97), RULES)
    assert made.confidence == pytest.approx(shrunk(0.97, 3.0))
    assert made.findings == ()


def test_nothing_read_stays_nothing(fitted_on: Callable[[float, float], None]) -> None:
    fitted_on(3.0, 4.0)
    empty = replace(READ, characters=(), decision=Decision.REJECT, confidence=0.0)
    assert on_known_ground(empty, RULES) is empty


def test_grain_does_not_depend_on_exposure() -> None:
    photo = READ.trace.photo
    assert photo is not None
    darker = READ.traced(photo=Photo((photo.pixels // 2).astype(np.uint8)))
    measured = measures_of(darker)
    assert measured[Measure.GRAIN] == pytest.approx(GRAIN, rel=0.1)  # of whole grey levels
    assert measured[Measure.PATCHES] == pytest.approx(
        measures_of(READ)[Measure.PATCHES], rel=0.1
    )  # of whole grey levels
