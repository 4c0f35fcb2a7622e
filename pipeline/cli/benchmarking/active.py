"""`tactile-marks benchmark --active`: what a serial costs in stage seconds."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pipeline.benchmark.exam.specimens import Item, Parts
    from pipeline.benchmark.stage_time.trial import TouchTrial

BUDGET_S = 90.0
"""Most stage seconds of a part that is felt actively."""


def compare_plans(source: Parts, *, out: Path, seed: int, jobs: int) -> int:
    """Read parts by touch that chooses, by uniform and by random plans; write active.csv and active.html.

    Args:
        source: of the parts.
        out: folder for the table and the page.
        seed: of sensors and of random plans.
        jobs: worker processes.
    """
    from functools import partial

    from pipeline.benchmark.report.page import check_report
    from pipeline.benchmark.report.writing import command_line
    from pipeline.benchmark.stage_time.report import level_text, write_page, write_table
    from pipeline.benchmark.stage_time.trial import results
    from pipeline.workers.executors import ordered_map
    from pipeline.workers.options import ExecutorOptions

    check_report()
    items = source.items()
    out.mkdir(parents=True, exist_ok=True)
    with ExecutorOptions(jobs).opened(len(items)) as executor:
        found = ordered_map(executor, partial(_read, source, seed), items)
        tried: list[TouchTrial] = []
        for number, rows in enumerate(found, start=1):
            tried += rows
            print(f"\r{number} of {len(items)} parts", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    write_table(out / "active.csv", tried)
    write_page(
        out / "active.html", tried, title="What a serial costs in stage seconds", command=command_line()
    )
    for severity in sorted({t.severity for t in tried if t.severity is not None}):
        print(f"\ndirt {severity:g}")
        for row in results(tried, severity=severity):
            print(
                f"  {row.plan.name:8} {level_text(row):32} {row.stage_s:6.1f} s  "
                f"accepted {row.accepted} of {row.n}, {row.wrong} of them wrong"
            )
    print(f"wrote {out / 'active.csv'} and {out / 'active.html'}")
    return 0


def _read(source: Parts, seed: int, item: Item) -> list[TouchTrial]:
    from pipeline.benchmark.stage_time.trial import PLANS, trials

    return list(trials(source, [item], plans=PLANS, seed=seed, budget_s=BUDGET_S))
