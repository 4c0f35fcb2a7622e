"""Gain of a step of touch, fitted on parts of a design that are felt by steps drawn at random::

    python tests/benchmarks/fit_gain.py --design marks-exam-1-208 --seed 7 --budget-s 60 --write

Of the design only sections and soils that are not kept out are made, with a seed of their own, so that no part of an
exam is among them. Every other part is held out of a first fit, which tells how well the chances hold.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import date
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from glyphs.errors import MarksError
from recognition.active.gain import FITTED, LOOKS_AHEAD, Gain, WayGain, sureness
from recognition.active.moves import MOST, Way

if TYPE_CHECKING:
    from recognition.active.active_reading import ActiveReading

STIFFNESS = 0.3
"""Inverse weight of the penalty of the fit, so that ways that were seldom taken stay near the usual one."""


@dataclass(frozen=True)
class Tried:
    """One step that was taken, and what came of it.

    Attributes:
        way: of the step.
        lines: of every way before it.
        confidences: of all looks before it.
        sure: whether the serial was sure within the looks that count.
        part: the part that it was taken on.
    """

    way: Way
    lines: Mapping[Way, int]
    confidences: tuple[float, ...]
    sure: bool
    part: str = ""


def tried_on(design_name: str, *, seed: int, budget_s: float, most: int | None = None) -> Iterator[Tried]:
    """Results of every step on the parts of a design.

    Raises:
        MarksError: no such design.
    """
    from pipeline.benchmark.exam.design import design_named
    from pipeline.benchmark.exam.designed_parts import DesignedParts
    from recognition.active.active_reader import ActiveReader, ActiveSettings
    from recognition.active.policy import Drawn
    from recognition.language.orientation import Orientation
    from recognition.reader import Reader
    from recognition.see.virtual_bench import VirtualBench

    design = design_named(design_name)
    parts = DesignedParts(design.model_copy(update={"seed": seed}))
    kept_out = {section.name for section in design.sections if section.kept_out}
    items = [
        item
        for item in parts.items()
        if item.condition.get("soil") not in design.kept_out_soils
        and not any(name and item.part.startswith(f"{name}-") for name in kept_out)
    ]
    readers: dict[str, Any] = {}
    for item in items[:most]:
        made = parts.make(item)
        if made.height_mm is None:
            continue
        mask = item.condition.format
        reader = readers.setdefault(mask, Reader(format=mask, orientation=Orientation.UPRIGHT)).touch
        policy = Drawn(seed * 1000 + item.number)
        active = ActiveReader(reader, ActiveSettings(budget_s=budget_s, policy=policy))
        try:
            session = VirtualBench(
                made.height_map, made.height_mm, soil=made.soil, part_id=item.part
            ).open_session()
            found = active.read(session)
        except MarksError:
            continue
        yield from steps_of(found, item.part)


def steps_of(found: ActiveReading, part: str) -> Iterator[Tried]:
    """Every step of a reading but the first, and whether the serial was sure soon after it."""
    lines: dict[Way, int] = {}
    confidences: list[float] = []
    looks = len(found.steps)
    for k, (way, upto, confidence) in enumerate(found.steps):
        if k:
            sure = found.sure_at_look and looks - k <= LOOKS_AHEAD
            # near the end of a budget the next looks are not known
            if sure or looks - k >= LOOKS_AHEAD:
                yield Tried(way, dict(lines), tuple(confidences), sure, part)
        lines[way] = upto
        confidences.append(confidence)


def fit_gain(tried: Sequence[Tried]) -> Gain:
    """The gain that explains best what came of the steps.

    Raises:
        ValueError: steps that were all in vain, or none.
    """
    from sklearn.linear_model import LogisticRegression

    found = np.array([one.sure for one in tried])
    if found.size == 0 or found.all() or not found.any():
        raise ValueError("a gain is fitted on steps of which some made the serial sure and some did not")
    model = LogisticRegression(C=1.0 / STIFFNESS, max_iter=2000)
    model.fit(np.array([_row(one) for one in tried]), found)
    slopes, usual = [float(v) for v in model.coef_[0]], float(model.intercept_[0])
    ways = {}
    for k, way in enumerate(Way):
        own, new, lines = slopes[3 * k : 3 * k + 3]
        ways[way] = WayGain(usual=usual + own, new=new, lines=lines)
    sure, surer, looks = slopes[3 * len(Way) :]
    return Gain(ways, sure, surer, looks)


def loss_nats(gain: Gain, tried: Sequence[Tried]) -> float:
    """Mean surprise of a gain by what came of the steps."""
    chances = [gain.chance(one.way, one.lines, one.confidences) for one in tried]
    return float(
        np.mean([-math.log(p if one.sure else 1.0 - p) for p, one in zip(chances, tried, strict=True)])
    )


def _row(one: Tried) -> NDArray[np.float64]:
    row = np.zeros(3 * len(Way) + 3)
    k, has, s = list(Way).index(one.way), one.lines.get(one.way, 0), sureness(one.confidences)
    row[3 * k : 3 * k + 3] = 1.0, float(not has), has / MOST
    row[-3:] = s, s * s, math.log2(len(one.confidences))
    return row


def as_json(gain: Gain) -> dict[str, object]:
    """The numbers, rounded as they are kept."""
    ways = {way.value: {k: round(v, 3) for k, v in asdict(own).items()} for way, own in gain.ways.items()}
    return {
        "ways": ways,
        "sure": round(gain.sure, 3),
        "surer": round(gain.surer, 3),
        "looks": round(gain.looks, 3),
    }


def main(
    *,
    design: str = "marks-exam-1-208",
    seed: int = 7,
    parts: int | None = None,
    budget_s: float = 60.0,
    write: bool = False,
) -> None:
    """Fit, say what was found, and with --write keep it.

    Args:
        design: of which parts are made.
        seed: of the parts.
        parts: the most of them; default: all.
        budget_s: of the stage, for each part.
        write: replace the gain of the program.
    """
    tried = list(tried_on(design, seed=seed, budget_s=budget_s, most=parts))
    names = sorted({one.part for one in tried})
    half = set(names[::2])
    others, own = ([one for one in tried if (one.part in half) == side] for side in (True, False))
    gain = fit_gain(tried)
    print(f"{len(tried)} steps on {len(names)} parts, {sum(one.sure for one in tried)} of them soon sure")
    print(
        f"loss {loss_nats(gain, tried):.3f} nats a step; {loss_nats(fit_gain(others), own):.3f} on the other half"
    )
    print(json.dumps(as_json(gain), indent=1))
    if write:
        command = f"--design {design} --seed {seed} --budget-s {budget_s:g}"
        manifest = {
            "what": "chances that a step of touch makes the serial sure (recognition/active/gain.py)",
            "command": f"python tests/benchmarks/fit_gain.py {command} --write",
            "made": date.today().isoformat(),
            "fonts": ["of the design, those of sections that are not kept out"],
            "soils": ["of the design, those that are not kept out"],
            "editions": {},
            "parts": len(names),
            "steps": len(tried),
            "gain": as_json(gain),
        }
        FITTED.write_text(json.dumps(manifest, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    from cyclopts import run

    run(main)
