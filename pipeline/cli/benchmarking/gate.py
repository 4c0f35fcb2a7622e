"""`tactile-marks benchmark gate`: read the smallest edition, and fail where anything is read worse than before."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from pipeline.cli.exit_status import CommandError, failures_reported


def gate(
    *,
    jobs: int = 1,
    camera: Annotated[bool, Parameter(negative="")] = False,
    raise_floors: Annotated[bool, Parameter(name="--raise", negative="")] = False,
    out: Path | None = None,
) -> int:
    """Read the edition marks-exam-1-48 and fail if anything is read worse than its floors allow.

    Parameters
    ----------
    jobs
        Worker processes.
    camera
        Read the photographs, too, and fuse: about twice as long.
    raise_floors
        Tighten the floors to what is found; none is ever loosened. Commit the file by itself.
    out
        Keep the trials in this folder, for `benchmark compare`; they are thrown away unless given.
    """
    with failures_reported():
        from pipeline.benchmark.analysis.gate import (
            CAMERA_MODES,
            EDITION,
            FLOORS_FILE,
            MODES,
            counts_of,
            load_floors,
            objections,
            raised,
            save_floors,
        )
        from pipeline.benchmark.exam.designed_parts import DesignedParts
        from pipeline.benchmark.exam.editions import design_named
        from pipeline.benchmark.trials.run import Benchmark, run_benchmark
        from pipeline.workers.options import ExecutorOptions
        from recognition.language.orientation import Orientation
        from recognition.senses.settings import ReaderSettings

        modes = MODES + CAMERA_MODES if camera else MODES
        benchmark = Benchmark(
            DesignedParts(design_named(EDITION)), modes, ReaderSettings(orientation=Orientation.UPRIGHT)
        )
        start = time.perf_counter()
        with (
            tempfile.TemporaryDirectory() as scratch,
            ExecutorOptions(jobs).opened(len(benchmark.parts.items())) as executor,
        ):
            trials = run_benchmark(benchmark, out or Path(scratch), executor=executor)
        seconds = time.perf_counter() - start
        found, floors = counts_of(trials), load_floors()
        n = len({t.part for t in trials})
        print(f"{EDITION}: {n} parts in {seconds:.0f} s")
        for mode, c in found.items():
            print(
                f"{mode:16} characters {c.characters}, serials {c.serials}, accepted {c.accepted}, "
                f"wrong {c.accepted_wrong}"
            )
        if raise_floors:
            save_floors(raised(found, floors), FLOORS_FILE)
            print(f"wrote {FLOORS_FILE}")
            return 0
        if worse := objections(found, floors):
            raise CommandError("worse than the floors: " + "; ".join(worse))
        print("no worse than the floors")
    return 0
