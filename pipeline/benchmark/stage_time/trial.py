"""Parts read by plans of touch: one that chooses and stops, uniform ones of several densities, ones drawn at random.

plan      level                           passes                            stops
active    worth of a serial, stage s      chosen one step ahead             when sure, or not worth it
uniform   lines to half a height          along x, evenly                   never before its end
random    budget, stage s                 ways drawn at random              never before its end
whole     lines to a height               four directions, as usual         never before its end
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from statistics import fmean, median
from typing import TYPE_CHECKING

from glyphs.errors import MarksError, describe_fault
from pipeline.reading.scan_plan import USUAL_HEIGHT_MM
from recognition.active.active_reader import ActiveReader, ActiveSettings
from recognition.active.moves import MOST, Way
from recognition.active.policy import WORTH_S, Drawn, Greedy, Ladder, Policy
from recognition.decision.decide import Decision
from recognition.language.orientation import Orientation
from recognition.reader import Reader
from whisker_array.whisker.array import LINES_PER_HEIGHT, default_plan

if TYPE_CHECKING:
    from pipeline.benchmark.exam.condition import Given
    from pipeline.benchmark.exam.specimens import Item, Parts, Specimen
    from recognition.decision.reading import Reading
    from whisker_array.scan.simulated_session import SimulatedSession

WORTHS_S = (30.0, WORTH_S, 1000.0)
UNIFORM_LINES = (4, 8, 16)
RANDOM_BUDGETS_S = (8.0, 24.0)
_NO_LIMIT_S = 1e6


@dataclass(frozen=True)
class TouchPlan:
    """A plan of touch.

    Attributes:
        name: active, uniform, random or whole.
        level: what makes it longer or shorter; see the module.
    """

    name: str
    level: float

    def settings(self, *, seed: int, budget_s: float) -> ActiveSettings:
        """Policy and budget on one part."""
        policy: Policy
        if self.name == "active":
            return ActiveSettings(budget_s=budget_s, policy=Greedy(worth_s=self.level))
        if self.name == "uniform":
            policy = Ladder(((Way.ALONG, min(MOST, round(self.level))),))
            return ActiveSettings(budget_s=_NO_LIMIT_S, policy=policy, until_sure=False)
        return ActiveSettings(budget_s=self.level, policy=Drawn(seed), until_sure=False)


PLANS = (
    *(TouchPlan("active", worth) for worth in WORTHS_S),
    *(TouchPlan("uniform", lines) for lines in UNIFORM_LINES),
    *(TouchPlan("random", budget) for budget in RANDOM_BUDGETS_S),
    TouchPlan("whole", LINES_PER_HEIGHT),
)


@dataclass(frozen=True)
class TouchTrial:
    """One part read by one plan; the fields are the columns of the table.

    Attributes:
        part: its name.
        plan: active, uniform, random or whole.
        level: of the plan.
        given: what the reader was given.
        severity: of the dirt.
        soil: what it is.
        height_mm: of the characters.
        truth: what was stamped.
        text: as read.
        decision: accept, review or reject.
        right: whether all of it is.
        stage_s: stage seconds.
        passes: felt.
        stop: why no more.
        thought_s: longest wait between two passes, processor seconds.
        usual_thought_s: median wait.
        error: why there is no reading.
    """

    part: str
    plan: str
    level: float
    given: str
    severity: float | None
    soil: str
    height_mm: float
    truth: str
    text: str = ""
    decision: str = ""
    right: bool = False
    stage_s: float = 0.0
    passes: int = 0
    stop: str = ""
    thought_s: float = 0.0
    usual_thought_s: float = 0.0
    error: str = ""


def tried_on(
    parts: Parts, item: Item, *, plans: Sequence[TouchPlan], seed: int, budget_s: float
) -> tuple[TouchTrial, ...]:
    """A part by every plan, with all that it may be given; the sensors are as from the bench."""
    made, found = parts.make(item), []
    for given in item.given:
        font = parts.font_of(item.condition) if given.font else ""
        reader = _reader(item.condition.format if given.format else "", font)
        for plan in plans:
            blank = replace(_blank(item, given, plan), truth=made.truth, height_mm=_height_mm(made))
            found.append(_tried(blank, item, made, reader, plan, seed=seed, budget_s=budget_s))
    return tuple(found)


def failed(item: Item, plans: Sequence[TouchPlan], error: Exception) -> tuple[TouchTrial, ...]:
    """The trials of a part that could not be made, or whose worker was lost."""
    told = f"the part: {describe_fault(error)}"
    return tuple(replace(_blank(item, given, plan), error=told) for given in item.given for plan in plans)


def _blank(item: Item, given: Given, plan: TouchPlan) -> TouchTrial:
    return TouchTrial(
        *(item.part, plan.name, plan.level, str(given)),
        severity=item.condition.severity,
        soil=str(item.condition.get("soil", "")),
        height_mm=USUAL_HEIGHT_MM,
        truth=item.truth,
    )


def _height_mm(made: Specimen) -> float:
    return made.height_mm or USUAL_HEIGHT_MM


@lru_cache(maxsize=8)
def _reader(mask: str, font: str) -> Reader:
    """Kept from part to part, the last few: templates take a second to be made."""
    return Reader(format=mask or None, fonts=(font,) if font else (), orientation=Orientation.UPRIGHT)


def _tried(
    blank: TouchTrial,
    item: Item,
    made: Specimen,
    reader: Reader,
    plan: TouchPlan,
    *,
    seed: int,
    budget_s: float,
) -> TouchTrial:
    try:
        if plan.name == "whole":
            return _whole(blank, made, reader, seed=seed)
        session = _mounted(made, blank.height_mm, seed=seed)
        active = ActiveReader(reader.touch, plan.settings(seed=seed + item.number, budget_s=budget_s))
        found = active.read(session)
    except MarksError as error:
        return replace(blank, error=str(error))
    session.close()
    # after the last pass nobody waits: the part can be taken away
    waits = sorted(p.thought_s for p in found.passes[:-1] if p.thought_s > 0.0)
    return replace(
        _answered(blank, found.reading),
        stage_s=round(found.stage_s, 3),
        passes=len(found.passes),
        stop=found.stop.value,
        thought_s=round(max(waits, default=0.0), 4),
        usual_thought_s=round(waits[len(waits) // 2], 4) if waits else 0.0,
    )


def _whole(blank: TouchTrial, made: Specimen, reader: Reader, *, seed: int) -> TouchTrial:
    """By the usual plan, felt to its end."""
    from pipeline.reading.simulated_scan import feel

    plan = default_plan((0.0, 0.0, *made.height_map.size_mm), character_height_mm=blank.height_mm)
    scan = feel(made.height_map, plan=plan, height_mm=blank.height_mm, sensor_seed=seed, soil=made.soil)
    return replace(
        _answered(blank, reader.touch.read_scan(scan)),
        stage_s=round(plan.scan_time_s, 3),
        passes=len(plan.passes()),
    )


def _answered(blank: TouchTrial, reading: Reading) -> TouchTrial:
    text = "".join(reading.text.split())
    return replace(blank, text=text, decision=reading.decision.value, right=text == blank.truth)


def _mounted(made: Specimen, height_mm: float, *, seed: int) -> SimulatedSession:
    from pipeline.reading.simulated_scan import open_session

    return open_session(
        made.height_map, height_mm=height_mm, soil=made.soil, part_id=made.part, sensor_seed=seed
    )


@dataclass(frozen=True)
class PlanResult:
    """What a plan came to on some parts.

    Attributes:
        plan: which.
        n: parts.
        stage_s: mean.
        median_s: median of the same.
        right: serials.
        accepted: serials.
        wrong: of those accepted.
    """

    plan: TouchPlan
    n: int
    stage_s: float
    median_s: float
    right: int
    accepted: int
    wrong: int


def results(
    tried: Sequence[TouchTrial], *, severity: float | None = None, given: str = ""
) -> list[PlanResult]:
    """A row a plan, in the order of the trials.

    Args:
        tried: all trials.
        severity: of the dirt; every one unless given.
        given: what the reader was given; anything unless given.
    """
    chosen = [
        t for t in tried if (severity is None or t.severity == severity) and (not given or t.given == given)
    ]
    made = []
    for plan in dict.fromkeys(TouchPlan(t.plan, t.level) for t in chosen):
        own = [t for t in chosen if (t.plan, t.level) == (plan.name, plan.level)]
        accepted = [t for t in own if t.decision == Decision.ACCEPT.value]
        made.append(
            PlanResult(
                plan=plan,
                n=len(own),
                stage_s=fmean(t.stage_s for t in own),
                median_s=median(t.stage_s for t in own),
                right=sum(t.right for t in own),
                accepted=len(accepted),
                wrong=sum(not t.right for t in accepted),
            )
        )
    return made
