"""Kernels: what is shown when they are compiled, and that they compute whatever becomes of their files on disk."""

from __future__ import annotations

import errno
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numba.core.caching import IndexDataCacheFile, NullCache

from glyphs.compiled import kernel, read_only
from glyphs.compiling import (
    COMPILE_EVERY_RUN,
    COMPILE_ONCE,
    end_part,
    report_end,
    report_start,
    show_compiling,
)
from glyphs.kernel_cache import first_on_this_machine
from glyphs.soiling.soiled import Soiling
from pipeline.formats.synth import SynthSpec, write_part

# --------------------------------------------------------------------------------------------------------- compiling

KINDS = {"trace_abreast": 2}
"""Kernels of more than one kind: where dirt yields there is more to compute, and elsewhere it is left out."""
READ = """
import sys
from contextlib import nullcontext
from numba.core.registry import CPUDispatcher
from pipeline.cli.main import main
from pipeline.workers.executors import Executor
from pipeline.workers.options import WorkerSettings
WorkerSettings.opened = lambda *_, **__: nullcontext(Executor())  # here, where kernels are counted
for name in sys.argv[1:]:
    assert main(["read", name, "--font", "gothic", "--format", "A9", "--height-mm", "4"]) == 0
modules = [m for name, m in sys.modules.items() if name.split(".")[0] in ("glyphs", "whisker_array", "recognition")]
kernels = {id(k): k for m in modules for k in vars(m).values() if isinstance(k, CPUDispatcher)}
for one in kernels.values():
    print("kernel", one.py_func.__name__, len(one.overloads))
"""


def test_a_first_call_is_shown_once_and_its_time_when_the_part_is_done(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("numba.core.config.CACHE_DIR", str(tmp_path))  # an earlier run has compiled it

    @kernel()
    def twice(values, out):  # type: ignore[no-untyped-def]
        for i in range(values.size):
            out[i] = 2.0 * values[i]

    lines: list[str] = []
    values, out = read_only([1.0, 2.5]), np.empty(2)
    with show_compiling(lines.append):
        twice(values, out)
        end_part()
        twice(values, out)
    np.testing.assert_array_equal(out, [2.0, 5.0])
    # in between, a busy machine shows how far it is
    first, *_, last = lines
    assert first == COMPILE_ONCE
    assert last.startswith("kernels compiled in ")
    assert all(line.startswith("compiling kernels: ") for line in lines[1:-1])


def test_compiling_is_announced_once_and_its_progress_shown() -> None:
    lines: list[str] = []
    with show_compiling(lines.append):
        for seconds in (3.0, 4.0, 0.5):
            report_start()
            report_end(seconds)
        end_part()
        report_start()
        report_end(0.2)
        end_part()  # too short to be worth a line
    assert lines == [COMPILE_ONCE, "compiling kernels: 7 s so far", "kernels compiled in 8 s"]


def test_commands_that_follow_do_not_announce_it_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("numba.core.config.CACHE_DIR", str(tmp_path))
    lines: list[str] = []
    for seconds in (2.0, 3.0, 6.0):  # three commands, each with kernels of its own
        with show_compiling(lines.append):
            report_start(first=first_on_this_machine)
            report_end(seconds)
    assert lines == [
        COMPILE_ONCE,
        "kernels compiled in 2 s",
        "compiling kernels: 6 s so far",
        "kernels compiled in 6 s",
    ]


def test_read_only_views_are_of_one_type_and_leave_the_array_alone() -> None:
    array = np.arange(12.0).reshape(3, 4)
    frozen = array.copy()
    frozen.flags.writeable = False
    for given in (array, array.T, array[:, ::2], frozen):
        view = read_only(given, np.float32)
        np.testing.assert_array_equal(view, given)
        assert view.flags.c_contiguous
        assert not view.flags.writeable
    assert array.flags.writeable


def test_every_kernel_is_compiled_for_one_kind_of_arguments(tmp_path: Path) -> None:
    parts = []
    for name, dirt in (("clean", 0.0), ("dirty", 0.4)):
        spec = SynthSpec("A9", seed=1, height_mm=4.0, soiling=Soiling(severity=dirt))
        write_part(spec, tmp_path / name, 0, photos=False)
        parts.append(str(tmp_path / f"{name}.npz"))
    done = subprocess.run(
        [sys.executable, "-c", READ, *parts], capture_output=True, text=True, timeout=600, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    counts = {
        name: int(count)
        for word, name, count in (
            line.split() for line in done.stdout.splitlines() if line.startswith("kernel ")
        )
    }
    used = {name for name, count in counts.items() if count}
    assert {"trace_abreast", "_row_sums", "_forward"} <= used
    assert {name: count for name, count in counts.items() if count > KINDS.get(name, 1)} == {}


# ------------------------------------------------------------------------------------------------------ kernel cache


def thrice() -> Any:
    """A new dispatcher of one kernel, as another process has it."""

    @kernel()
    def triple(values, out):  # type: ignore[no-untyped-def]
        for i in range(values.size):
            out[i] = 3.0 * values[i]

    return triple


def computed(dispatcher: Any) -> list[float]:
    out = np.empty(2)
    dispatcher(read_only([1.0, 2.5]), out)
    return out.tolist()


def hits(dispatcher: Any) -> int:
    return sum(dispatcher.stats.cache_hits.values())


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr("numba.core.config.CACHE_DIR", str(tmp_path))
    return tmp_path


def emptied(content: bytes) -> bytes:
    return b""


def halved(content: bytes) -> bytes:
    return content[: len(content) // 2]


def changed(content: bytes) -> bytes:
    """The middle, where a data file has machine code."""
    middle = len(content) // 2
    return content[:middle] + bytes(255 - b for b in content[middle : middle + 64]) + content[middle + 64 :]


@pytest.mark.parametrize("suffix", [".nbi", ".nbc"])
@pytest.mark.parametrize("damage", [emptied, halved, changed])
def test_damaged_files_are_made_again(folder: Path, damage: Callable[[bytes], bytes], suffix: str) -> None:
    assert computed(thrice()) == [3.0, 7.5]
    files = list(folder.rglob(f"*{suffix}"))
    assert files
    for file in files:
        file.write_bytes(damage(file.read_bytes()))
    again = thrice()
    assert computed(again) == [3.0, 7.5]
    assert hits(again) == 0
    last = thrice()
    assert computed(last) == [3.0, 7.5]
    assert hits(last) == 1  # the files are whole again


def test_a_full_disk_keeps_no_kernel_from_its_work(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: Any) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    for name in ("_save_index", "_save_data"):
        with monkeypatch.context() as patch:
            patch.setattr(IndexDataCacheFile, name, full)
            assert computed(thrice()) == [3.0, 7.5]
        assert computed(thrice()) == [3.0, 7.5]


def test_without_a_folder_for_them_kernels_are_compiled_and_that_is_shown(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("numba.core.caching.CacheImpl._locator_classes", [])
    monkeypatch.setattr("glyphs.compiled._Compiling.all_cached", True)
    one = thrice()
    assert isinstance(one._cache, NullCache)
    lines: list[str] = []
    with show_compiling(lines.append):
        assert computed(one) == [3.0, 7.5]
    assert lines[0] == COMPILE_EVERY_RUN
