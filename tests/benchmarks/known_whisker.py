"""Knowledge of a whisker that reading needs: characters read where one number is taken for another, as a picture::

    python -m tests.benchmarks.known_whisker --parts 60 --seed 2100 --out known.svg

Every part, drawn as those of the exam but of no font or dirt that it keeps out, is felt once by the usual plan on the
default bench, and read by touch, with the format of its serials, as if the whisker were another: gains wrong by so much
(every whisker's its own), the beam set at another angle, another friction, another tip. `as identified` and `as drawn`
have all numbers wrong at once, as `identify` leaves them (`IDENTIFIED`) and as a workshop knows them before.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tests.benchmarks.paired import Trial, lost, table, tried
from whisker_array.identification.bench import Unknown, nominal_bench, prior_sd
from whisker_array.scan.calibration import Calibration
from whisker_array.whisker.defaults import default_whisker
from whisker_array.whisker.touch import Touch, default_touch

if TYPE_CHECKING:
    from pipeline.benchmark.exam.specimens import Specimen
    from whisker_array.scan.scan import Scan

KNOWN = "known"
GAIN = "gain"
LEVELS: dict[str, tuple[float, ...]] = {
    GAIN: (0.02, 0.05, 0.1, 0.2),
    Unknown.BETA: (2.0, 5.0, 10.0),
    Unknown.FRICTION: (0.05, 0.1, 0.2),
    Unknown.RADIUS: (0.25, 0.5, 1.0),
}
"""Errors that are tried: shares of gain and radius, degrees, friction."""
UNITS = {
    GAIN: "gain, %",
    Unknown.BETA: "beta, degrees",
    Unknown.FRICTION: "friction",
    Unknown.RADIUS: "tip radius, %",
}
IDENTIFIED = {GAIN: 0.005, Unknown.BETA: 0.5, Unknown.FRICTION: 0.002, Unknown.RADIUS: 0.06}
"""Standard deviations that identify leaves, of `tests.benchmarks.identify_benches`."""


def taken_for_others(part: Specimen, seed: int) -> Iterator[tuple[str, Scan]]:
    """The part felt once, and the scan as if the whisker were known, and others."""
    rng = np.random.default_rng(seed)
    height_mm = part.height_mm or 5.0
    return _ways(felt(part, default_touch(height_mm), rng=rng), height_mm, rng)


def felt(part: Specimen, touch: Touch, *, rng: np.random.Generator) -> Scan:
    """The part as whiskers that meet it so feel it on the usual plan, their gains known."""
    from recognition.views.levelling import level
    from whisker_array.scan.scan import trace_scan
    from whisker_array.scan.sensor import draw_sensor_chain
    from whisker_array.scan.stage_play import draw_stage_play
    from whisker_array.whisker.array import default_plan

    plan = default_plan((0.0, 0.0, *part.height_map.size_mm), character_height_mm=part.height_mm or 5.0)
    n = plan.array.n_whiskers
    chain = draw_sensor_chain(n, rng=rng, full_scale_n_mm=3.0 * abs(touch.land_moment_n_mm()))
    scan = trace_scan(
        level(part.height_map), touch=touch, plan=plan, sensor=chain, stage=draw_stage_play(rng=rng), rng=rng,
        soil=part.soil,
    )  # fmt: skip
    return replace(scan, calibration=Calibration(chain.gain, np.zeros(n)))


def _ways(scan: Scan, height_mm: float, rng: np.random.Generator) -> Iterator[tuple[str, Scan]]:
    yield KNOWN, scan
    side, lots = float(rng.choice((-1.0, 1.0))), rng.standard_normal((3, scan.n_whiskers))
    for name, levels in LEVELS.items():
        for off in levels:
            # half of the parts to either side; a radius that is halved is one that is doubled the other way
            yield f"{name} {off:g}", _taken(scan, height_mm, {name: side * off}, gains=off * lots[0])
    nominal = nominal_bench(default_whisker(height_mm), scan.touch, n_whiskers=1)
    sds = dict(zip(Unknown, prior_sd(nominal), strict=False))
    drawn = {
        Unknown.BETA: sds[Unknown.BETA],
        Unknown.FRICTION: sds[Unknown.FRICTION],
        Unknown.RADIUS: sds[Unknown.RADIUS] / scan.touch.tip_radius_mm,
    }
    for way, known, gain in (("as identified", IDENTIFIED, IDENTIFIED[GAIN]), ("as drawn", drawn, 0.03)):
        all_off: dict[str, float] = {
            name: float(known[name]) * lot
            for name, lot in zip((Unknown.BETA, Unknown.FRICTION, Unknown.RADIUS), lots[2], strict=False)
        }
        yield way, _taken(scan, height_mm, {**all_off, GAIN: gain}, gains=gain * lots[1])


def _taken(scan: Scan, height_mm: float, off: dict[str, float], *, gains: np.ndarray) -> Scan:
    """The scan of a whisker that is taken for another."""
    touch, known = scan.touch, scan.calibration
    assert known is not None
    if turned := off.get(Unknown.BETA):
        whisker = default_whisker(height_mm)
        whisker = replace(whisker, beta_rad=whisker.beta_rad + math.radians(turned))
        touch = replace(touch, tip=whisker.tip_model())
    if rubs := off.get(Unknown.FRICTION):
        touch = replace(touch, friction=max(0.0, touch.friction + rubs))
    if wider := off.get(Unknown.RADIUS):
        radius = touch.tip_radius_mm
        touch = replace(
            touch, tip_radius_mm=radius * (1.0 + wider) if wider > 0.0 else radius / (1.0 - wider)
        )
    if GAIN in off:
        known = replace(known, gain=known.gain * np.maximum(0.1, 1.0 + gains))
    return replace(scan, touch=touch, calibration=known)


def draw(trials: Sequence[Trial], path: Path) -> None:
    """Characters lost against how wrong each number is taken, and its interval."""
    from matplotlib.figure import Figure

    from glyphs.atomic import replacing

    figure = Figure(figsize=(9.0, 2.8), dpi=110, layout="constrained")
    axes = figure.subplots(1, len(LEVELS), sharey=True)
    severity = trials[0].severity
    for axis, (name, levels) in zip(axes, LEVELS.items(), strict=True):
        scale = 100.0 if "%" in UNITS[name] else 1.0
        losses = [lost(trials, f"{name} {off:g}", against=KNOWN) for off in levels]
        axis.errorbar(
            [scale * off for off in levels], [mean for mean, _ in losses], [half for _, half in losses],
            marker="o", markersize=3, capsize=2,
        )  # fmt: skip
        axis.axhline(0.0, color="0.7", linewidth=0.8)
        axis.set_xlabel(f"wrong by: {UNITS[name]}")
        axis.set_xlim(0.0, None)
    axes[0].set_ylabel(f"points of characters lost\nat dirt {severity:g}")
    with replacing(path) as temporary:
        figure.savefig(
            temporary, format=path.suffix[1:], metadata={"Date": None} if path.suffix == ".svg" else None
        )


def main(*, parts: int = 60, seed: int = 2100, dirt: float = 0.3, out: Path = Path("known.svg")) -> None:
    """Measure, say what was found, and draw it.

    Args:
        parts: how many.
        seed: of the parts.
        dirt: 0 to 1.
        out: picture.
    """
    trials = list(tried(parts, seed, dirt, taken_for_others))
    print("\n".join(table(trials, against=KNOWN)))
    draw(trials, out)


if __name__ == "__main__":
    from cyclopts import run

    run(main)
