"""What a run costs beside reading: parts a second with a reader that does nothing, and memory of the command.

PYTHONPATH=. python tests/benchmarks/no_op.py --parts 10000 --jobs 2 --out rows.csv
"""

from __future__ import annotations

import argparse
import resource
import tempfile
import time
from dataclasses import replace
from pathlib import Path

from pipeline.common.reading_records import CandidateRecord, CharacterRecord, ReadingRecord
from pipeline.common.settings import ReadSettings
from pipeline.formats.part_files import PartFiles
from pipeline.runs import run as run_module
from pipeline.runs.options import RunOptions
from pipeline.runs.task import ReadPart, RunOrder
from pipeline.workers.options import ExecutorOptions

BOX = (0.0, 0.0, 3.0, 5.0)
PLACES = tuple(
    CharacterRecord((CandidateRecord(char, 0.99), CandidateRecord("X", 0.01)), BOX) for char in "AB123456"
)
RECORD = ReadingRecord("tactile", "AB123456", "accept", 0.99, PLACES, font="gothic", height_mm=5.0)


def read(_: RunOrder, listed: PartFiles) -> ReadPart:
    """Give the same record for every part."""
    return ReadPart(replace(RECORD, part=listed.name))


def main() -> None:
    """Run, and print a line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--parts", type=int, default=10_000)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--out", default="rows.csv")
    given = parser.parse_args()
    parts = [PartFiles(f"part-{k:06d}", f"part-{k:06d}.npz") for k in range(given.parts)]
    run_module.read_listed = read
    order = RunOrder(ReadSettings())
    with tempfile.TemporaryDirectory() as folder, ExecutorOptions(given.jobs).opened() as executor:
        list(executor.calls(read, order, parts[: 2 * given.jobs]))  # the workers have started
        with run_module.opened(RunOptions(out=str(Path(folder) / given.out)), {}) as run:
            began = time.perf_counter()
            run.work(parts, order, executor)
            took_s = time.perf_counter() - began
    memory_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    print(f"{given.parts:,} parts: {given.parts / took_s:,.0f} a second; the command took {memory_mb:.0f} MB")


if __name__ == "__main__":
    main()
