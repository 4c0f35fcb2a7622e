"""A photograph's code beside its serial: the same is noted, another is a review, none changes nothing."""

from __future__ import annotations

from dataclasses import replace

import pytest

from glyphs.camera.photo import Photo
from recognition.decision.contracts import checked_by_codes
from recognition.decision.decide import Decision, ReadingFlag
from recognition.reader import Reader
from recognition.views.codes import Code
from tests.support.codes import ENVELOPE, stamped_photo, with_code
from tests.support.readings import reading_of

TEXT = "KB740215"
READ = reading_of(TEXT, source="vision")


def code(text: str) -> Code:
    return Code("Data Matrix", text, ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)))


@pytest.fixture(scope="module")
def reader() -> Reader:
    return Reader(format="AA999999", height_mm=5.0)


@pytest.fixture(scope="module")
def photo() -> Photo:
    return stamped_photo(TEXT)


def test_the_same_serial_is_noted_and_changes_nothing_else(reader: Reader, photo: Photo) -> None:
    plain, beside = reader.read(photo), reader.read(with_code(photo, ENVELOPE.format(TEXT), turn_deg=20.0))
    assert plain.decision is beside.decision is Decision.ACCEPT
    assert (plain.text, plain.codes, plain.messages()) == (TEXT, (), ())
    assert (beside.text, beside.others) == (TEXT, ())
    assert beside.messages() == ("the Data Matrix holds the same serial",)
    assert beside.trace.photo is not None
    # what is kept and shown is the photograph as taken, code and all
    assert beside.trace.photo.pixels.min() < plain.trace.photo.pixels.min()  # type: ignore[union-attr]


def test_another_serial_is_a_review_with_both_shown(reader: Reader, photo: Photo) -> None:
    found = reader.read(with_code(photo, "SER KB740216", contrast=0.3))
    assert (found.text, found.decision) == (TEXT, Decision.REVIEW)
    assert found.flags & ReadingFlag.CODE_DISAGREES
    assert found.messages() == (
        "the Data Matrix holds “SER KB740216”, the marks read “KB740215” (look at the part)",
    )


def test_a_code_that_cannot_be_decoded_changes_no_word(reader: Reader, photo: Photo) -> None:
    # far smaller than characters: nothing that could be read either
    found = reader.read(with_code(photo, "SER KB740216", module_px=1.0, contrast=0.3))
    assert (found.text, found.codes) == (TEXT, ())
    assert not found.flags & ReadingFlag.CODE_DISAGREES


def test_one_code_of_several_is_enough() -> None:
    other, own = code("(01)09501101530003"), code("SER KB740215")
    assert checked_by_codes(READ, (other, own)).decision is Decision.ACCEPT
    assert checked_by_codes(READ, (code("4711"), own)).decision is Decision.ACCEPT
    assert checked_by_codes(READ, (code("4711"), other)).decision is Decision.REVIEW


def test_a_code_that_speaks_of_no_serial_is_kept_and_says_nothing() -> None:
    found = checked_by_codes(READ, (code("MFR 0AB12/PNR 7"),))
    assert (found.decision, found.messages(), len(found.codes)) == (Decision.ACCEPT, (), 1)


def test_nothing_read_is_compared_with_nothing() -> None:
    nothing = replace(READ, characters=(), flags=ReadingFlag.NO_CHARACTERS)
    found = checked_by_codes(nothing, (code("SER KB740216"),))
    assert (found.decision, found.flags, found.codes[0].text) == (
        Decision.REJECT,
        ReadingFlag.NO_CHARACTERS,
        "SER KB740216",
    )


def test_asked_anew_the_last_answer_counts() -> None:
    wrong = checked_by_codes(READ, (code("4711"),))
    assert checked_by_codes(wrong, (code(TEXT),)).decision is Decision.ACCEPT
    assert checked_by_codes(wrong, ()).findings == ()
    assert len(checked_by_codes(wrong, (code("4711"),)).findings) == 1
