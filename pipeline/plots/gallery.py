"""The gallery: every picture by name, all of them drawn into a folder, and the steps they show as a table."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Literal, TypeAlias

import matplotlib

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
"""Name of the file and how it is drawn; a further picture is one more line."""
TABLE = "figures.csv"
TRIAL_TABLE = "estimators.csv"


@dataclass(frozen=True)
class Gallery:
    """What was made.

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
    on_picture: Callable[[Path], None] | None = None,
) -> Gallery:
    """Draw the figures into a folder, made if need be, and write their steps beside them.

    Args:
        folder: where to.
        settings: friction and noise.
        picture_format: "png" or "svg".
        figures: which.
        on_picture: told of every picture when it is there.

    Raises:
        FileError: the folder cannot be made or written.
        StepError: a step cannot be read off a trace.
    """
    settings = settings or FigureSettings()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FileError(folder, f"cannot be made ({error.strerror})", "name another folder") from error
    pictures: list[Path] = []
    rows: list[StepRow] = []
    trial: list[TrialRow] = []
    for name, draw in figures:
        drawing = draw(settings)
        path = folder / f"{name}.{picture_format}"
        # names inside an SVG are else drawn by chance
        with matplotlib.rc_context({"svg.hashsalt": name}):
            save_figure(drawing.figure, path)
        pictures.append(path)
        rows += drawing.rows
        trial += drawing.trial
        if on_picture is not None:
            on_picture(path)
    tables = [folder / TABLE]
    write_rows(rows, tables[0])
    if trial:
        tables.append(folder / TRIAL_TABLE)
        write_rows(trial, tables[1])
    return Gallery(tuple(pictures), tuple(tables), tuple(rows))


def write_rows(rows: Sequence[StepRow] | Sequence[TrialRow], path: Path) -> None:
    """Write figures.csv or estimators.csv; the file appears whole or not at all.

    Raises:
        FileError: it cannot be written.
    """
    import csv

    with replacing(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.DictWriter(stream, [f.name for f in fields(rows[0])])
        writer.writeheader()
        for row in rows:
            values = asdict(row)
            writer.writerow({n: f"{v:.6g}" if isinstance(v, float) else v for n, v in values.items()})


def step_table(rows: Sequence[StepRow]) -> list[str]:
    """The table for people: one line a step, both fidelities side by side."""
    from whisker_array.simulation.traces import Fidelity

    head = f"{'fig':<4}{'l2/l1':>6}{'alpha':>7}{'mu':>6}{'F (16)':>9}"
    head += "".join(f"{f.value:>12}{'error':>9}{'peak':>7}" for f in Fidelity)
    lines: dict[tuple[str, float, float, float], list[str]] = {}
    for row in rows:
        key = (row.figure, row.k, row.alpha_deg, row.mu)
        start = f"{row.figure:<4}{row.k:>6.3f}{row.alpha_deg:>7.0f}{row.mu:>6.2f}{row.f_predicted:>9.4f}"
        felt = f"{row.f_read_off:>12.4f}{100.0 * row.error:>+8.2f}%{row.peak:>7.3f}"
        lines.setdefault(key, [start]).append(felt)
    return [head, *("".join(parts) for parts in lines.values())]
