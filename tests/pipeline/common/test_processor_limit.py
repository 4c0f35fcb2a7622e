"""A parser that loops as its file tells it is interrupted."""

from __future__ import annotations

import contextlib
import signal
import threading
from pathlib import Path

import pytest

from glyphs.errors import FileError
from pipeline.errors import DataError, processor_limit, reading

pytestmark = pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="the system has no such timer")
ENOUGH = 2**62


def count_up(most: int = ENOUGH) -> None:
    for _ in range(most):
        pass


def test_a_loop_is_interrupted_and_later_ones_are_not() -> None:
    with (
        pytest.raises(DataError, match=r"takes more than 0 s to decode.*; export it again"),
        processor_limit(0.1),
    ):
        count_up()
    assert signal.getitimer(signal.ITIMER_PROF) == (0.0, 0.0)
    assert signal.getsignal(signal.SIGPROF) is signal.SIG_DFL


def test_code_that_ignores_any_exception_is_interrupted_again() -> None:
    def stubborn() -> None:
        with contextlib.suppress(Exception):
            count_up()
        count_up()

    with pytest.raises(DataError), processor_limit(0.1):
        stubborn()


def test_within_another_limit_and_in_other_threads_nothing_is_set() -> None:
    with processor_limit(100.0), processor_limit(0.001):
        count_up(2_000_000)
    thread = threading.Thread(target=lambda: processor_limit(0.001).__enter__())
    thread.start()
    thread.join()
    assert signal.getsignal(signal.SIGPROF) is signal.SIG_DFL


def test_the_file_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pipeline.errors._SPARE_S", 0.1)
    (tmp_path / "a.ezd").write_bytes(b"x")
    with (
        pytest.raises(FileError, match=r"a\.ezd: takes more than 0 s"),
        reading(tmp_path / "a.ezd", kind="x", most_bytes=9),
    ):
        count_up()
