"""Anybody's reader as a mode: what it is shown, what it may say, and what is said of a faulty one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from glyphs.errors import MarksError
from pipeline.benchmark.readers.modes import open_mode
from pipeline.benchmark.readers.own_reader import Answer, ExamPart
from pipeline.benchmark.trials.run import Benchmark, run_benchmark
from pipeline.common.settings import SettingsError
from recognition.reader import Reader
from recognition.see.virtual_array import VirtualArray
from recognition.settings import ReaderSettings
from tests.factories import designed_parts
from whisker_array.simulation.traces import Fidelity

SHOWN: dict[str, Any] = {}


def look(part: ExamPart) -> Answer:
    pictures = [part.line_picture(kind).shape for kind in ("photo", "edges", "relief", "ideal")]
    SHOWN.update(
        name=part.name, format=part.format, height=part.height_mm, fonts=part.fonts, pictures=pictures,
        photo=part.photo[0].shape, relief=part.relief, edges=part.edges[0].shape, surface=part.surface,
    )  # fmt: skip
    return Answer("A 1", 0.81, accepted=True)


def by_text(part: ExamPart) -> str:
    return "A1" if part.format else "B2"


def faulty(part: ExamPart) -> float:
    return 0.5


def ends(part: ExamPart) -> str:
    raise SystemExit(3)


def test_it_meets_the_part_and_its_answer_counts(tmp_path: Path) -> None:
    parts = designed_parts(given=("format", "height"))
    reading = ReaderSettings(array=VirtualArray(fidelity=Fidelity.POINTWISE))
    names = tuple(f"{__name__}:{reader.__name__}" for reader in (look, by_text, faulty, ends))
    trials = run_benchmark(Benchmark(parts, names, reading), tmp_path)
    first, text, fault, ended, _, unformatted, *_ = trials
    assert (first.text, first.accepted, first.confidence) == ("A1", True, pytest.approx(0.81))
    assert [c.confidence for c in first.characters] == pytest.approx([0.9, 0.9])
    assert (text.text, text.decision, unformatted.text) == ("A1", "review", "B2")
    assert first.scan_s > 1.0  # it has looked at maps of touch
    assert text.scan_s == 0.0
    assert "returned a float" in fault.error
    assert "tried to end the program" in ended.error
    assert (SHOWN["format"], SHOWN["height"], SHOWN["fonts"]) == (None, 5.0, ())  # as the last was given
    (relief, pitch_mm), (surface, _) = SHOWN["relief"], SHOWN["surface"]
    deep = float(np.nanmin(surface))
    assert np.nanmin(relief) == pytest.approx(deep, abs=0.5 * abs(deep))  # the tip is round, the dirt soft
    assert pitch_mm == pytest.approx(5.0 / 40, rel=0.5)


@pytest.mark.parametrize(
    ("name", "problem"),
    [
        ("nowhere:read", "cannot be found"),
        (f"{__name__}:SHOWN", "not a function"),
        (":read", "not in the form module:name"),
    ],
)
def test_a_reader_that_is_not_there_is_named(name: str, problem: str) -> None:
    with pytest.raises(SettingsError, match=problem):
        open_mode(name, Reader(ReaderSettings()))


def test_a_confidence_is_a_share() -> None:
    with pytest.raises(MarksError, match="between 0 and 1"):
        Answer("A", 80.0)
