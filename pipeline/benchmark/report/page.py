"""Pages of a benchmark and of a certificate: self-contained templates with their values."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.benchmark.analysis.estimates import Estimate
from pipeline.benchmark.analysis.factors import factor_name
from pipeline.benchmark.exam.condition import level_name
from pipeline.benchmark.trials.journal import Trial
from pipeline.common.accepted_risk import Shown
from pipeline.common.output_paths import make_folder, write_json, write_table, write_text
from pipeline.common.shares import Share
from pipeline.common.texts import align
from pipeline.common.version import library_versions
from pipeline.reading.certificate import Certificate
from pipeline.reading.certificate_statistics import LEAST_PARTS, P_VALUE, KindOfParts
from recognition.decide.risk_text import risk_in_words

PROGRAM = "tactile-marks"


def write_files(folder: Path, contents: Mapping[str, Any]) -> tuple[Path, ...]:
    """Write rows as .csv, values as .json, else texts, by file name; return the paths. Raises FileError."""
    make_folder(folder)
    writers: dict[str, Callable[[Path, Any], None]] = {".csv": write_table, ".json": write_json}
    for name, content in contents.items():
        writers.get(Path(name).suffix, write_text)(folder / name, content)
    return tuple(folder / name for name in contents)


def render(template: str, **values: Any) -> str:
    """Render a page or Markdown document of `report.templates`, with time, command line and versions."""
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("pipeline.benchmark.report", "templates"),
        autoescape=not template.endswith(".md.j2"),
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.filters.update(
        percent=percent, span=span, ms=_ms, p=_p, factor=factor_name, level=level_name, risk=risk_in_words,
        points=points, points_span=points_span, marked=mark_characters,
    )  # fmt: skip
    values |= {
        "made": f"{datetime.now(UTC):%Y-%m-%d %H:%M UTC}",
        "command": _command_line(),
        "versions": versions(),
    }
    return environment.get_template(template).render(values)


def _command_line() -> str:
    program = Path(sys.argv[0])
    ours = program.stem == PROGRAM or program.parent.name == "pipeline"  # or by python -m pipeline
    return shlex.join([PROGRAM, *sys.argv[1:]]) if ours else ""


def versions() -> dict[str, str]:
    """Versions of this program and of the libraries that it uses."""
    names = "numpy scipy numba opencv-contrib-python-headless scikit-image scikit-learn rapidocr onnxruntime tesserocr"
    return library_versions((PROGRAM, *names.split()))


def percent(share: Share | Estimate) -> str:
    """A share: "97.25 %"."""
    return f"{100 * share.value:.2f} %"


def span(ends: Share | Estimate) -> str:
    """The ends of an interval of a share, percent."""
    return "–" if ends.low is None or ends.high is None else f"{100 * ends.low:.1f} to {100 * ends.high:.1f}"


def points(value: float) -> str:
    """A difference of shares, in percentage points with its sign."""
    return f"{100 * value:+.1f}".replace("-", "−")


def points_span(ends: Estimate) -> str:
    """The ends of an interval of a difference of shares, in percentage points."""
    return "–" if ends.low is None or ends.high is None else f"{points(ends.low)} to {points(ends.high)}"


def _ms(seconds: float) -> str:
    return f"{1000 * seconds:.0f}" if seconds >= 0.01 else f"{1000 * seconds:.1f}"


def _p(value: float) -> str:
    return "< 0.001" if value < 0.001 else f"{value:.3f}"


def mark_characters(trial: Trial) -> list[tuple[str, bool]]:
    """Characters that were read, and whether each is right; "·" for a missing one."""
    return [
        (trial.text[p.place] if p.place is not None else "·", p.right) for p in align(trial.truth, trial.text)
    ]


def write_certificate_page(certificate: Certificate, path: Path) -> None:
    """Write the page of a certificate: its statement, its evidence, and its scope."""
    page = render(
        "certificate.html.j2",
        title="Certificate of acceptance",
        c=certificate,
        tests=[test for test in certificate.tests if test.shown is not Shown.NOT_TESTED],
        measures=_spread(certificate.kind),
        p_value=P_VALUE,
        least_parts=LEAST_PARTS,
    )
    write_text(path, page)


def _spread(kind: KindOfParts) -> list[tuple[str, list[str]]]:
    return [
        (name.value, [f"{v:.4g}" for v in np.percentile(values, [5, 50, 95])])
        for name, values in kind.values.items()
    ]
