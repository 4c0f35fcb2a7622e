"""Touch plans as modes: active, uniform, random and whole.

mode         level                           passes                            stops
active L     worth of a serial, stage s      chosen one step ahead             when sure, or no pass is worth it
uniform L    lines per half height           along x, evenly                   never before its end
random L     budget, stage s                 random passes                     never before its end
whole L      lines per height                four directions, as usual         never before its end

All read by touch alone, on one bench whose sensors and stage are drawn with `BENCH_SEED`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from pipeline.benchmark.readers.mode import Mode, PartReadings
from pipeline.reading.scan_plan import USUAL_HEIGHT_MM
from recognition.active.active_reader import ActiveReader, ActiveSettings
from recognition.active.moves import MOST, Way
from recognition.active.policy import WORTH_S, Drawn, Greedy, Ladder
from whisker_array.whisker.array import LINES_PER_HEIGHT

if TYPE_CHECKING:
    from recognition.decide.reading import Reading
    from recognition.reader import Reader

WORTHS_S = (30.0, WORTH_S, 1000.0)
UNIFORM_LINES = (4, 8, 16)
RANDOM_BUDGETS_S = (8.0, 24.0)
# most stage time of a part in active mode
BUDGET_S = 90.0
BENCH_SEED = 1
_NO_LIMIT_S = 1e6
_NAMES = ("active", "uniform", "random", "whole")


@dataclass(frozen=True)
class TouchPlan:
    """A plan of touch: active, uniform, random or whole, and the parameter of its length; see the module."""

    name: str
    level: float

    @property
    def mode(self) -> str:
        return f"{self.name} {self.level:g}"

    @classmethod
    def of(cls, mode: str) -> TouchPlan | None:
        name, _, level = mode.partition(" ")
        return cls(name, float(level)) if name in _NAMES and level.replace(".", "", 1).isdigit() else None

    def settings(self, number: int) -> ActiveSettings:
        if self.name == "active":
            return ActiveSettings(budget_s=BUDGET_S, policy=Greedy(worth_s=self.level))
        if self.name == "uniform":
            policy = Ladder(((Way.ALONG, min(MOST, round(self.level))),))
            return ActiveSettings(budget_s=_NO_LIMIT_S, policy=policy, until_sure=False)
        return ActiveSettings(budget_s=self.level, policy=Drawn(BENCH_SEED + number), until_sure=False)


PLANS = (
    *(TouchPlan("active", worth) for worth in WORTHS_S),
    *(TouchPlan("uniform", lines) for lines in UNIFORM_LINES),
    *(TouchPlan("random", budget) for budget in RANDOM_BUDGETS_S),
    TouchPlan("whole", LINES_PER_HEIGHT),
)


def plan_mode(plan: TouchPlan, reader: Reader) -> Mode:
    """Make a mode that reads by touch with one plan; the trial records the stage time and why touch stopped."""
    from recognition.see.virtual_bench import VirtualBench

    touch = reader.touch

    def read(senses: PartReadings) -> tuple[Reading, dict[str, Any]]:
        part = senses.specimen
        height_mm = part.height_mm or USUAL_HEIGHT_MM
        array = replace(reader.settings.array, seed=BENCH_SEED)
        bench = VirtualBench(part.height_map, height_mm, array, soil=part.soil, part_id=part.part).mounted()
        if plan.name == "whole":
            return reader.read(bench.scan()), {"scan_s": round(bench.whole.scan_time_s, 3)}
        session = bench.open_session()
        result = ActiveReader(touch, plan.settings(part.number)).read(session)
        session.close()
        return result.reading, {"scan_s": round(result.stage_s, 3), "flags": result.stop.value}

    return Mode((), read)
