"""Modes of our own: without a rule of the decision, by one expert alone, under several lights."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from glyphs.errors import FileError, MarksError
from pipeline.benchmark.readers.mode import PartReadings
from pipeline.benchmark.readers.modes import (
    expand_groups,
    expert_alone,
    experts_in,
    leave_out,
    open_mode,
    rules,
)
from pipeline.benchmark.readers.own_reader import Answer, ExamPart
from pipeline.benchmark.trials.run import Benchmark, run_benchmark
from pipeline.common.settings import SettingsError
from recognition.decide.decide import decide
from recognition.decide.decision import BROKEN, MEASURE_FLAGS, Decision, Finding, ReadingFlag
from recognition.decide.evidence import Evidence, Log, SenseEvidence, Source
from recognition.decide.reading import Reading
from recognition.decide.score import SOURCES, Measure, score_of
from recognition.find.part_lines import PartLines
from recognition.language.box import Box
from recognition.language.lattice import Lattice
from recognition.language.orientation import Orientation
from recognition.reader import Reader
from recognition.recogniser.read_line import ReadLine
from recognition.see.virtual_array import VirtualArray
from recognition.settings import ReaderSettings
from tests.factories import designed_parts
from tests.support.evidence import believed_line, sense_of
from whisker_array.simulation.traces import Fidelity

SETTINGS = ReaderSettings(format="AA", orientation=Orientation.UPRIGHT)


def decided(*flags: ReadingFlag) -> Reading:
    """A sure reading by touch with these flags."""
    sure = Lattice(tuple("AB"), np.log(np.array([[0.99999, 1e-6], [1e-6, 0.99999]])))
    return decide(Evidence.of(sense_of(sure, findings=tuple(map(Finding.of, flags)))), SETTINGS)


def test_every_contract_and_term_has_a_name() -> None:
    terms = {term for source in SOURCES for term in score_of(source).terms} - {Measure.ODDS}
    assert set(rules().values()) == {*(BROKEN & ~MEASURE_FLAGS), MEASURE_FLAGS, *terms}
    assert {"unread-marks", "format-not-met", "mark-rules"} <= set(rules())


def test_without_a_contract_a_reading_that_broke_it_alone_is_accepted() -> None:
    for name, rule in rules().items():
        if isinstance(rule, ReadingFlag):
            broken, other = decided(*rule), ReadingFlag.UNREAD_MARKS
            if name == "unread-marks":
                other = ReadingFlag.NOT_WHOLE
            assert broken.decision is Decision.REVIEW
            assert leave_out(name, SETTINGS)(broken).decision is Decision.ACCEPT
            assert leave_out(name, SETTINGS)(decided(*rule, other)).decision is Decision.REVIEW


def test_each_mode_is_also_read_without_each_rule() -> None:
    named = expand_groups(("tactile", "vision", "rapidocr relief"), ablate=("unread-marks", "strokes"))
    assert named[3:] == (
        "tactile without unread-marks", "vision without unread-marks",
        "tactile without strokes", "vision without strokes",
    )  # fmt: skip
    assert open_mode(named[3], Reader(format="A9")).uses == ("touch",)
    with pytest.raises(SettingsError, match="no rule 'luck' to leave out; the rules are mismatch"):
        open_mode("tactile without luck", Reader(format="A9"))


WHISKER = """format_version = 1
kind = "L"
l1_mm = 30.0
l2_mm = 6.0
l3_mm = 3.5
preload_mm = 1.0
tip_radius_mm = 0.06
friction = 0.2
character_height_mm = 5.0
speed_mm_s = 25.0
[section]
kind = "ribbon"
thickness_mm = 0.3
width_mm = 4.5
"""


def test_modes_of_touch_also_feel_with_other_whiskers(tmp_path: Path) -> None:
    path = tmp_path / "long.toml"
    path.write_text(WHISKER)
    named = expand_groups(("tactile", "vision", "fused"), whiskers=(str(path),))
    assert named[3:] == (f"tactile with {path}", f"fused with {path}")
    parts = designed_parts(parts=1)
    benchmark = Benchmark(parts, named, ReaderSettings(orientation=Orientation.UPRIGHT))
    trials = {t.mode: t for t in run_benchmark(benchmark, tmp_path / "run")}
    assert {(t.text, t.error) for t in trials.values()} == {(parts.make(parts.items()[0]).truth, "")}
    # at half the speed (turns take as long), and the camera is charged to both
    assert trials[named[3]].scan_s > 1.5 * trials["tactile"].scan_s
    assert trials[named[4]].compute_s > trials["vision"].compute_s
    # a file's speed is that of its whisker alone, whichever is the first
    first = replace(benchmark.reading.array, whisker_speed_mm_s=40.0)
    again = replace(benchmark, modes=(named[3],), reading=replace(benchmark.reading, array=first))
    assert run_benchmark(again, tmp_path / "again")[0].scan_s == trials[named[3]].scan_s
    # another whisker in the file is another benchmark
    path.write_text(WHISKER.replace("l2_mm = 6.0", "l2_mm = 5.0"))
    with pytest.raises(FileError, match="another benchmark"):
        run_benchmark(benchmark, tmp_path / "run")
    path.unlink()
    with pytest.raises(FileError, match=r"long\.toml"):
        run_benchmark(benchmark, tmp_path / "new")


FORMATTED = ReaderSettings(format="A9", orientation=Orientation.UPRIGHT)
BOXES = (Box(0.0, 0.0, 1.0, 2.0), Box(1.0, 0.0, 2.0, 2.0))


def lattice(**belief: tuple[float, float]) -> Lattice:
    """Of two places: characters, and the belief in each at either."""
    with np.errstate(divide="ignore"):
        log = np.log(np.array([belief[char] for char in sorted(belief)]).T)
    return Lattice(tuple(char.strip("_") for char in sorted(belief)), log, boxes=BOXES)


def test_an_expert_alone_reads_what_the_format_makes_of_its_beliefs() -> None:
    beliefs = lattice(B=(0.001, 0.0), Z=(0.997, 0.001), _2=(0.001, 0.998), _8=(0.001, 0.001))
    doubting = lattice(B=(0.3, 0.6), Z=(0.2, 0.0), _2=(0.0, 0.2), _8=(0.5, 0.2))
    line = replace(believed_line(beliefs), by_expert={"network": beliefs, "templates": doubting})

    def whole(line: ReadLine, source: Source = "tactile") -> Reading:
        log = Log(seconds={"scan": 2.0})
        return decide(Evidence.of(SenseEvidence(source, lines=PartLines(line), log=log)), FORMATTED)

    sure, unsure = (expert_alone(whole(line), name, FORMATTED) for name in ("network", "templates"))
    assert (sure.text, sure.decision, sure.source) == ("Z2", Decision.ACCEPT, "tactile")
    assert sure.seconds["scan"] == 2.0
    assert unsure.text[0] == "B"  # it believed in an 8 there, which is no letter
    assert unsure.decision is Decision.REVIEW
    silent = expert_alone(whole(replace(line, by_expert={}), "vision"), "network", FORMATTED)
    assert (silent.text, silent.decision) == ("", Decision.REJECT)


def test_experts_belong_to_the_modes_that_they_have_a_say_in() -> None:
    assert experts_in(("vision", "rapidocr photo")) == ("vision network",)
    assert experts_in(("fused",)) == ("tactile network", "tactile templates", "vision network")
    assert experts_in(("tactile",)) == ("tactile network", "tactile templates")


def test_four_lights_are_read_as_one_and_the_camera_alone_reads_one() -> None:
    parts = designed_parts(parts=1)
    item = parts.items()[0]
    specimen, reader = parts.make(item), Reader(ReaderSettings(format=item.condition.format))
    senses = PartReadings(specimen, reader)
    several, single = (open_mode(name, reader).read(senses)[0] for name in ("lights", "vision"))
    assert (several.photos, single.photos) == (4, 1)
    assert several.text == single.text == specimen.truth
    # what other modes take is not charged to it
    assert {"photographs", "lights", "photograph", "vision"} == senses.seconds.keys()
    folder = PartReadings(replace(specimen, take_lights=None), reader)
    with pytest.raises(MarksError, match="no photographs under several lights"):
        open_mode("lights", reader).read(folder)


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
