"""The gallery: every picture by name, all of them drawn into a folder, and the steps they show as a table."""

from __future__ import annotations

import csv
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Literal, TypeAlias

from glyphs.atomic import replacing
from glyphs.errors import FileError
from pipeline.plots.drawing import Drawing, FigureSettings, StepRow
from pipeline.plots.elastica import elastica_figure
from pipeline.plots.estimator_trial import TrialRow
from pipeline.plots.estimators import estimators_figure
from pipeline.plots.factor import factor_figure
from pipeline.plots.pictures import save_figure
from pipeline.plots.speed import speed_figure
from pipeline.plots.traces import pieces_figure, whiskers_figure
from whisker_array.simulation.traces import Fidelity

PictureFormat: TypeAlias = Literal["png", "svg"]
Draw: TypeAlias = Callable[[FigureSettings], Drawing]

FIGURES: tuple[tuple[str, Draw], ...] = (
    ("fig4-factor", factor_figure),
    ("fig6-test-pieces", pieces_figure),
    ("fig7-whiskers", whiskers_figure),
    ("elastica", elastica_figure),
    ("estimators", estimators_figure),
    ("speed", speed_figure),
)
"""Name of each file and the function that draws it."""


@dataclass(frozen=True)
class Gallery:
    """Files of a gallery.

    Attributes:
        pictures: the files, in the order of FIGURES.
        tables: figures.csv, and estimators.csv where the estimators were tried.
        rows: lines of the first.
    """

    pictures: tuple[Path, ...]
    tables: tuple[Path, ...]
    rows: tuple[StepRow, ...]


def draw_gallery(
    folder: Path,
    *,
    settings: FigureSettings | None = None,
    picture_format: PictureFormat = "png",
    figures: Sequence[tuple[str, Draw]] = FIGURES,
) -> Gallery:
    """Draw the figures into a folder, made if need be, and write their steps beside them.

    Args:
        folder: where to.
        settings: friction and noise.
        picture_format: "png" or "svg".
        figures: which.

    Raises:
        FileError: the folder cannot be made or written.
        StepError: a step cannot be read off a trace.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(folder, f"cannot be made ({error.strerror})", "name another folder") from error
    pictures: list[Path] = []
    rows: list[StepRow] = []
    trial: list[TrialRow] = []
    for name, draw in figures:
        drawing = draw(settings or FigureSettings())
        pictures.append(folder / f"{name}.{picture_format}")
        save_figure(drawing.figure, pictures[-1])
        rows += drawing.rows
        trial += drawing.trial
    tables = [_write_rows(rows, folder / "figures.csv")]
    if trial:
        tables.append(_write_rows(trial, folder / "estimators.csv"))
    return Gallery(tuple(pictures), tuple(tables), tuple(rows))


def _write_rows(rows: Sequence[StepRow] | Sequence[TrialRow], path: Path) -> Path:
    with replacing(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.DictWriter(stream, [field.name for field in fields(rows[0])])
        writer.writeheader()
        for row in rows:
            values = asdict(row)
            writer.writerow({n: f"{v:.6g}" if isinstance(v, float) else v for n, v in values.items()})
    return path


def step_table(rows: Sequence[StepRow]) -> list[str]:
    """Lay the steps out as a table for people: one line a step, both fidelities side by side."""
    head = f"{'fig':<4}{'l2/l1':>6}{'alpha':>7}{'mu':>6}{'F (16)':>9}"
    head += "".join(f"{f.value:>12}{'error':>9}{'peak':>7}" for f in Fidelity)
    lines: dict[str, str] = {}
    for row in rows:
        step = f"{row.figure:<4}{row.k:>6.3f}{row.alpha_deg:>7.0f}{row.mu:>6.2f}{row.f_predicted:>9.4f}"
        felt = f"{row.f_read_off:>12.4f}{100.0 * row.error:>+8.2f}%{row.peak:>7.3f}"
        lines[step] = lines.get(step, step) + felt
    return [head, *lines.values()]
