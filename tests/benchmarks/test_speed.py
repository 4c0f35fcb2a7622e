"""Speed figures: pytest -m benchmark. The targets hold for the quickest round: other work only adds."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numba
import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from glyphs.fonts.outlines import load_font
from glyphs.soiling.soils import SOILS
from glyphs.stamping.faces import default_die
from glyphs.stamping.stamp import stamp_line
from pipeline.common.settings import ReadSettings
from pipeline.formats.part_files import PartFiles
from pipeline.formats.synth import SynthSpec, write_part
from pipeline.reading.part_job import PartJob, read_listed
from pipeline.workers.pool import WorkPool
from tests.benchmarks.one_core import TEXT
from tests.support.trace_frame import trace_contact
from whisker_array.simulation.pointwise import trace_pointwise
from whisker_array.simulation.surface import prepare_surface
from whisker_array.whisker.touch import default_touch

pytestmark = pytest.mark.benchmark

CONTACT_SAMPLES_PER_S = 5e6
POINTWISE_COPIES = 5.0
EDGE_MAP_S = 0.020
MOST_GROWTH = 1.5
READER_BYTES = 1e9
HEIGHT_MAP_S = 0.250
COLD_S, HELP_S = 2.5, 0.5
COMPILING_S = 15.0
TWO_PROCESSES = 1.8
SIDE = 4000


@contextmanager
def threads(count: int) -> Iterator[None]:
    before = numba.get_num_threads()
    numba.set_num_threads(min(count, numba.config.NUMBA_NUM_THREADS))
    try:
        yield
    finally:
        numba.set_num_threads(before)


def test_contact_samples(benchmark: BenchmarkFixture) -> None:
    """A stamped plate with all its texture, in the steps of the default plan, on two threads."""
    font = load_font("gothic")
    part = stamp_line(TEXT, font, default_die(5.0, font=font), height_mm=5.0, rng=np.random.default_rng(1))
    touch = default_touch(5.0)
    surface = prepare_surface(part.height_map, tip_radius_mm=touch.tip_radius_mm, friction=touch.friction)
    width, height = part.height_map.size_mm
    lines, step = np.arange(0.2, height - 0.2, 5.0 / 80), 5.0 / 80
    n = int(width / step)

    def run() -> int:
        return trace_contact(
            surface, touch.tip, lines_mm=lines, start_mm=0.0, step_mm=step, n_samples=n,
            preload_mm=touch.preload_mm, nominal_friction=touch.friction,
        ).moment_n_mm.size  # fmt: skip

    with threads(2):
        size = benchmark.pedantic(run, rounds=15, warmup_rounds=2)
    rate = size / benchmark.stats.stats.min
    benchmark.extra_info["million_samples_per_s"] = round(rate / 1e6, 2)
    assert rate >= CONTACT_SAMPLES_PER_S


@pytest.mark.parametrize("friction", ["number", "map"])
def test_pointwise_against_copying(benchmark: BenchmarkFixture, friction: str) -> None:
    """Moments and flags of 4000 x 4000 samples against a copy of their heights."""
    slope = np.random.default_rng(2).normal(0.0, 0.02, (SIDE, SIDE)).astype(np.float32)
    heights = 0.05 * np.cumsum(slope, axis=1, dtype=np.float32)
    mu: float | np.ndarray = 0.2 if friction == "number" else np.full_like(heights, 0.2)
    touch = default_touch(5.0)

    def run() -> int:
        return trace_pointwise(heights, touch.tip, step_mm=0.05, preload_mm=1.0, friction=mu).flags.size

    with threads(2):
        assert benchmark.pedantic(run, rounds=7, warmup_rounds=1) == SIDE * SIDE
    copies = []
    for _ in range(7):
        start = time.perf_counter()
        heights.copy()
        copies.append(time.perf_counter() - start)
    ratio = benchmark.stats.stats.min / min(copies)
    benchmark.extra_info["times_a_copy"] = round(ratio, 2)
    assert ratio <= POINTWISE_COPIES


@contextmanager
def one_core(name: str, *, threads: str | None = "1") -> Iterator[subprocess.Popen[str]]:
    """A process of `one_core.py`; without a number of threads, as a user's environment has it."""
    names = [f"{library}_NUM_THREADS" for library in ("OMP", "OPENBLAS", "MKL", "NUMBA")]
    one = dict.fromkeys(names, threads) if threads is not None else {}
    with subprocess.Popen(
        [sys.executable, str(Path(__file__).with_name("one_core.py")), name],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        cwd=Path(__file__).parents[2],
        env={**os.environ, **one, "PYTHONPATH": str(Path(__file__).parents[2])},
    ) as process:
        try:
            assert process.stdout.readline().strip() == "ready"
            yield process
        finally:
            process.stdin.close()
            process.wait(timeout=60)


def ask(process: subprocess.Popen[str]) -> str:
    process.stdin.write("\n")
    process.stdin.flush()
    return process.stdout.readline().strip()


@pytest.mark.parametrize(
    ("what", "limit_s"),
    [("scan_sure", 0.120), ("scan_unsure", 0.600), ("photo_sure", 0.080), ("photo_unsure", 0.500)],
)
def test_reading_on_one_core(benchmark: BenchmarkFixture, what: str, limit_s: float) -> None:
    """Eight characters, font and height unknown, the slowest of the parts; each by its quickest round."""
    parts = 1 if what.endswith("_sure") else len(SOILS)
    answers: dict[str, list[float]] = {}
    decisions = []
    with one_core(what) as process:
        for _ in range(2 * parts):
            ask(process)

        def read_all() -> None:
            for _ in range(parts):
                seconds, decision, *text = ask(process).split()
                answers.setdefault(" ".join(text), []).append(float(seconds))
                decisions.append(decision)

        benchmark.pedantic(read_all, rounds=7)
    quickest = [min(seconds) for seconds in answers.values()]
    benchmark.extra_info["slowest_s"] = round(max(quickest), 3)
    benchmark.extra_info["median_s"] = round(float(np.median(quickest)), 3)
    benchmark.extra_info["accepted"] = decisions.count("accept") / len(decisions)
    print(what, benchmark.extra_info)
    assert (decisions.count("accept") == len(decisions)) == what.endswith("_sure")
    assert max(quickest) <= limit_s


def test_reading_beside_three_busy_processes(benchmark: BenchmarkFixture) -> None:
    """Threads that spin while they wait would cost the others: the same work costs as many processor seconds."""
    work = ["photo_unsure", "scan_unsure"]

    def spent() -> float:
        total = 0.0
        for what in work:
            with one_core(what, threads=None) as process:
                total += sum(float(ask(process).split()[0]) for _ in SOILS)
        return total

    alone = spent()
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(3)]
    try:
        beside = benchmark.pedantic(spent, rounds=1)
    finally:
        for process in busy:
            process.kill()
            process.wait()
    benchmark.extra_info["growth"] = round(beside / alone, 2)
    print("busy", alone, beside)
    assert beside <= MOST_GROWTH * alone


@pytest.mark.parametrize("what", ["scan_unsure", "photo_unsure", "read_coins"])
def test_memory_of_a_reader(benchmark: BenchmarkFixture, what: str) -> None:
    """The most that a process has held which reads parts of all soils, or height maps of coins."""
    with one_core(what) as process:
        benchmark.pedantic(lambda: [ask(process) for _ in SOILS], rounds=1)
        status = Path(f"/proc/{process.pid}/status").read_text()
    (peak,) = (line.split()[1] for line in status.splitlines() if line.startswith("VmHWM:"))
    benchmark.extra_info["peak_mb"] = round(int(peak) / 1024)
    print(what, benchmark.extra_info)
    assert int(peak) * 1024 <= READER_BYTES


def test_edge_map_on_one_core(benchmark: BenchmarkFixture) -> None:
    """From raw moments of four directions to the map of an eight character part; part of the reading's time."""
    with one_core("edge_map") as process:
        answer = benchmark.pedantic(ask, args=(process,), rounds=9, warmup_rounds=1)
    assert answer.count("x") == 1
    assert benchmark.stats.stats.min <= EDGE_MAP_S


def test_reading_a_height_map_on_one_core(benchmark: BenchmarkFixture) -> None:
    """Mounting and a virtual scan by contact in four directions included."""
    with one_core("read_height_map") as process:
        answer = benchmark.pedantic(ask, args=(process,), rounds=9, warmup_rounds=1)
    text, *steps = answer.split(" ", 1)
    benchmark.extra_info["steps"] = " ".join(steps)
    assert text == TEXT
    assert benchmark.stats.stats.min <= HEIGHT_MAP_S


@pytest.mark.parametrize(("what", "limit_s"), [("read", COLD_S), ("--help", HELP_S)])
def test_cold_start(benchmark: BenchmarkFixture, tmp_path: Path, what: str, limit_s: float) -> None:
    """The whole command, kernels compiled by its first round."""
    arguments = [what]
    if what == "read":
        write_part(SynthSpec(format="AA999999", seed=1), tmp_path / "part", 0, photos=False)
        arguments += [str(tmp_path / "part.npz"), "--font", "gothic"]
    command = [sys.executable, "-m", "pipeline", *arguments]

    def run() -> int:
        return subprocess.run(
            command, cwd=Path(__file__).parents[2], capture_output=True, check=True
        ).returncode

    assert benchmark.pedantic(run, rounds=5, warmup_rounds=1) == 0
    assert benchmark.stats.stats.min <= limit_s


def test_first_reading_on_one_core(benchmark: BenchmarkFixture, tmp_path: Path) -> None:
    """Processor seconds of the whole command with no kernel on disk, less those of the next one: compiling."""
    write_part(SynthSpec(format="AA999999", seed=1), tmp_path / "part", 0, photos=False)
    one = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL", "NUMBA")}
    command = [sys.executable, "-m", "pipeline", "read", str(tmp_path / "part.npz"), "--font", "gothic"]
    environment = {**os.environ, **one, "NUMBA_CACHE_DIR": str(tmp_path / "kernels")}

    def run() -> float:
        before = os.times()
        subprocess.run(
            command, cwd=Path(__file__).parents[2], env=environment, capture_output=True, check=True
        )
        after = os.times()
        return after.children_user - before.children_user + after.children_system - before.children_system

    first_s = benchmark.pedantic(run, rounds=1)
    compiling_s = first_s - run()
    benchmark.extra_info["compiling_s"] = round(compiling_s, 1)
    assert compiling_s <= COMPILING_S


def test_two_processes_against_one(benchmark: BenchmarkFixture, tmp_path: Path) -> None:
    """Parts a second of two workers over those of one, both warm; the quickest of some rounds of each."""
    spec = SynthSpec(format="AA999999", seed=1, font="gothic")
    for number in range(20):
        write_part(spec, tmp_path / f"part-{number}", number, photos=False)
    job = PartJob(settings=ReadSettings(font=("gothic",), format=("AA999999",), height_mm=5.0))
    listed = [PartFiles(f"{p.stem} {k}", height_map=str(p)) for k in range(4) for p in tmp_path.glob("*.npz")]
    quickest: dict[int, float] = {}
    for jobs in (1, 2):
        with WorkPool(jobs) as executor:

            def run(executor: WorkPool = executor) -> float:
                started = time.perf_counter()
                outcomes = list(executor.calls(read_listed, job, listed))
                assert all(o.result is not None and o.result.record.text for o in outcomes)
                return time.perf_counter() - started

            run()
            quickest[jobs] = min(run() for _ in range(4))
            if jobs == 2:
                benchmark.pedantic(run, rounds=1)
    benchmark.extra_info["parts_per_s"] = {jobs: round(len(listed) / s, 2) for jobs, s in quickest.items()}
    benchmark.extra_info["ratio"] = round(quickest[1] / quickest[2], 3)
    print(benchmark.extra_info)
    assert quickest[1] / quickest[2] >= TWO_PROCESSES


# --- parts of an exam: 8 characters of 5 mm, severity 0.6, memory kept as the exam's workers keep it

PART_S = 0.250
ROUNDS = 9


SLOWER = {
    "rust": "contact with what yields takes twice the time of bare contact",
    "mud": "contact with what yields takes twice the time of bare contact",
    "workshop": "its seven kinds draw some twenty random fields, and contact with what yields takes twice the time",
}
"""Soils for which the target is not reached yet on a machine that is busy, and why."""


@pytest.mark.parametrize(
    "soil",
    [
        "paint",
        "wear",
        "weld",
        *(pytest.param(s, marks=pytest.mark.xfail(reason=why, strict=False)) for s, why in SLOWER.items()),
    ],
)
def test_making_and_feeling_a_part_on_one_core(benchmark: BenchmarkFixture, soil: str) -> None:
    """Stamped, soiled, photographed, and scanned by contact in four directions."""
    answers: list[dict[str, float]] = []
    with one_core(f"exam_{soil}") as process:

        def make() -> None:
            words = (word.partition("=") for word in ask(process).split())
            answers.append({step: float(seconds) for step, _, seconds in words})

        benchmark.pedantic(make, rounds=ROUNDS, warmup_rounds=2)
    quickest = min(answers, key=lambda steps: sum(steps.values()))
    benchmark.extra_info["steps"] = quickest
    print(soil, quickest, round(sum(quickest.values()), 3))
    assert set(quickest) == {"make", "photo", "scan"}
    assert sum(quickest.values()) <= PART_S
