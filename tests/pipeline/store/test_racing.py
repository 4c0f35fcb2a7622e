"""Many at once: threads and processes on one store; and a process that is killed right after it has answered."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from pipeline.common.part_id import new_part_id
from pipeline.common.records import PartState, ReviewAction
from pipeline.store.store import AlreadyDoneError, ConflictError, IdempotencyKey, Store
from tests.support.store_samples import PHOTO, reading, received

_N_RACERS = 12


def _race(run: Callable[[int], Any]) -> list[Any]:
    """What came of it, started at one moment; what was raised is what came of it."""
    line = threading.Barrier(_N_RACERS)

    def one(k: int) -> Any:
        line.wait(30)
        try:
            return run(k)
        except ConflictError as error:
            return error

    with ThreadPoolExecutor(_N_RACERS) as pool:
        return list(pool.map(one, range(_N_RACERS)))


def test_one_of_many_equal_requests_makes_a_part(store_url: str) -> None:
    with contextlib.closing(Store.open(store_url)) as store:
        for k in range(5):
            request = IdempotencyKey(f"line-3:{k}", "f")
            made = _race(
                lambda _, request=request: received(
                    store, evidence=(PHOTO,), targets=("mqtt",), idempotency=request
                )
            )
            parts = [part for part in made if not isinstance(part, Exception)]
            assert len(parts) == 1
            refused = [error for error in made if isinstance(error, AlreadyDoneError)]
            assert len(refused) == _N_RACERS - 1
            assert {error.part_id for error in refused} == {parts[0].id}
        assert len(store.parts()) == 5
        assert store.undelivered() == 5


def test_one_of_many_people_is_first(store_url: str) -> None:
    with contextlib.closing(Store.open(store_url)) as store:
        for _ in range(5):
            part = received(store, PartState.REVIEW, "KX4")
            said = _race(
                lambda k, part=part: store.review(
                    part.id, action=ReviewAction.CORRECT, text=f"KX{k:03d}", who=f"person {k}", before="KX4"
                )
            )
            (won,) = [s for s in said if not isinstance(s, Exception)]
            assert all(type(s) is ConflictError for s in said if s is not won)
            assert store.part(part.id) == won
            assert len(store.reviews(part.id)) == 1


def test_every_review_stands_where_nobody_asks_what_was_before(store_url: str) -> None:
    with contextlib.closing(Store.open(store_url)) as store:
        part = received(store, PartState.REVIEW, "KX4")
        _race(
            lambda k: store.review(part.id, action=ReviewAction.CORRECT, text=f"KX{k:03d}", who=f"person {k}")
        )
        reviews = store.reviews(part.id)
        assert sorted(r.who for r in reviews) == sorted(f"person {k}" for k in range(_N_RACERS))
        # a chain: each began where the one before ended
        assert [r.before for r in reviews] == ["KX4", *(r.after for r in reviews[:-1])]
        now = store.part(part.id)
        assert (now.text, now.review) == (reviews[-1].after, reviews[-1])


def test_a_scan_and_a_person_race(store_url: str) -> None:
    with contextlib.closing(Store.open(store_url)) as store:
        for _ in range(5):
            part = received(store, PartState.TOUCH_NEEDED, "KX4")

            def one(k: int, part_id: str = part.id) -> Any:
                if k == 0:
                    return store.review(part_id, action=ReviewAction.CORRECT, text="KX5", who="Ada")
                felt = (reading(f"KX{k}", "fused"),)
                return store.add_readings(part_id, readings=felt, state=PartState.ACCEPTED, targets=("mqtt",))

            came = _race(one)
            n_felt = sum(not isinstance(c, Exception) for c in came[1:])
            # whoever came after the person was refused, and the person has the last word
            assert len(store.readings(part.id)) == 1 + n_felt
            now = store.part(part.id)
            assert (now.state, now.text) == (PartState.REVIEWED, "KX5")
            assert now.reading == store.readings(part.id)[-1]
            # while touch is needed the part has no text
            before = store.readings(part.id)[-1].text if n_felt else ""
            assert store.reviews(part.id)[0].before == before


def test_many_write_and_look_at_once(store_url: str) -> None:
    with contextlib.closing(Store.open(store_url)) as store:

        def one(k: int) -> list[str]:
            made = []
            for n in range(8):
                made.append(received(store, name=f"{k}-{n}", targets=("mqtt",)).id)
                assert store.part(made[-1]).name == f"{k}-{n}"
                store.parts(limit=5)
            return made

        made = {i for ids in _race(one) for i in ids}
        assert {p.id for p in store.parts(limit=1000)} == made
        assert len(made) == 8 * _N_RACERS == store.undelivered()


_WRITER = """
import sys
from pipeline.common.part_id import new_part_id
from pipeline.common.reading_records import ReadingRecord
from pipeline.common.records import PartState
from pipeline.store.store import AlreadyDoneError, IdempotencyKey, Store
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
            assert store.remembered(part.name) == ("f", part.id)
        store.add_part(part_id=new_part_id(), name="after", state=PartState.ACCEPTED)
