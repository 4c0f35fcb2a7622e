"""The report of a benchmark: one page that needs nothing beside it, a table of all trials, and all figures as JSON.

trials --statistics_of--> Statistics --+--> benchmark.json
   |                                   +--> report.html   (pictures inlined)
   +---------------------------------------> benchmark.csv
"""

from __future__ import annotations

import csv
import json
import platform
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

from glyphs.errors import MarksError
from pipeline.benchmark import charts as report_pictures
from pipeline.benchmark import curves as report_curves
from pipeline.benchmark.charts import inlined, modes_in, severities_in, severity_name
from pipeline.benchmark.confusion import characters_right
from pipeline.benchmark.modes import PEERS
from pipeline.benchmark.peers import ACCEPTED_FROM
from pipeline.benchmark.run import Benchmark
from pipeline.benchmark.statistics import Group, Statistics, plain, statistics_of
from pipeline.benchmark.targets import Verdict, verdicts
from pipeline.benchmark.trials import Trial
from pipeline.benchmark.worst_parts import WorstPart, draw_worst, marked, rank_worst
from pipeline.common.atomic import replacing
from pipeline.common.shares import Share
from pipeline.workers.executors import Executor, InlineExecutor, ordered_map

PAGE, TABLE, FIGURES = "report.html", "benchmark.csv", "benchmark.json"
_TEMPLATE = "report.html.j2"
_MOST_MISTAKES = 12
_TIMES = ("compute_s", "reading_s", "simulated_s", "scan_s")


class ReportError(MarksError):
    """The report cannot be drawn here; the message says what is missing."""


@dataclass(frozen=True)
class Written:
    """What was written.

    Attributes:
        page: the report.
        table: a line a trial.
        figures: all figures.
        statistics: the figures themselves.
        verdicts: what was to be shown, and whether it was.
    """

    page: Path
    table: Path
    figures: Path
    statistics: Statistics
    verdicts: tuple[Verdict, ...]


def check_report() -> None:
    """Refuse, before the run, what could not be reported at its end.

    Raises:
        ReportError: Jinja2 is not there.
    """
    try:
        import jinja2  # noqa: F401
    except ImportError as error:
        raise ReportError(
            "the report needs Jinja2", hint='install it with: pip install "tactile-marks[report]"'
        ) from error


def write_report(
    benchmark: Benchmark,
    trials: Sequence[Trial],
    folder: Path,
    *,
    command: str = "",
    executor: Executor | None = None,
) -> Written:
    """Write the page, the table and the figures.

    Args:
        benchmark: what was tried.
        trials: of all parts and modes, in order.
        folder: for them.
        command: how to do it again, as typed.
        executor: who draws the worst parts; this process unless given.

    Raises:
        FileError: the folder cannot be written.
        ReportError: Jinja2 is not there.
    """
    check_report()
    found = statistics_of(trials)
    judged = tuple(verdicts(found))
    items = {item.part: item for item in benchmark.parts.items()}
    ranked = [(part, items[part.part]) for part in rank_worst(trials)]
    worst = list(ordered_map(executor or InlineExecutor(), partial(draw_worst, benchmark), ranked))
    written = Written(folder / PAGE, folder / TABLE, folder / FIGURES, found, judged)
    _write_table(trials, written.table)
    with replacing(written.figures) as temporary:
        figures = json.dumps(_figures(benchmark, trials, found, judged), indent=1, ensure_ascii=False)
        temporary.write_text(figures + "\n", encoding="utf-8")
    page = _page(benchmark, trials, found, judged, worst, command=command)
    with replacing(written.page) as temporary:
        temporary.write_text(page, encoding="utf-8")
    return written


def _write_table(trials: Sequence[Trial], path: Path) -> None:
    headings = (
        "part", "severity", "font", "format", "mode", "truth", "text", "right", "decision", "confidence",
        "characters", "characters_right", "lowest_confidence", "lowest_margin", "flags", "error", "compute_s",
        "reading_s", "simulated_s", "scan_s",
    )  # fmt: skip
    with replacing(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(headings)
        for t in trials:
            writer.writerow((
                t.part, "" if t.severity is None else t.severity, t.font, t.format, t.mode, t.truth, t.text,
                int(t.right), t.decision, t.confidence, len(t.truth), characters_right(t),
                min((c.confidence for c in t.characters), default=""),
                min((c.margin for c in t.characters), default=""), t.flags, t.error,
                t.compute_s, round(t.reading_s, 4), t.simulated_s, t.scan_s,
            ))  # fmt: skip


def _figures(
    benchmark: Benchmark, trials: Sequence[Trial], found: Statistics, judged: Sequence[Verdict]
) -> dict[str, Any]:
    """All figures; what differs from run to run stands under "times" alone."""
    return {
        "benchmark": benchmark.description(),
        "versions": versions(),
        "parts": len({t.part for t in trials}),
        "targets": plain(list(judged)),
        "groups": plain(list(found.groups)),
        "by_severity": plain(list(found.by_severity)),
        "by_mode": plain(list(found.by_mode)),
        "comparisons": plain(list(found.comparisons)),
        "times": [
            {**plain(g.key), **{f"{name}_median_p95": plain(getattr(g, name)) for name in _TIMES}}
            for g in found.by_severity
        ],
    }


def versions() -> dict[str, str]:
    """Of this program and of what it stands on."""
    from importlib.metadata import PackageNotFoundError, version

    libraries = {"python": platform.python_version(), "machine": f"{platform.system()} {platform.machine()}"}
    for name in ("tactile-marks", "numpy", "scipy", "numba", "opencv-python-headless", "scikit-image",
                 "scikit-learn", "rapidocr", "onnxruntime", "tesserocr"):  # fmt: skip
        try:
            libraries[name] = version(name)
        except PackageNotFoundError:
            continue
    return libraries


def _page(
    benchmark: Benchmark,
    trials: Sequence[Trial],
    found: Statistics,
    judged: Sequence[Verdict],
    worst: Sequence[WorstPart],
    *,
    command: str,
) -> str:
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("pipeline.benchmark", "templates"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.filters.update(percent=_percent, severity=severity_name, span=_span, ms=_ms, p=_p)
    several = len({(g.key.font, g.key.format) for g in found.groups}) > 1
    errors = [t for t in trials if t.error]
    return environment.get_template(_TEMPLATE).render(
        title="Benchmark of reading dirty marks",
        made=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        n_parts=len({t.part for t in trials}),
        modes=modes_in(found.by_mode),
        peers=[m for m in modes_in(found.by_mode) if m in PEERS],
        peer_accepts=ACCEPTED_FROM,
        verdicts=judged,
        summary=_sorted(found.by_severity),
        groups=_sorted(found.groups) if several else [],
        comparisons=found.comparisons,
        pictures=_pictures(found, several=several),
        confusions=list(_confusions(found)),
        worst=[(part, [(t, marked(t)) for t in part.trials]) for part in worst],
        errors=errors[:20],
        n_errors=len(errors),
        settings=list(_flat(benchmark.description())),
        versions=versions(),
        command=command,
    )


def _sorted(groups: Sequence[Group]) -> list[Group]:
    modes, severities = modes_in(groups), severities_in(groups)
    return sorted(
        groups,
        key=lambda g: (
            severities.index(g.key.severity), g.key.font or "", g.key.format or "", modes.index(g.key.mode),
        ),
    )  # fmt: skip


def _pictures(found: Statistics, *, several: bool) -> dict[str, str]:
    return {
        "accuracy": inlined(report_pictures.accuracy_figure(found.by_severity)),
        "kinds": inlined(report_pictures.kinds_figure(found.groups)) if several else "",
        "split": inlined(report_pictures.split_figure(found.by_severity)),
        "risk": inlined(report_curves.risk_figure(found.by_severity)),
        "reliability": inlined(report_curves.reliability_figure(found.by_mode)),
    }


def _confusions(found: Statistics) -> Iterator[tuple[str, str, list[tuple[str, str, int]], int]]:
    """(mode, picture, most frequent mistakes, how many in all); peers without a picture."""
    for mode in modes_in(found.by_mode):
        group = next(g for g in found.by_mode if g.key.mode == mode)
        mistakes = group.confused.mistakes()
        total = sum(n for *_, n in mistakes)
        picture = ""
        if mode not in PEERS:
            title = f"{mode}: {total} mistakes in {group.characters.total} characters"
            picture = inlined(report_curves.confusion_figure(group.confused, title))
        yield mode, picture, mistakes[:_MOST_MISTAKES], total


def _flat(values: dict[str, Any], before: str = "") -> Iterator[tuple[str, str]]:
    for name, value in values.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{before}{name}.")
        else:
            yield f"{before}{name}", ", ".join(map(str, value)) if isinstance(value, list) else str(value)


def _percent(share: Share) -> str:
    return f"{100 * share.value:.2f} %"


def _span(ends: Share | tuple[float, float]) -> str:
    low, high = (ends.low, ends.high) if isinstance(ends, Share) else ends
    return f"{100 * low:.1f} – {100 * high:.1f}"


def _ms(seconds: float) -> str:
    return f"{1000 * seconds:.0f}" if seconds >= 0.01 else f"{1000 * seconds:.1f}"


def _p(value: float) -> str:
    return "< 0.001" if value < 0.001 else f"{value:.3f}"


def command_line() -> str:
    """What was typed, to be typed again."""
    import shlex

    return shlex.join(["tactile-marks", *sys.argv[1:]])
