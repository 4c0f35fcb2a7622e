"""What is kept of a part, whatever happens to it."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from glyphs.surface.maps import HeightMap, MapError
from pipeline.common.reading_records import CodeRecord, LineRecord, ReadingRecord, from_json, to_json
from pipeline.common.row import row_of
from pipeline.common.settings import ReadSettings
from pipeline.common.version import key_of, program_version
from pipeline.formats.find_parts import discover
from pipeline.formats.npz import write_npz
from pipeline.formats.part_files import PartFiles
from pipeline.reading.as_record import reading_record, rivals_of
from pipeline.reading.part_job import PartJob, read_listed
from recognition.decide.decision import Finding, ReadingFlag
from recognition.decide.evidence import Evidence, Log, SenseEvidence
from recognition.decide.reading import Candidate, CharacterReading, OtherLine, Reading
from recognition.language.box import Box
from recognition.language.grammar import Grammar
from recognition.language.lattice import Lattice
from recognition.marks.depth import MarkDepth
from recognition.see.codes import Code
from recognition.settings import ReaderSettings
from recognition.surface import Surface

BOX = Box(0.0, 0.0, 1.0, 1.0)


def reading(text: str) -> Reading:
    characters = tuple(
        CharacterReading(
            (Candidate(c, 0.9, 0.9), Candidate("X", 0.4, 0.08), Candidate("Y", 0.1, 0.002)), BOX, depth
        )
        for c, depth in zip(text, (MarkDepth(0.23141, 0.21211, 0.25), None), strict=True)
    )
    return Reading(
        characters,
        0.97,
        (
            Finding.of(ReadingFlag.DROPOUTS),
            Finding(ReadingFlag.TOO_SHALLOW, "too shallow for x: 1 0.212 mm (at least 0.3)"),
        ),
        font="gothic",
        height_mm=5.0,
        raised=True,
    )


class FakeReader:
    """Reads the number of columns."""

    settings, grammar = ReaderSettings(), None

    def feel(self, surface: Surface) -> SenseEvidence:
        value = surface.height_map.shape[1]
        if value == 13:
            raise RuntimeError("a fault\nin the reader")
        if value == 14:
            raise MapError("no such thing")
        return SenseEvidence("tactile", log=Log(surface=surface.height_map))

    def decide(self, evidence: Evidence) -> Reading:
        assert evidence.touch is not None
        assert evidence.touch.log.surface is not None
        return reading(str(evidence.touch.log.surface.shape[1]))


@pytest.fixture(autouse=True)
def _fake_readers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pipeline.reading.readers.reader_of", lambda _, **__: FakeReader())


def record_of(part: PartFiles) -> ReadingRecord:
    return read_listed(PartJob(settings=ReadSettings(format=("99",))), part).record


def stamped(folder: Path, *values: int) -> Path:
    for value in values:
        write_npz(folder / f"part-{value}.npz", HeightMap(np.zeros((9, value), np.float32), 0.1))
    return folder


def test_one_bad_file_is_one_row(tmp_path: Path) -> None:
    stamped(tmp_path, 11, 12, 13, 14)
    (tmp_path / "part-12.npz").write_bytes(b"rubbish")
    rows = [record_of(part) for part in discover([tmp_path, tmp_path / "none.npz"])]
    assert [r.part for r in rows] == ["part-11", "part-12", "part-13", "part-14", "none"]
    assert [r.text for r in rows] == ["11", "", "", "", ""]
    assert [bool(r.error) for r in rows] == [False, True, True, True, True]
    for row in rows[1:]:
        assert f"{row.part}.npz" in row.error
        assert "\n" not in row.error
        assert row.decision == ""
    assert "RuntimeError" in rows[2].error
    assert rows[3].error.endswith("part-14.npz: no such thing")
    assert rows[0].seconds > 0.0


def test_a_row_tells_the_reading(tmp_path: Path) -> None:
    (record,) = map(record_of, discover([stamped(tmp_path, 11)]))
    row = SimpleNamespace(**row_of(record))
    assert (row.decision, row.confidence, row.source, row.font) == ("review", 0.97, "tactile", "gothic")
    assert (row.height_mm, row.raised) == (5.0, True)
    pixels = reading_record(replace(reading("11"), unit="px"), ReadSettings(), None, part="p", seconds=0.1)
    assert (pixels.height_mm, pixels.height_px) == (None, 5.0)
    assert all(c.box_mm is None and c.box_px == (0.0, 0.0, 1.0, 1.0) for c in pixels.characters)
    assert row.flags == "; ".join(("too shallow for x: 1 0.212 mm (at least 0.3)", ReadingFlag.DROPOUTS.text))
    assert (row.depth_min_mm, row.depth_mean_mm) == (0.2121, 0.2314)
    assert row.depths == "1 0.212/0.231 1 ?"
    assert row.alternatives == "1: X 0.08; 2: X 0.08"
    # what nobody asked for is empty
    assert (row.expected, row.verdict, row.verify_probability) == ("", "", None)
    assert (row.states, row.grade, row.grades, row.action) == ("", "", "", "")
    assert row.rivals == ""
    # when, by what and with what it was read
    assert record.at is not None
    assert abs((datetime.now(UTC) - record.at).total_seconds()) < 60.0
    assert record.program == program_version()
    assert record.settings == key_of({"format": ["99"]})


def test_other_lines_stand_in_the_record() -> None:
    others = (OtherLine("lot", "LOT77", 0.98, BOX), OtherLine("", "12/26", 1.2))
    read = replace(reading("11"), others=others)
    made = reading_record(read, ReadSettings(), None, part="p", seconds=0.1)
    assert made.lines == (
        LineRecord("lot", "LOT77", 0.98, (0.0, 0.0, 1.0, 1.0)),
        LineRecord("", "12/26", 1.0),
    )
    (lot, _) = reading_record(replace(read, unit="px"), ReadSettings(), None, part="p", seconds=0.1).lines
    assert (lot.box_mm, lot.box_px) == (None, (0.0, 0.0, 1.0, 1.0))


def test_codes_stand_in_the_record_with_what_they_say_of_the_serial() -> None:
    corners = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))
    codes = (
        Code("Data Matrix", "SER 11", corners),
        Code("QR Code", "SER 17"),
        Code("QR Code", "PNR 7", corners),
    )
    read = replace(reading("11"), codes=codes)
    made = reading_record(read, ReadSettings(), None, part="p", seconds=0.1)
    assert made.codes == (
        CodeRecord("Data Matrix", "SER 11", True, (0.0, 0.0, 1.0, 1.0)),
        CodeRecord("QR Code", "SER 17", False),
        CodeRecord("QR Code", "PNR 7", None, (0.0, 0.0, 1.0, 1.0)),
    )
    assert from_json(ReadingRecord, to_json(made)) == made
    assert row_of(made)["codes"] == "SER 11 (same) | SER 17 (other) | PNR 7"
    (first, *_) = reading_record(replace(read, unit="px"), ReadSettings(), None, part="p", seconds=0.1).codes
    assert (first.box_mm, first.box_px) == (None, (0.0, 0.0, 1.0, 1.0))
    nothing = replace(reading("11"), characters=(), codes=codes)
    assert reading_record(nothing, ReadSettings(), None, part="p", seconds=0.1).codes[0].same is None


# ---------------------------------------------------------------------------------------------------- rivals


def chosen(*places: tuple[tuple[str, float], ...]) -> Reading:
    characters = tuple(CharacterReading(tuple(Candidate(c, p, p) for c, p in place), BOX) for place in places)
    return Reading(characters, 0.5)


PAIR = chosen((("8", 0.7), ("B", 0.29)), (("1", 0.6), ("7", 0.39)))


def lattice() -> Lattice:
    belief = np.array([[0.7, 0.29, 0.0, 0.0], [0.0, 0.0, 0.6, 0.39]])
    with np.errstate(divide="ignore"):
        return Lattice(("8", "B", "1", "7"), np.log(belief))


def test_rivals_are_whole_serials_of_the_format() -> None:
    free = rivals_of(PAIR, lattice(), None)
    assert [r.text for r in free] == ["87", "B1", "B7"]
    # 0.99 of belief in something at each place: the products as they are, but for doubt that counts once
    assert [r.probability for r in free] == pytest.approx([0.273, 0.174, 0.113], abs=0.001)
    (only,) = rivals_of(PAIR, lattice(), Grammar(lexicon=frozenset({"81", "B7", "8888"})))
    assert only.text == "B7"
