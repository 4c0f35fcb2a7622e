"""`tactile-marks benchmark --active`: what a serial costs in stage seconds."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pipeline.benchmark.trials.journal import Trial


def show_plans(trials: Sequence[Trial], out: Path) -> None:
    """Print what each plan of touch costs and brings; write the table, the page and the picture.

    Args:
        trials: by plans of touch.
        out: folder for active.csv, active.html and active.png.
    """
    from pipeline.benchmark.report.stage_time import by_severity, write_stage_time
    from pipeline.benchmark.report.writing import command_line

    written = write_stage_time(
        trials, out, title="What a serial costs in stage seconds", command=command_line()
    )
    for severity, rows in by_severity(trials):
        print("\nall parts" if severity is None else f"\ndirt {severity:g}")
        for row in rows:
            print(
                f"  {row.plan.name:8} {row.plan.level_text:32} {row.stage_s:6.1f} s (median {row.median_s:.1f})  "
                f"accepted {row.accepted} of {row.n}, {row.wrong} of them wrong; {row.right} right"
            )
    print(f"wrote {', '.join(map(str, written[:-1]))} and {written[-1]}")
