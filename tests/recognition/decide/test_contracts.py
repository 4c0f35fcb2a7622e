"""Contracts beside the text: a certificate, codes on the part, characters that a font was never taught."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import pytest

from glyphs.camera.photo import Photo
from glyphs.fonts.outlines import load_font
from glyphs.stamping.faces import Face
from recognition.decide.contracts import (
    CertifiedAcceptance,
    as_certified,
    checked_by_codes,
    doubted_guesses,
)
from recognition.decide.decision import Decision, ReadingFlag
from recognition.language.confusions import CharacterState, PlaceState
from recognition.reader import Reader
from recognition.views.codes import Code
from tests.support.codes import ENVELOPE, stamped_photo, with_code
from tests.support.readings import reading_of

SURE = reading_of("A", 0.995)
ALLOWED = CertifiedAcceptance(0.995, ("tactile",))


def test_what_it_vouches_for_passes_unchanged() -> None:
    assert as_certified(SURE, ALLOWED) is SURE
    assert as_certified(SURE, None) is SURE
    # records keep six digits, and the certificate rests on those
    assert as_certified(replace(SURE, confidence=0.9949996), ALLOWED).decision is Decision.ACCEPT


def test_what_is_less_sure_goes_to_review_and_says_why() -> None:
    found = as_certified(replace(SURE, confidence=0.994), ALLOWED)
    assert found.decision is Decision.REVIEW
    assert ReadingFlag.NOT_CERTIFIED in found.flags
    assert found.messages()[-1] == "confidence 0.9940, certified from 0.995"


def test_a_sense_that_was_not_certified_is_not_accepted() -> None:
    assert as_certified(replace(SURE, source="vision"), ALLOWED).decision is Decision.REVIEW
    assert as_certified(SURE, CertifiedAcceptance(0.0, ())).decision is Decision.REVIEW


def test_it_never_accepts_by_itself() -> None:
    for doubted in (replace(SURE, threshold=0.999), replace(SURE, characters=())):
        assert doubted.decision is not Decision.ACCEPT
        assert as_certified(doubted, ALLOWED) is doubted


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


CHARS = ("E", "F", "Q", "O")


def font(guessed):
    gothic = load_font("gothic")
    return replace(gothic, glyphs={c: replace(gothic.glyphs[c], guessed=c in guessed) for c in CHARS})


def doubted(text, scores, *, guessed, places=None, state=None):
    reading = reading_of(text, font="press-7")
    reading = replace(reading, characters=tuple(replace(c, state=state) for c in reading.characters))
    fits = [{c: SimpleNamespace(fit=fit) for c, fit in zip(CHARS, row, strict=True)} for row in scores]
    laid = SimpleNamespace(
        font=font(guessed),
        face=Face.FLAT,
        text=tuple(text),
        laid=[row[c] for c, row in zip(text, fits, strict=True)],
        felt=SimpleNamespace(lay=lambda place, char, font, face: fits[place][char]),
    )
    return doubted_guesses(reading, laid, places)


def test_a_font_felt_whole_is_trusted():
    reading = doubted("E", [(0.93, 0.92, 0.1, 0.1)], guessed="")
    assert reading.decision is Decision.ACCEPT
    assert reading.findings == ()


def test_a_guess_that_comes_near_sends_the_reading_to_review():
    reading = doubted("EQ", [(0.93, 0.92, 0.1, 0.1), (0.1, 0.1, 0.97, 0.8)], guessed="F")
    assert reading.decision is Decision.REVIEW
    assert ReadingFlag.FOREIGN_SHAPES in reading.flags
    assert reading.messages() == ("place 1: F was never enrolled in press-7",)


def test_a_guess_that_was_read_does_so_too():
    reading = doubted("F", [(0.2, 0.95, 0.1, 0.1)], guessed="F")
    assert reading.decision is Decision.REVIEW


def test_a_guess_far_off_or_not_allowed_there_does_not():
    assert doubted("E", [(0.97, 0.85, 0.1, 0.1)], guessed="F").decision is Decision.ACCEPT
    near = [(0.93, 0.92, 0.1, 0.1)]
    assert doubted("E", near, guessed="F", places=("EQ",)).decision is Decision.ACCEPT
    assert doubted("E", near, guessed="F", places=("EFQ",)).decision is Decision.REVIEW


def test_what_cannot_be_read_stays_rejected():
    state = PlaceState(CharacterState.NOT_READ, "E", 0.1)
    assert doubted("E", [(0.93, 0.92, 0.1, 0.1)], guessed="F", state=state).decision is Decision.REJECT
