"""Parts of a finished benchmark, made again from its description."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from glyphs.errors import MarksError
from pipeline.benchmark.exam.design import Design
from pipeline.benchmark.exam.designed_parts import DesignedParts
from pipeline.benchmark.exam.specimens import Item
from pipeline.benchmark.trials.run import Benchmark
from pipeline.common.settings import SettingsError
from recognition.language.orientation import Orientation
from recognition.senses.settings import ReaderSettings
from whisker_array.simulation.traces import Fidelity


def remake(description: Mapping[str, Any], parts: Iterable[str]) -> tuple[Benchmark, dict[str, Item]]:
    """The benchmark of that description, and its items of these names; the program that makes them is today's.

    Args:
        description: as `pipeline.benchmark.trials.journal.TrialJournal` keeps it.
        parts: names.

    Raises:
        MarksError: its parts are in files, or come from a design that cannot be made here: a font, or a soil.
    """
    wanted, said = set(parts), description["parts"]
    if "part" not in said:
        raise SettingsError("its parts are in files", hint="pictures are of parts of a design")
    values = {name: value for name, value in said.items() if name != "font_files"}
    if not values.get("section"):
        # a part's name ends in its number within its cell; every beginning of a design is the same
        values["parts_a_cell"] = 1 + max((int(part.rpartition("-")[2]) for part in wanted), default=0)
    source = DesignedParts(Design.of(**values))
    items = {item.part: item for item in source.items()}
    if not wanted <= set(items):
        raise MarksError("the design does not name all of these parts")
    if source.description().get("font_files") != said.get("font_files"):
        raise MarksError("its fonts are others than those installed here")
    reading = description["reading"]
    settings = ReaderSettings(
        fonts=tuple(reading["fonts"]),
        format=reading["format"],
        fidelity=Fidelity(reading["fidelity"]),
        orientation=Orientation(reading["orientation"]),
    )
    return Benchmark(source, tuple(description["modes"]), settings), {name: items[name] for name in wanted}
