"""Many at once: threads and processes on one store; and a process that is killed right after it has answered."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from typing import Any

from pipeline.common.part_id import new_part_id
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
        asked = {
            "targets": ("mqtt",),
            "evidence": (PHOTO,),
            "idempotency": IdempotencyKey(f"line-3:{n}", "f"),
        }
        made = race(_refused(lambda _, asked=asked: received(store, **asked)))
        (part,) = [one for one in made if not isinstance(one, Exception)]
        refused = [error for error in made if isinstance(error, AlreadyDoneError)]
        assert len(refused) == len(made) - 1
        assert {error.part_id for error in refused} == {part.id}
    assert (len(store.parts()), store.undelivered()) == (5, 5)


def test_one_of_many_people_is_first(store: Store) -> None:
    for _ in range(5):
        part = received(store, PartState.REVIEW, "KX4").id
        said = race(_refused(lambda k, p=part: correct(store, p, f"KX{k:03d}", f"person {k}", before="KX4")))
        (won,) = [s for s in said if not isinstance(s, Exception)]
        assert all(type(s) is ConflictError for s in said if s is not won)
        assert store.part(part) == won
        assert len(store.reviews(part)) == 1


def test_a_scan_and_a_person_race(store: Store) -> None:
    for _ in range(5):
        part = received(store, PartState.TOUCH_NEEDED, "KX4").id

        def one(k: int, part: str = part) -> Any:
            if k == 0:
                return correct(store, part, "KX5")
            return store.add_readings(part, readings=(reading(f"KX{k}", "fused"),), state=PartState.ACCEPTED)

        n_felt = sum(not isinstance(came, Exception) for came in race(_refused(one))[1:])
        # whoever came after the person was refused, and the person has the last word
        readings, now = store.readings(part), store.part(part)
        assert len(readings) == 1 + n_felt
        assert (now.state, now.text, now.reading) == (PartState.REVIEWED, "KX5", readings[-1])
        # while touch is needed the part has no text
        assert store.reviews(part)[0].before == (readings[-1].text if n_felt else "")


_WRITER = """
import sys
from pipeline.common.part_id import new_part_id
from pipeline.common.reading_records import ReadingRecord
from pipeline.common.records import PartState
from pipeline.store.errors import AlreadyDoneError
from pipeline.store.parts import IdempotencyKey
from pipeline.store.store import Store
store = Store.open(sys.argv[1])
who = sys.argv[2]
for k in range(10_000):
    part = store.add_part(
        part_id=new_part_id(), name=f"{who}-{k}", state=PartState.ACCEPTED,
        readings=(ReadingRecord("vision", "KX4", "accept", 0.9),), targets=("mqtt",),
        idempotency=IdempotencyKey(f"{who}-{k}", "f"),
    )
    print(part.id, flush=True)
"""


def _writer(url: str, who: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", _WRITER, url, who], stdout=subprocess.PIPE, text=True, bufsize=1
    )


def test_what_was_answered_survives_the_kill(store_url: str) -> None:
    """Two processes write at once; each is killed with SIGKILL at the moment it has answered."""
    answered: list[str] = []
    for process in [_writer(store_url, str(k)) for k in range(2)]:
        assert process.stdout is not None
        answered += [process.stdout.readline().strip() for _ in range(7)]
        os.kill(process.pid, signal.SIGKILL)
        # what it had answered beyond those before the signal came
        answered += process.stdout.read().split()
        assert process.wait(30) == -signal.SIGKILL
        process.stdout.close()
    with contextlib.closing(Store.open(store_url)) as store:
        listed = {p.id: p for p in store.parts(limit=10_000)}
        assert set(answered) <= set(listed)
        assert len(answered) >= 14
        # at most one of each process was written and not answered any more
        assert len(listed) - len(answered) <= 2
        assert store.undelivered() == len(listed)
        for part in listed.values():
            assert part.reading is not None
            assert [e.kind for e in store.history(part.id)] == ["received", "read"]
            assert store.find_request(part.name) == ("f", part.id)
        store.add_part(part_id=new_part_id(), name="after", state=PartState.ACCEPTED)
