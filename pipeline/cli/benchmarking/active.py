"""`tactile-marks benchmark --active`: what a serial costs in stage seconds."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pipeline.benchmark.exam.specimens import Parts

BUDGET_S = 90.0
"""Most stage seconds of a part that is felt actively."""


def compare_plans(source: Parts, *, out: Path, seed: int, jobs: int) -> int:
    """Read parts by touch that chooses, by uniform and random plans and the whole one; write the table and the page.

    A run that was broken off goes on where it ended.

    Args:
        source: of the parts.
        out: folder for active.csv, active.html and active.png.
        seed: of sensors and of random plans.
        jobs: worker processes.
    """
    from pipeline.benchmark.report.writing import command_line
    from pipeline.benchmark.stage_time.report import level_text, write_curves, write_page, write_table
    from pipeline.benchmark.stage_time.run import Comparison, compare
    from pipeline.benchmark.stage_time.trial import PLANS, results
    from pipeline.runs.progress import Progress
    from pipeline.workers.options import ExecutorOptions

    comparison = Comparison(source, seed, BUDGET_S, PLANS)
    with Progress() as progress, ExecutorOptions(jobs).opened(len(source.items())) as executor:
        tried = compare(
            comparison,
            out,
            executor=executor,
            on_start=progress.start,
            on_part=lambda _: progress.advance(),
        )
    write_table(out / "active.csv", tried)
    write_page(
        out / "active.html", tried, title="What a serial costs in stage seconds", command=command_line()
    )
    write_curves(out / "active.png", tried)
    severities = sorted({t.severity for t in tried if t.severity is not None})
    for severity in (*severities, None):
        print("\nall parts" if severity is None else f"\ndirt {severity:g}")
        for row in results(tried, severity=severity):
            print(
                f"  {row.plan.name:8} {level_text(row):32} {row.stage_s:6.1f} s (median {row.median_s:.1f})  "
                f"accepted {row.accepted} of {row.n}, {row.wrong} of them wrong; {row.right} right"
            )
    print(f"wrote {out / 'active.csv'}, {out / 'active.html'} and {out / 'active.png'}")
    return 0
