"""A night's production: how fast many parts are read, and what memory it takes from its beginning to its end.

    python tests/benchmarks/night.py --parts 10000 --distinct 100 --jobs 2
    python tests/benchmarks/night.py --parts 400 --jobs 1 2 --dirt 0.3          # what a second process brings
    python tests/benchmarks/night.py --parts 400 --jobs 2 --scans               # recorded scans in place of height maps

A few distinct parts are made and stand in a folder under many names. Memory is sampled every second: that of the
command itself, and of the largest of its workers. The rate is that of the command's own summary, in which libraries
and templates are loaded in the first seconds. Set NUMBA_NUM_THREADS=1 to keep a run of one job to one core.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

TREE = Path(__file__).parents[2]
PAGE_MB = os.sysconf("SC_PAGE_SIZE") / 1e6


def main() -> None:
    """Make the parts, read them with each number of jobs, print a line for each."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--parts", type=int, default=400)
    parser.add_argument("--distinct", type=int, default=40)
    parser.add_argument("--jobs", type=int, nargs="+", default=[2])
    parser.add_argument("--dirt", type=float, default=0.0)
    parser.add_argument("--scans", action="store_true", help="read recorded scans in place of height maps")
    parser.add_argument("--photos", action="store_true", help="read photographs in place of height maps")
    parser.add_argument("--out", default="rows.parquet", help="name of the table, or URL of a store")
    parser.add_argument("--height-mm", type=float, default=5.0)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="tactile-marks-") as name:
        folder = Path(name)
        make(folder, given)
        for jobs in given.jobs:
            read(folder, given, jobs)


def run(folder: Path, *arguments: str) -> None:
    """A command, to its end."""
    subprocess.run(
        [sys.executable, "-m", "pipeline", *arguments],
        cwd=folder, env={**os.environ, "PYTHONPATH": str(TREE)}, check=True, stdout=subprocess.DEVNULL,
    )  # fmt: skip


def make(folder: Path, given: argparse.Namespace) -> None:
    """Distinct parts, and names for them."""
    made = ("--parts", str(given.distinct), "--format", "AA999999", "--font", "gothic", "--seed", "5")
    run(folder, "synth", "made", *made, "--height-mm", str(given.height_mm), "--dirt", str(given.dirt))
    suffix = ".png" if given.photos else ".npz"
    if given.scans:
        suffix = ".h5"
        for number in range(given.distinct):
            stem = f"made/part-{number:03d}"
            run(folder, "scan", f"{stem}.npz", "--out", f"{stem}.h5", "--height-mm", str(given.height_mm))
    (folder / "parts").mkdir()
    for number in range(given.parts):
        source = folder / "made" / f"part-{number % given.distinct:03d}{suffix}"
        (folder / "parts" / f"part-{number:06d}{suffix}").symlink_to(source)


def read(folder: Path, given: argparse.Namespace, jobs: int) -> None:
    """One run, watched."""
    arguments = [
        *("read", "parts", "--font", "gothic", "--format", "AA999999", "--height-mm", str(given.height_mm)),
        *("--jobs", str(jobs), "--out", given.out, "--summary", "summary.json"),
    ]
    started = time.monotonic()
    process = subprocess.Popen(
        [sys.executable, "-m", "pipeline", *arguments],
        cwd=folder, env={**os.environ, "PYTHONPATH": str(TREE)}, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    )  # fmt: skip
    own: list[float] = []
    workers: list[float] = []
    while process.poll() is None:
        own.append(memory_mb(process.pid))
        workers.append(max((memory_mb(pid) for pid in children(process.pid)), default=0.0))
        time.sleep(1.0)
    elapsed = time.monotonic() - started
    told = json.loads((folder / "summary.json").read_text())
    tenth = max(1, len(own) // 10)
    own_s = told["elapsed_s"]
    rate, each = told["read_now"] / own_s, told["seconds"] / told["parts"]
    decisions = ", ".join(f"{told[kind]} {kind}" for kind in ("accept", "review", "reject", "errors"))
    lines = (
        f"{given.parts:,} parts, {jobs} jobs, status {process.returncode}: {decisions}",
        f"  {rate:.2f} a second ({own_s:.1f} s; {elapsed:.1f} s with start and end), {each:.3f} s of work each",
        f"  command: {max(own[:tenth]):.0f} MB in the first tenth, {max(own):.0f} MB at most",
        f"  a worker: {max(workers[: 2 * tenth]):.0f} MB in the first fifth, {max(workers):.0f} MB at most",
    )
    print("\n".join(lines), flush=True)


def children(pid: int) -> list[int]:
    """Processes started by a process."""
    return [int(p) for f in Path(f"/proc/{pid}/task").glob("*/children") for p in read_text(f).split()]


def memory_mb(pid: int) -> float:
    """Resident memory that a process does not share."""
    words = read_text(Path(f"/proc/{pid}/statm")).split()
    return (int(words[1]) - int(words[2])) * PAGE_MB if words else 0.0


def read_text(path: Path) -> str:
    """A file of /proc, which may be gone."""
    try:
        return path.read_text()
    except (FileNotFoundError, ProcessLookupError):
        return ""


if __name__ == "__main__":
    main()
