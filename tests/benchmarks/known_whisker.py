"""Knowledge of a whisker that reading needs: characters lost where one number is taken for another::

    python -m tests.benchmarks.known_whisker --parts 60 --seed 2100

Every part, drawn as those of the exam but of no font or dirt that it keeps out, is felt once by the usual plan on the
default bench, and read by touch, with the format of its serials, as if the whisker were another: gains wrong by so much
(every whisker's its own), the beam set at another angle, another friction, another tip. `as identified` and `as drawn`
have all numbers wrong at once, as `identify` leaves them (`IDENTIFIED`) and as a workshop knows them before.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest, t

from pipeline.benchmark.exam.designed_parts import DesignedParts
from pipeline.benchmark.exam.specimens import Specimen
from recognition.see.levelling import level
from tests.benchmarks.plan_accuracy import read_right, trial_parts
from tests.support.felt import felt
from whisker_array.identification.bench import Unknown, nominal_bench, prior_sd
from whisker_array.scan.calibration import Calibration
from whisker_array.scan.scan import Scan
from whisker_array.scan.sensor import draw_sensor_chain
from whisker_array.scan.stage_play import draw_stage_play
from whisker_array.whisker.array import default_comb
from whisker_array.whisker.defaults import default_whisker
from whisker_array.whisker.touch import default_touch

KNOWN = "known"
GAIN = "gain"
LEVELS: dict[str, tuple[float, ...]] = {
    GAIN: (0.02, 0.05, 0.1, 0.2),
    Unknown.BETA: (2.0, 5.0, 10.0),
    Unknown.FRICTION: (0.05, 0.1, 0.2),
    Unknown.RADIUS: (0.25, 0.5, 1.0),
}
"""Errors that are tried: shares of gain and radius, degrees, friction."""
IDENTIFIED = {GAIN: 0.005, Unknown.BETA: 0.5, Unknown.FRICTION: 0.002, Unknown.RADIUS: 0.06}
"""Standard deviations that identify leaves, of `tests.benchmarks.identify_benches`."""


def scans_of(part: Specimen, height_mm: float, rng: np.random.Generator) -> Iterator[tuple[str, Scan]]:
    """The part felt once, its gains known, and the scan as if the whisker were another."""
    touch, n = default_touch(height_mm), default_comb(height_mm).n_whiskers
    chain = draw_sensor_chain(n, rng=rng, full_scale_n_mm=3.0 * abs(touch.land_moment_n_mm()))
    stage, surface = draw_stage_play(rng=rng), level(part.height_map)
    scan = felt(surface, height_mm, sensor=chain, stage=stage, rng=rng, soil=part.soil)
    scan = replace(scan, calibration=Calibration(chain.gain, np.zeros(n)))
    yield KNOWN, scan
    side, lots = float(rng.choice((-1.0, 1.0))), rng.standard_normal((3, n))
    for name, levels in LEVELS.items():
        for off in levels:
            # half of the parts to either side; a radius that is halved is one that is doubled the other way
            yield f"{name} {off:g}", _taken(scan, height_mm, {name: side * off}, gains=off * lots[0])
    nominal = nominal_bench(default_whisker(height_mm), touch, n_whiskers=1)
    drawn = {**dict(zip(Unknown, prior_sd(nominal), strict=False)), GAIN: 0.03}
    drawn[Unknown.RADIUS] /= touch.tip_radius_mm
    for way, known in (("as identified", IDENTIFIED), ("as drawn", drawn)):
        numbers = zip((Unknown.BETA, Unknown.FRICTION, Unknown.RADIUS), lots[2], strict=False)
        all_off = {GAIN: known[GAIN], **{name: float(known[name]) * lot for name, lot in numbers}}
        yield way, _taken(scan, height_mm, all_off, gains=known[GAIN] * lots[1])


def _taken(scan: Scan, height_mm: float, off: dict[str, float], *, gains: NDArray[np.float64]) -> Scan:
    """The scan of a whisker that is taken for another."""
    touch, known = scan.touch, scan.calibration
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


def main(*, parts: int = 60, seed: int = 2100, dirt: float = 0.3) -> None:
    """Print a line for each way in which the whisker is taken for another.

    Intervals hold 95 %: of a share, exact (Clopper and Pearson); of what was lost, by the parts' differences (Student).

    Args:
        parts: how many.
        seed: of the parts; a part's own is that plus its number.
        dirt: 0 to 1.
    """
    rights, sizes = defaultdict[str, list[int]](list), list[int]()
    made = DesignedParts(trial_parts(parts, seed, severities=(dirt,)))
    for number, item in enumerate(made.items()):
        part = made.make(item)
        if part.height_mm is None:
            continue
        sizes.append(len(part.truth))
        for way, scan in scans_of(part, part.height_mm, np.random.default_rng(seed + number)):
            rights[way].append(read_right(scan, part.truth, item.condition.format)[0])
    print(f"{'way':<18} parts  characters, %            lost to {KNOWN}, points   parts that differ")
    size, known = np.array(sizes), np.array(rights[KNOWN])
    for way, right in rights.items():
        low, high = binomtest(sum(right), sum(sizes)).proportion_ci(0.95, "exact")
        lost = 100.0 * (known - right) / size
        half = t.ppf(0.975, lost.size - 1) * lost.std(ddof=1) / np.sqrt(lost.size)
        print(
            f"{way:<18} {size.size:>5}  {100.0 * sum(right) / sum(sizes):5.1f} ({100 * low:5.1f} to {100 * high:5.1f})"
            f"  {lost.mean():6.2f} ({lost.mean() - half:5.2f} to {lost.mean() + half:5.2f})   {np.sum(lost != 0):>8}"
        )


if __name__ == "__main__":
    from cyclopts import run

    run(main)
