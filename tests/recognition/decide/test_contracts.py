"""Contracts beside the text: a certificate, codes on the part, characters that a font was never taught."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from glyphs.camera.photo import Photo
from glyphs.fonts.outlines import load_font
from glyphs.stamping.faces import Face
from recognition.decide import risk as room
from recognition.decide.decide import decide
from recognition.decide.decision import CertifiedAcceptance, Decision, ReadingFlag
from recognition.decide.evidence import Evidence, Log, SenseEvidence, Source
from recognition.decide.judges.score import certificate, other_texts
from recognition.decide.judges.strokes import guessed_characters
from recognition.decide.reading import Reading
from recognition.find.part_lines import PartLines
from recognition.language.grammar import Grammar
from recognition.language.lattice import Lattice
from recognition.language.orientation import Orientation
from recognition.reader import Reader
from recognition.see.codes import Code
from recognition.settings import ReaderSettings
from tests.support.codes import ENVELOPE, stamped_photo, with_code
from tests.support.evidence import believed_line, judged, sense_of, text_of

ALLOWED = CertifiedAcceptance(0.995, ("tactile",))
TEXT = "KB740215"
READ = Lattice(tuple(TEXT), np.log(np.eye(len(TEXT)) * 0.9999 + 1e-9))
SETTINGS = ReaderSettings(orientation=Orientation.UPRIGHT)


def under(allowed: CertifiedAcceptance | None, score: float = 0.996, source: Source = "tactile") -> str:
    """What a certificate says of a text with a score."""
    findings = judged(
        text_of("A", score=score, threshold=0.97, source=source),
        certificate,
        settings=replace(SETTINGS, certified=allowed),
    )
    assert all(finding.flag is ReadingFlag.NOT_CERTIFIED for finding in findings)
    return " ".join(finding.text for finding in findings)


def test_what_it_vouches_for_passes_unchanged() -> None:
    assert under(ALLOWED) == under(None) == ""
    # records keep six digits, and the certificate rests on those
    assert under(ALLOWED, 0.9949996) == ""


def test_what_is_less_sure_goes_to_review_and_says_why() -> None:
    assert under(ALLOWED, 0.994) == "confidence 0.9940, certified from 0.995"


def test_a_sense_that_was_not_certified_is_not_accepted() -> None:
    assert under(ALLOWED, source="vision") == "the certificate does not cover this sense (vision)"
    assert under(CertifiedAcceptance(0.0, ())) != ""


def test_it_never_accepts_by_itself_and_speaks_only_of_what_would_be_accepted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    nothing = decide(Evidence.of(sense_of(None)), replace(SETTINGS, certified=ALLOWED))
    assert (nothing.decision, nothing.flags) == (Decision.REJECT, ReadingFlag.NO_CHARACTERS)
    monkeypatch.setattr(room, "threshold_of", lambda source, risk: 1.0)
    strict = replace(SETTINGS, certified=CertifiedAcceptance(1.1, ()))
    unsure = decide(Evidence.of(sense_of(READ)), strict)
    assert unsure.decision is Decision.REVIEW
    assert not unsure.flags & ReadingFlag.NOT_CERTIFIED


def test_a_text_after_others_must_be_surer() -> None:
    """Whichever look it was: at another height, without stains, after more passes."""
    again, other = frozenset({"A"}), frozenset({"B"})
    for texts, score, surer in ((again, 0.985, True), (other, 0.985, False), (other, 0.995, True)):
        sense = SenseEvidence("tactile", log=Log(other_texts=texts))
        choice = text_of("A", score=score, threshold=0.98, senses=(sense,))
        assert (judged(choice, other_texts) == ()) is surer


def code(text: str) -> Code:
    return Code("Data Matrix", text, ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)))


def beside(*codes: Code, read: Lattice | None = READ) -> Reading:
    """What a photograph with these codes reads."""
    return decide(Evidence.of(sense_of(read, "vision", codes=codes)), SETTINGS)


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
    # what is kept and shown is the photograph as taken, code and all
    assert beside.trace.photo.pixels.min() < plain.trace.photo.pixels.min()  # type: ignore[union-attr]


def test_another_serial_is_a_review_with_both_shown(reader: Reader, photo: Photo) -> None:
    reading = reader.read(with_code(photo, "SER KB740216", contrast=0.3))
    assert (reading.text, reading.decision) == (TEXT, Decision.REVIEW)
    assert reading.flags & ReadingFlag.CODE_DISAGREES
    assert reading.messages() == (
        "the Data Matrix holds “SER KB740216”, the marks read “KB740215” (look at the part)",
    )


def test_one_code_of_several_is_enough() -> None:
    other, matching = code("(01)09501101530003"), code("SER KB740215")
    assert beside(other, matching).decision is Decision.ACCEPT
    assert beside(code("4711"), matching).decision is Decision.ACCEPT
    assert beside(code("4711"), other).decision is Decision.REVIEW


def test_a_code_that_speaks_of_no_serial_is_kept_and_says_nothing() -> None:
    reading = beside(code("MFR 0AB12/PNR 7"))
    assert (reading.decision, reading.messages(), len(reading.codes)) == (Decision.ACCEPT, (), 1)


def test_nothing_read_is_compared_with_nothing() -> None:
    reading = beside(code("SER KB740216"), read=None)
    assert (reading.decision, reading.flags, reading.codes[0].text) == (
        Decision.REJECT,
        ReadingFlag.NO_CHARACTERS,
        "SER KB740216",
    )


CHARS = ("E", "F", "Q", "O")


def font(guessed):
    gothic = load_font("gothic")
    return replace(gothic, glyphs={c: replace(gothic.glyphs[c], guessed=c in guessed) for c in CHARS})


def doubted(text, scores, *, guessed, places=None):
    """What is said of a text that templates alone have read, from the fits of each character at each place."""
    fits = [{c: SimpleNamespace(fit=fit) for c, fit in zip(CHARS, row, strict=True)} for row in scores]
    laid = SimpleNamespace(
        font=font(guessed),
        face=Face.FLAT,
        laid=[row[c] for c, row in zip(text, fits, strict=True)],
        felt=SimpleNamespace(lay=lambda place, char, font, face: fits[place][char]),
    )
    line = replace(believed_line(READ), by_expert={"templates": READ})
    sense = SenseEvidence("tactile", lines=PartLines(line))
    choice = text_of(text, font="press-7", senses=(sense,))
    choice.marks.in_own_font = laid
    assert choice.font == laid.font.name
    settings = replace(SETTINGS, format=None if places is None else Grammar(sets=places))
    return [finding.text for finding in judged(choice, guessed_characters, settings=settings)]


def test_a_font_felt_whole_is_trusted():
    assert doubted("E", [(0.93, 0.92, 0.1, 0.1)], guessed="") == []


def test_a_guess_that_comes_near_sends_the_reading_to_review():
    findings = doubted("EQ", [(0.93, 0.92, 0.1, 0.1), (0.1, 0.1, 0.97, 0.8)], guessed="F")
    assert findings == ["place 1: F was never enrolled in gothic"]


def test_a_guess_that_was_read_does_so_too():
    assert doubted("F", [(0.2, 0.95, 0.1, 0.1)], guessed="F") != []


def test_a_guess_far_off_or_not_allowed_there_does_not():
    assert doubted("E", [(0.97, 0.85, 0.1, 0.1)], guessed="F") == []
    near = [(0.93, 0.92, 0.1, 0.1)]
    assert doubted("E", near, guessed="F", places=("EQ",)) == []
    assert doubted("E", near, guessed="F", places=("EFQ",)) != []
