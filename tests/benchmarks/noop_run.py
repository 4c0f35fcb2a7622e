"""Parts a second of a run whose reader does nothing: what lists, workers, journal and table cost by themselves.

    python tests/benchmarks/noop_run.py --parts 10000 --workers 2

Every part is a file of one byte; a worker answers with a record that a clean part would have. Shows the seconds, the
parts a second, and the most memory that the command and a worker took. Ends with status 1 where the table lacks a row.
"""

from __future__ import annotations

import argparse
import resource
import sys
import tempfile
import time
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import pipeline.runs.run as run_module
from pipeline.common.reading_records import CandidateRecord, CharacterRecord, ReadingRecord
from pipeline.common.settings import ReadSettings
from pipeline.common.version import program_version
from pipeline.formats.part_files import PartFiles
from pipeline.reading.part_job import PartJob
from pipeline.reading.triage import ReadPart
from pipeline.runs.options import RunOptions
from pipeline.runs.run import open_run
from pipeline.workers.pool import WorkPool

_PLACE = CharacterRecord(
    (CandidateRecord("A", 0.99, 0.9), CandidateRecord("4", 0.01, 0.5)), (0.0, 0.0, 3.5, 5.0), "read"
)
_READ = ReadingRecord(
    "tactile", "A" * 8, "accept", 0.99, (_PLACE,) * 8, font="stamp-sans", height_mm=5.0, seconds=0.1
)


def read_nothing(_: PartJob, part: PartFiles) -> ReadPart:
    """A record of eight characters for any part, without opening its files."""
    return ReadPart((replace(_READ, part=part.name, at=datetime.now(UTC), program=program_version()),))


def main() -> int:
    """Run, and print one line."""
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    arguments.add_argument("--parts", type=int, default=10_000)
    arguments.add_argument("--workers", type=int, default=2)
    asked = arguments.parse_args()
    run_module.read_listed = read_nothing  # type: ignore[assignment]
    with tempfile.TemporaryDirectory() as folder:
        table = Path(folder) / "rows.csv"
        parts = [PartFiles(f"part-{i:06d}", f"{folder}/part-{i:06d}.npz") for i in range(asked.parts)]
        with (
            WorkPool(asked.workers) as pool,
            open_run(RunOptions(out=str(table)), {"noop": asked.parts}) as run,
        ):
            pool.submit(bool).result()  # a worker is there
            began_s, began_cpu_s = time.perf_counter(), time.process_time()
            run.work(parts, PartJob(settings=ReadSettings()), pool)
            took_s = time.perf_counter() - began_s
            cpu_s = time.process_time() - began_cpu_s
        rows = len(table.read_text().splitlines()) - 1
    own, workers = map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    print(
        f"{rows} parts in {took_s:.2f} s: {rows / took_s:.0f} a second; "
        f"processor time of the command {1e6 * cpu_s / rows:.0f} us a part, "
        f"of the workers with their start {workers.ru_utime + workers.ru_stime:.2f} s in all; "
        f"command {own.ru_maxrss / 1024:.0f} MB, a worker {workers.ru_maxrss / 1024:.0f} MB"
    )
    return 0 if rows == asked.parts else 1


if __name__ == "__main__":
    sys.exit(main())
