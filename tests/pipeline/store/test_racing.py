"""Many at once: threads on one store."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pipeline.common.records import PartState
from pipeline.store.errors import AlreadyDoneError, ConflictError
from pipeline.store.parts import IdempotencyKey
from pipeline.store.store import Store
from tests.support.store_samples import PHOTO, correct, race, reading, received


def _refused(run: Callable[[int], Any]) -> Callable[[int], Any]:
    """What came of it; a refusal is what came of it."""

    def one(k: int) -> Any:
        try:
            return run(k)
        except ConflictError as error:
            return error

    return one


def test_one_of_many_equal_requests_makes_a_part(store: Store) -> None:
    for n in range(5):
        request = {
            "targets": ("mqtt",),
            "evidence": (PHOTO,),
            "idempotency": IdempotencyKey(f"line-3:{n}", "f"),
        }
        outcomes = race(_refused(lambda _, asked=request: received(store, **asked)))
        (part,) = [outcome for outcome in outcomes if not isinstance(outcome, Exception)]
        refused = [error for error in outcomes if isinstance(error, AlreadyDoneError)]
        assert len(refused) == len(outcomes) - 1
        assert {error.part_id for error in refused} == {part.id}
    assert (len(store.parts()), store.undelivered()) == (5, 5)


def test_one_of_many_people_is_first(store: Store) -> None:
    for _ in range(5):
        part = received(store, PartState.REVIEW, "KX4").id
        outcomes = race(
            _refused(lambda k, p=part: correct(store, p, f"KX{k:03d}", f"person {k}", before="KX4"))
        )
        (won,) = [s for s in outcomes if not isinstance(s, Exception)]
        assert all(type(s) is ConflictError for s in outcomes if s is not won)
        assert store.part(part) == won
        assert len(store.story(part).reviews) == 1


def test_a_scan_and_a_person_race(store: Store) -> None:
    for _ in range(5):
        part = received(store, PartState.TOUCH_NEEDED, "KX4").id

        def one(k: int, part: str = part) -> Any:
            if k == 0:
                return correct(store, part, "KX5")
            return store.add_readings(part, readings=(reading(f"KX{k}", "fused"),), state=PartState.ACCEPTED)

        n_felt = sum(not isinstance(came, Exception) for came in race(_refused(one))[1:])
        # whoever came after the person was refused, and the person has the last word
        readings, now = store.story(part).readings, store.part(part)
        assert len(readings) == 1 + n_felt
        assert (now.state, now.text, now.reading) == (PartState.REVIEWED, "KX5", readings[-1])
        # while touch is needed the part has no text
        assert store.story(part).reviews[0].before == (readings[-1].text if n_felt else "")
