"""What is shown when kernels are compiled, and that each of them is compiled for one kind of arguments."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from glyphs.compiled import kernel, read_only
from glyphs.compiling import COMPILE_ONCE, end_part, report_end, report_start, show_compiling
from glyphs.kernel_cache import first_on_this_machine
from glyphs.soiling.soiled import Soiling
from pipeline.formats.synth import SynthSpec, write_part

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
    assert main(["read", name, "--font", "gothic", "--format", "AA99", "--height-mm", "5"]) == 0
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
        assert lines == [COMPILE_ONCE]
        end_part()
        twice(values, out)
    np.testing.assert_array_equal(out, [2.0, 5.0])
    assert lines[0] == COMPILE_ONCE
    assert len(lines) == 2
    assert lines[1].startswith("kernels compiled in ")


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
        spec = SynthSpec("AA99", seed=1, soiling=Soiling(severity=dirt))
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
