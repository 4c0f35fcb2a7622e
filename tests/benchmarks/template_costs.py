"""CPU time of readings by templates alone, without the simulated scan and the prediction of templates::

    python tests/benchmarks/template_costs.py --fonts gothic,timesr --dirt 0.3,0.6,0.9 --parts 4

It draws the parts of `benchmark run --mode tactile --experts templates` with the same fonts, dirt, seed and number.
"""

from __future__ import annotations

import time
from collections import Counter, defaultdict
from collections.abc import Callable
from typing import Any
from unittest import mock

import numpy as np
from cyclopts import App

import recognition.touch
from pipeline.benchmark.exam.design import of_flags
from pipeline.benchmark.exam.designed_parts import DesignedParts
from pipeline.benchmark.readers.mode import PartReadings
from pipeline.benchmark.trials.run import Benchmark, reader_for
from pipeline.common.texts import split_commas
from recognition.find.template_lines import TemplateSearch
from recognition.glyph_match import correlation
from recognition.language.orientation import Orientation
from recognition.settings import ReaderSettings
from whisker_array.scan.mounting import Mounted

STEPS = (
    (Mounted, "feel", "scan"),
    (recognition.touch, "predict_templates", "predict"),
    (correlation, "_glyph_images", "predict"),
    (recognition.touch, "find", "search"),
    (TemplateSearch, "heights_mm", "search"),
)
"""Functions whose time is counted apart, with the step that they belong to."""
app = App()


@app.default
def measure(
    *,
    fonts: str = "gothic,timesr",
    dirt: str = "0",
    parts: int = 8,
    seed: int = 5,
    given: str = "font,format",
) -> None:
    """Read all parts, and print CPU seconds a part for each dirt: median and 95th percentile."""
    severities = tuple(map(float, split_commas(dirt)))
    levels = {"font": split_commas(fonts), "severity": severities}
    source = DesignedParts(of_flags(levels, parts=parts, seed=seed, given=(given,)))
    settings = ReaderSettings(experts=("templates",), orientation=Orientation.UPRIGHT)
    benchmark, seconds = Benchmark(source, ("tactile",), settings), Counter[str]()

    def charged(step: str, function: Callable[..., Any]) -> Callable[..., Any]:
        def charge(*args: Any, **options: Any) -> Any:
            start, inner = time.process_time(), sum(seconds.values())
            try:
                return function(*args, **options)
            finally:
                # what was charged within belongs to the inner steps
                spent = time.process_time() - start
                seconds[step] += spent - (sum(seconds.values()) - inner)

        return charge

    by_dirt = defaultdict[float | None, list[Counter[str]]](list)
    for owner, name, step in STEPS:
        mock.patch.object(owner, name, charged(step, getattr(owner, name))).start()
    for item in source.items():
        senses = PartReadings(source.make(item), reader_for(benchmark.settings_for(item.condition, given)))
        seconds.clear()
        charged("other", lambda senses=senses: senses.touch)()
        by_dirt[item.condition.severity].append(Counter(seconds))
    for severity, costs in by_dirt.items():
        for name, steps in (("search", ("search",)), ("whole", ("search", "other"))):
            figures = np.percentile([sum(cost[step] for step in steps) for cost in costs], (50, 95))
            print(f"dirt {severity}, {len(costs)} parts, {name}: {figures[0]:.2f} s, 95 % {figures[1]:.2f} s")
    mock.patch.stopall()


if __name__ == "__main__":
    app()
