"""The load's own bookkeeping: it must not flatter a service that stalls."""

from __future__ import annotations

import asyncio

import numpy as np
import pytest

from tests.benchmarks.service_load import Tally, arrivals, offer

STALL_S = 0.3
RATE = 100.0


def test_parts_that_come_while_the_service_stalls_count_from_when_they_were_due() -> None:
    """A closed loop would see one slow answer; of parts that came in the stall each waited for the rest of it."""
    tally = Tally()

    async def run() -> None:
        served = asyncio.Lock()  # one at a time

        async def send(number: int) -> str:
            async with served:
                await asyncio.sleep(STALL_S if number == 0 else 0.0)
            return "right" if number else "503"

        await offer(arrivals(RATE, 0.4, poisson=False, rng=np.random.default_rng(0)), send, tally)

    asyncio.run(run())
    assert tally.ends == {"right": 39, "503": 1}
    due = np.arange(1, 40) / RATE
    assert np.all(np.array(tally.seconds[:29]) >= STALL_S - due[:29] - 0.005)  # the clock's grain


@pytest.mark.parametrize("poisson", [True, False])
def test_as_many_parts_come_as_the_rate_says(poisson: bool) -> None:
    times = arrivals(50.0, 200.0, poisson=poisson, rng=np.random.default_rng(3))
    gaps = np.diff(times)
    assert len(times) == 10_000
    assert np.all(gaps >= 0.0)
    assert times[-1] < 200.0
    # gaps of a Poisson process vary as much as they are long
    assert np.std(gaps) / np.mean(gaps) == pytest.approx(1.0 if poisson else 0.0, abs=0.05)
