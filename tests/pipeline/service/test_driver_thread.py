"""Drivers that hang, fail and come back; none of them may keep the service, or its end, waiting."""

from __future__ import annotations

import asyncio
import subprocess
import sys
import threading
import time
from functools import partial

import pytest

from pipeline.service.stage.driver import MOST_WAITING, DriverThread, StageDownError
from tests.support.waiting import wait_until
from whisker_array.scan.stage_error import StageError

LATE_S = 0.05


@pytest.mark.parametrize("in_a_coroutine", [False, True])
def test_a_driver_that_hangs_is_told_refused_and_used_again(in_a_coroutine: bool) -> None:
    camera, back = DriverThread("camera", timeout_s=LATE_S), threading.Event()

    def asked() -> object:
        return asyncio.run(camera.call_async(back.wait)) if in_a_coroutine else camera.call(back.wait)

    with pytest.raises(StageDownError, match=r"the camera has not answered in 0\.05 s"):
        asked()
    wait_until(lambda: camera.trouble)
    assert "the camera has not answered for" in camera.trouble
    begun = time.monotonic()
    with pytest.raises(StageDownError, match="see that the camera and its driver work"):
        asked()
    assert time.monotonic() - begun < LATE_S, "it was refused at once, and not waited for again"
    back.set()
    wait_until(lambda: not camera.trouble)
    assert camera.call(lambda: 7, timeout_s=10.0) == 7


def test_calls_are_made_one_after_the_other_and_only_so_many_wait() -> None:
    stage, go = DriverThread("stage", timeout_s=10.0), threading.Event()
    at_once, most = 0, 0

    def move() -> None:
        nonlocal at_once, most
        at_once += 1
        most = max(most, at_once)
        go.wait()
        at_once -= 1

    async def many() -> list[object]:
        moves = [asyncio.ensure_future(stage.call_async(move)) for _ in range(MOST_WAITING + 3)]
        await asyncio.sleep(0.1)
        go.set()
        return await asyncio.gather(*moves, return_exceptions=True)

    made = asyncio.run(many())
    refused = [error for error in made if error is not None]
    assert most == 1
    assert 2 <= len(refused) <= 3  # the first may be at work or still wait
    assert all(isinstance(e, StageDownError) and "others wait for the stage" in str(e) for e in refused)


@pytest.mark.parametrize(
    ("raised", "arrives", "says"),
    [
        (StageError("no part", "put one there"), StageError, "no part; put one there"),
        (FileNotFoundError(2, "gone"), FileNotFoundError, "gone"),
        (TimeoutError("of its own"), TimeoutError, "of its own"),
        (KeyError("axis"), StageDownError, "the stage's driver has a fault (KeyError: 'axis')"),
        (SystemExit(3), StageDownError, "the stage's driver has a fault (SystemExit: 3)"),
    ],
)
def test_what_a_driver_raises_reaches_its_caller(
    raised: BaseException, arrives: type[Exception], says: str
) -> None:
    def fail(error: BaseException) -> None:
        raise error

    stage = DriverThread("stage", timeout_s=10.0)
    with pytest.raises(arrives) as caught:
        stage.call(partial(fail, raised))
    assert type(caught.value) is arrives
    assert says in str(caught.value)
    assert stage.call(lambda: "goes on") == "goes on"
    assert stage.trouble == ""


def test_a_driver_that_never_comes_back_does_not_keep_the_process() -> None:
    program = (
        "import threading\n"
        "from pipeline.service.stage.driver import DriverThread, StageDownError\n"
        "try:\n"
        "    DriverThread('camera', timeout_s=0.05).call(threading.Event().wait)\n"
        "except StageDownError:\n"
        "    print('down')\n"
    )
    ended = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60.0)
    assert (ended.stdout, ended.returncode) == ("down\n", 0)


def test_a_worker_that_is_lent_the_stage_loads_nothing_of_the_web() -> None:
    code = "import sys, pipeline.service.stage.driver; print({'fastapi', 'sqlalchemy'} & sys.modules.keys())"
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ended.stdout == "set()\n"
