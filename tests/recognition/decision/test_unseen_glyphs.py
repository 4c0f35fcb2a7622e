from dataclasses import replace
from types import SimpleNamespace

from glyphs.fonts.outlines import load_font
from glyphs.stamping.faces import Face
from recognition.decision.contracts import doubted_guesses
from recognition.decision.decide import Decision, ReadingFlag
from recognition.language.confusions import CharacterState, PlaceState
from tests.support.readings import reading_of

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
