"""Whether unknown benches are identified, and whether their intervals hold.

    python -m tests.benchmarks.identify_benches --benches 200 --jobs 2 --out benches.jsonl

Every number of a bench is drawn as a workshop knows it before (`bench.prior_sd`); the stage's screw is as it is bought,
which the fit knows nothing of. One recording a bench, of a piece with three pits. Of
every second bench a weight has shown the gains. What is in the file already is not done again.
"""

from __future__ import annotations

import json
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from glyphs.errors import MarksError
from tests.support.benches import HiddenBench, hidden_bench
from whisker_array.identification.bench import Bench, Unknown
from whisker_array.identification.fit import identify
from whisker_array.identification.forward import GRID_MM

WIDE = 1.96
ASKED = {Unknown.FRICTION: 0.01, Unknown.BETA: 0.5}
ASKED_SHARE = {Unknown.RADIUS: 0.15, "tip": 0.02}
"""The most that a number may be off, and of its own value."""


def tip_stiffness(bench: Bench, of: HiddenBench) -> float:
    """N/mm, upwards: what sets the moment with the gain."""
    return float(1.0 / bench.touch(of.drawn).tip.compliance_mm_per_n[1, 1])


def tried(seed: int, *, grid_mm: float) -> dict[str, Any]:
    """One bench: of every number what is true, found, and its standard deviation."""
    hidden = hidden_bench(seed, gains_shown=seed % 2 == 1)
    began = time.perf_counter()
    try:
        found = identify(hidden.scan, hidden.heights, whisker=hidden.drawn, grid_mm=grid_mm)
    except MarksError as error:
        return {"seed": seed, "refused": str(error)}
    row: dict[str, Any] = {
        "seed": seed,
        "fit_s": time.perf_counter() - began,
        "stage_s": hidden.stage_s,
        "settled": found.settled,
        "misfit": found.misfit,
    }
    for i, name in enumerate(Unknown):
        row[name] = (hidden.truth[name], found.bench[name], float(found.sd[i]))
    row["gain 0"] = (float(hidden.truth.gain[0]), float(found.bench.gain[0]), float(found.sd[len(Unknown)]))
    stiffness = partial(tip_stiffness, of=hidden)
    row["tip"] = (stiffness(hidden.truth), stiffness(found.bench), found.sd_of(stiffness))
    return row


def table(rows: list[dict[str, Any]]) -> list[str]:
    """Lines for a person."""
    done = [row for row in rows if "refused" not in row]
    lines = [
        f"{len(done)} benches, {len(rows) - len(done)} refused; settled {sum(r['settled'] for r in done)}; recording "
        f"{np.median([r['stage_s'] for r in done]):.0f} s, fit {np.median([r['fit_s'] for r in done]):.0f} s (median)",
        f"{'':16}{'covered':>9}{'bias':>10}{'rms off':>10}{'worst':>10}{'sd said':>10}   within what is asked",
    ]
    for name in (*Unknown, "gain 0", "tip"):
        true, value, sd = np.array([row[name] for row in done]).T
        scale = true if name in ASKED_SHARE else 1.0
        off = (value - true) / scale
        asked = ASKED.get(name, ASKED_SHARE.get(name))
        held = "" if asked is None else f"{int((np.abs(off) <= asked).sum())} of {off.size} within {asked:g}"
        covered = float(np.mean(np.abs(value - true) <= WIDE * sd))
        lines.append(
            f"{name:16}{100.0 * covered:8.1f}%{off.mean():10.4f}{np.sqrt((off**2).mean()):10.4f}"
            f"{np.abs(off).max():10.4f}{float(np.median(sd / np.abs(scale))):10.4f}   {held}"
        )
    return lines


def main(
    *,
    benches: int = 20,
    seed: int = 0,
    jobs: int = 1,
    grid_mm: float = GRID_MM,
    out: Path = Path("benches.jsonl"),
) -> None:
    """Identify benches, and say how well.

    Args:
        benches: how many.
        seed: of the first.
        jobs: processes.
        grid_mm: of the fit.
        out: where each bench is kept.
    """
    rows = [json.loads(line) for line in out.read_text().splitlines()] if out.exists() else []
    seeds = set(range(seed, seed + benches))
    rows = [row for row in rows if row["seed"] in seeds]
    one = partial(tried, grid_mm=grid_mm)
    with ProcessPoolExecutor(jobs) as pool, out.open("a") as kept:
        for task in as_completed(
            [pool.submit(one, s) for s in sorted(seeds - {row["seed"] for row in rows})]
        ):
            rows.append(task.result())
            kept.write(json.dumps(rows[-1]) + "\n")
            kept.flush()
    for said, rest in (("gains as they come", 0), ("gains shown by a weight", 1)):
        print(said, *table([row for row in rows if row["seed"] % 2 == rest]), sep="\n")


if __name__ == "__main__":
    from cyclopts import run

    run(main)
