"""`tactile-marks benchmark lot`: what a lot of an unknown die gains by teaching itself."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.cli.exit_status import failures_reported

if TYPE_CHECKING:
    from pipeline.benchmark.exam.design import Design
    from pipeline.benchmark.exam.designed_parts import DesignedParts
    from pipeline.benchmark.exam.specimens import Item

EDITION = "marks-exam-1"
"""Whose fonts and soils are used; never those that it keeps out."""
SEVERITIES = (0, 0.3, 0.6, 0.9)


def lot(
    *,
    out: Path,
    font: str = "Lato-Bold",
    format: str = "AA999999",
    parts: int = 60,
    seed: int = 60,
    jobs: int = 1,
) -> int:
    """Make a lot of one die whose parts are dirty to different degrees, read it once and teaching itself, and compare.

    Readers know the format, not the font and not the height. The lot has a folder of its own in OUT, the tables
    stand beside it.

    Parameters
    ----------
    out
        Folder for the lot and the tables. Parts that are there are not made again, and an interrupted reading goes on.
    font
        Font of the die: one of marks-exam-1 that a package brings (extra exam), built-in name or font file.
    format
        Of the serials.
    parts
        How many; a quarter each of dirt 0, 0.3, 0.6 and 0.9.
    seed
        Of everything random.
    jobs
        Worker processes.
    """
    with failures_reported():
        from pipeline.benchmark.exam.condition import Given
        from pipeline.benchmark.exam.designed_parts import DesignedParts
        from pipeline.benchmark.trials.answers import designed_items, load_answers
        from pipeline.cli.benchmarking.score import print_scores
        from pipeline.common.settings import ReadSettings
        from pipeline.common.version import key_of
        from pipeline.runs.options import RunOptions
        from pipeline.runs.production import run_batch
        from pipeline.workers.executors import ordered_map
        from pipeline.workers.options import ExecutorOptions

        source = DesignedParts(_design(font, format, parts, seed))
        items = designed_items(source)
        # parts of other flags are others
        folder = out / f"lot-{key_of({**source.description(), 'parts': parts})[:8]}"
        folder.mkdir(parents=True, exist_ok=True)
        given, settings = Given(format=True), ReadSettings(format=(format,), orientation="upright")
        read = []
        with ExecutorOptions(jobs).opened(len(items)) as executor:
            for _ in ordered_map(executor, partial(_write, source, folder), items):
                pass
            for name, learns in (("once", False), ("teaching itself", True)):
                table = out / f"{name.replace(' ', '-')}.csv"
                run_batch([str(folder)], settings, RunOptions(out=str(table), learn_die=learns), executor)
                read.append(load_answers(table, items, reader=name, given=given).trials)
        for severity in SEVERITIES:
            print(f"\ndirt {severity:g}")
            print_scores([[t for t in trials if t.severity == severity] for trials in read])
        print("\nwhole lot")
        print_scores(read)
    return 0


def _design(font: str, format: str, parts: int, seed: int) -> Design:
    from pipeline.benchmark.exam.design import Design
    from pipeline.benchmark.exam.editions import design_named

    edition = design_named(EDITION)
    soils = [soil for soil in edition.part["soil"] if soil not in edition.kept_out_soils]
    return Design.of(
        name="lot",
        seed=seed,
        parts=parts,
        cross=("severity",),
        part={"severity": list(SEVERITIES), "soil": soils, "font": font, "format": format},
        fonts={name: file.model_dump() for name, file in edition.fonts.items()},
    )


def _write(source: DesignedParts, folder: Path, item: Item) -> None:
    from pipeline.formats.synth import write_surface

    path = folder / f"{item.part}.npz"
    if not path.exists():
        made = source.make(item)
        write_surface(path, made.height_map, made.soil)
