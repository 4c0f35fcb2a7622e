"""A decision by contracts, score and threshold: a table."""

from __future__ import annotations

import pytest

from recognition.decide.decision import BROKEN, EXPLANATIONS, Decision, ReadingFlag, decision_of
from recognition.language.confusions import CharacterState, PlaceState

READ = PlaceState(CharacterState.READ, "A", 0.99)
UNREAD = PlaceState(CharacterState.NOT_READ, "A", 0.1)


@pytest.mark.parametrize(
    ("places", "score", "threshold", "flags", "wanted"),
    [
        ([READ], 0.99, 0.98, ReadingFlag.NONE, Decision.ACCEPT),
        ([READ], 0.98, 0.98, ReadingFlag.NONE, Decision.ACCEPT),
        ([READ], 0.97999, 0.98, ReadingFlag.NONE, Decision.REVIEW),
        ([READ], 0.1, None, ReadingFlag.NONE, Decision.ACCEPT),
        ([None], 0.99, 0.98, ReadingFlag.NONE, Decision.ACCEPT),
        ([READ, READ, UNREAD], 0.99, 0.98, ReadingFlag.NONE, Decision.ACCEPT),
        ([READ, UNREAD], 0.99, 0.98, ReadingFlag.NONE, Decision.REJECT),
        ([], 0.99, 0.98, ReadingFlag.NONE, Decision.REJECT),
        ([READ], 0.99, 0.98, ReadingFlag.JAMMED, Decision.ACCEPT),
        ([READ], 0.99, 0.98, EXPLANATIONS, Decision.ACCEPT),
    ],
)
def test_contracts_score_and_threshold_decide(
    places: list[PlaceState | None],
    score: float,
    threshold: float | None,
    flags: ReadingFlag,
    wanted: Decision,
) -> None:
    assert decision_of(places, score=score, threshold=threshold, flags=flags) is wanted


@pytest.mark.parametrize("flag", [flag for flag in ReadingFlag if flag & BROKEN])
def test_every_broken_contract_sends_a_sure_reading_to_a_person(flag: ReadingFlag) -> None:
    assert decision_of([READ], score=1.0, threshold=0.98, flags=flag) is Decision.REVIEW
    assert decision_of([UNREAD], score=1.0, threshold=0.98, flags=flag) is Decision.REJECT


def test_what_explains_a_low_score_breaks_no_contract() -> None:
    assert not BROKEN & EXPLANATIONS
