"""Both senses as one: against Bayes by hand, and what must never happen."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from types import MappingProxyType

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from recognition.decision.contracts import checked_by_codes
from recognition.decision.decide import Decision, ReadingFlag
from recognition.decision.fuse import fuse
from recognition.decision.fuse_lattices import fuse_lattices, lead_nats
from recognition.decision.reading import OtherLine, Reading
from recognition.decision.reading_of_line import characters_of, contracts_of_choice, doubts_of_lines
from recognition.decision.score import log_odds, with_score
from recognition.language.box import Box
from recognition.language.constrained_decoding import choose
from recognition.language.grammar import Grammar
from recognition.language.lattice import Lattice
from recognition.senses.settings import ReaderSettings
from recognition.views.codes import Code

CHARS = tuple("ABC12")
EXACT = 1e-9
"""Relative: a handful of products in another order."""
SETTINGS = ReaderSettings(format="AA9999")
LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789"


def boxes(n: int) -> tuple[Box, ...]:
    return tuple(Box(4.0 * k, 0.0, 4.0 * k + 3.0, 5.0) for k in range(n))


def lattice(
    belief: NDArray[np.float64], where: tuple[Box, ...] = (), chars: tuple[str, ...] = CHARS
) -> Lattice:
    with np.errstate(divide="ignore"):
        return Lattice(chars, np.log(belief), where)


def of_text(text: str, sure: float | list[float], *, rival: str = "", where: tuple[Box, ...] = ()) -> Lattice:
    """Beliefs in a text; what is left goes to the rival's characters, or to all alike."""
    shares = [sure] * len(text) if isinstance(sure, float) else sure
    out = np.zeros((len(text), len(LETTERS)))
    for k, (char, share) in enumerate(zip(text, shares, strict=True)):
        left = 1.0 - share
        if rival and rival[k] != char:
            out[k, LETTERS.index(rival[k])] += 0.9 * left
            left *= 0.1
        out[k] += left / len(LETTERS)
        out[k, LETTERS.index(char)] += share
    return lattice(out, where, tuple(LETTERS))


def vision(
    beliefs: Lattice | None,
    settings: ReaderSettings = SETTINGS,
    *,
    grammar: Grammar | None = None,
    flags: ReadingFlag = ReadingFlag.NONE,
    source: str = "vision",
) -> Reading:
    """The reading that these beliefs make."""
    if beliefs is None:
        return Reading((), 0.0, ReadingFlag.NO_CHARACTERS, source=source)
    placed = beliefs if beliefs.boxes else replace(beliefs, boxes=boxes(beliefs.n_places))
    choice = choose(placed, grammar)
    made = Reading(
        tuple(characters_of(choice, placed)), choice.probability, flags, source=source,
        threshold=settings.accept_confidence,
    )  # fmt: skip
    made = made.with_trace(lattice=placed, odds=log_odds(choice.probability))
    return contracts_of_choice(made, choice, grammar)


touch = partial(vision, source="tactile")


@st.composite
def lattices(draw: st.DrawFn) -> Lattice:
    belief = draw(arrays(np.float64, (3, len(CHARS) + 1), elements=st.floats(0.01, 1.0)))
    return lattice((belief / belief.sum(axis=1, keepdims=True))[:, :-1])


@settings(deadline=None, max_examples=60)
@given(lattices(), lattices())
def test_bayes_by_hand(one: Lattice, other: Lattice) -> None:
    """A sense looked with the probability r, and is a uniform guess otherwise."""
    both = np.exp(fuse_lattices(one, other, power=1.0).log_belief)
    for k in range(3):
        a, b = np.exp(one.log_belief[k]), np.exp(other.log_belief[k])
        p = (a + (1 - a.sum()) / a.size) * (b + (1 - b.sum()) / b.size)
        read = 1.0 - (1.0 - a.sum()) * (1.0 - b.sum())
        np.testing.assert_allclose(both[k], read * p / p.sum(), rtol=EXACT)


@settings(deadline=None, max_examples=60)
@given(lattices(), lattices())
def test_beliefs_stay_beliefs(one: Lattice, other: Lattice) -> None:
    assert (np.exp(fuse_lattices(one, other).log_belief).sum(axis=1) <= 1.0 + EXACT).all()


def test_touch_is_believed_where_the_camera_is_as_sure_of_another_character() -> None:
    assert choose(fuse_lattices(of_text("AB12", 0.9), of_text("BA21", 0.9)), None).text == "AB12"


def test_a_text_is_no_surer_of_both_than_the_number_of_its_characters_is_of_touch() -> None:
    sure, seen = touch(of_text("AB1234", 0.9999)), vision(of_text("AB1234", 0.999))
    # of touch, whether there are six characters is open
    counted = with_score(sure.with_trace(odds=0.0))
    assert fuse(counted, seen, SETTINGS).trace.odds == 0.0
    assert fuse(sure, seen, SETTINGS).confidence > fuse(counted, seen, SETTINGS).confidence


def test_other_numbers_of_places_are_refused() -> None:
    with pytest.raises(ValueError, match="6 and 4 places"):
        fuse_lattices(of_text("AB1234", 0.9), of_text("B123", 0.9))


def test_what_the_format_kept_from_vision_is_not_held_against_touch() -> None:
    touch = lattice(np.array([[0.6, 0.1, 0.1, 0.1, 0.1]]))
    figures = lattice(np.array([[0.0, 0.0, 0.0, 0.9, 0.1]]))
    both = fuse_lattices(touch, figures, power=1.0)
    odds = np.exp(both.log_belief[0, 0] - both.log_belief[0, 3])
    # 0.9 of two figures is 1.8 times what it would be unseen
    np.testing.assert_allclose(odds, 0.6 / (0.1 * 1.8), rtol=EXACT)


@given(st.floats(0.3, 0.9999), st.floats(0.3, 0.9999))
@settings(max_examples=25, deadline=None)
def test_two_senses_in_doubt_are_no_surer_than_the_surer_one(felt: float, seen: float) -> None:
    one, other = with_score(touch(of_text("AB1234", felt))), with_score(vision(of_text("AB1234", seen)))
    read = fuse(one, other, SETTINGS)
    if Decision.ACCEPT not in (one.decision, other.decision):
        assert read.confidence <= max(one.confidence, other.confidence)
        assert read.decision is not Decision.ACCEPT


def test_both_doubtful_of_the_same_are_sure_together() -> None:
    doubtful = touch(of_text("AB1234", [0.999, 0.999, 0.8, 0.999, 0.999, 0.999], rival="AB7234"))
    read = fuse(doubtful, vision(of_text("AB1234", 0.999)), SETTINGS)
    assert doubtful.decision is Decision.REVIEW
    assert (read.text, read.decision, read.source) == ("AB1234", Decision.ACCEPT, "fused")
    assert read.confidence > 0.9


def test_the_photograph_of_another_part_sends_it_to_review() -> None:
    read = fuse(touch(of_text("RY354206", 0.9999)), vision(of_text("TG391882", 0.999)), SETTINGS)
    assert read.decision is Decision.REVIEW
    assert read.messages() == ("camera reads TG391882, touch RY354206: are they of one part?",)
    (finding,) = read.findings
    assert (finding.code, finding.places) == ("senses_disagree", (1, 2, 4, 5, 6, 7, 8))


def test_one_place_tells_two_parts_of_a_lot_apart() -> None:
    read = fuse(touch(of_text("AB1234", 0.9999)), vision(of_text("AB1284", 0.98)), SETTINGS)
    assert read.decision is Decision.REVIEW
    assert read.messages() == ("camera reads AB1284, touch AB1234: are they of one part?",)
    assert read.findings[0].places == (5,)


serials = st.text(alphabet=LETTERS, min_size=4, max_size=17)


@settings(max_examples=60, deadline=None)
@given(serials, serials, st.floats(0.9, 0.9999), st.floats(0.9, 0.9999))
def test_two_serials_are_never_accepted_as_one(
    felt: str, seen: str, doubt: float, other_doubt: float
) -> None:
    """Each sense is sure of its own text, whatever the numbers of characters and in whichever place they differ."""
    sure = (
        touch(of_text(felt, doubt ** (1 / len(felt)))),
        vision(of_text(seen, other_doubt ** (1 / len(seen)))),
    )
    one, other = (with_score(reading) for reading in sure)
    read = fuse(one, other, SETTINGS)
    apart = f"camera reads {seen}, touch {felt}: are they of one part?"
    if felt == seen:
        assert not read.flags & ReadingFlag.SENSES_DISAGREE
    elif one.decision is other.decision is Decision.ACCEPT:
        assert read.decision is not Decision.ACCEPT
        assert read.messages()[0] == apart


def test_a_camera_whose_doubts_add_up_is_not_outvoted() -> None:
    """It is unsure of every place, but far surer of its text than of the one that touch has read."""
    doubtful = vision(of_text("TG391882", 0.6))
    assert doubtful.confidence < 0.1
    read = fuse(touch(of_text("RY354206", 0.9999)), doubtful, SETTINGS)
    assert (read.text, read.decision) == ("RY354206", Decision.REVIEW)
    assert read.messages()[0].startswith("camera reads TG391882, touch RY354206")


def test_a_camera_misled_by_dirt_at_two_places_leaves_the_part_to_touch() -> None:
    beliefs = [0.99, 0.99, 0.99, 0.8, 0.8, 0.99, 0.99, 0.99]
    misled = vision(of_text("RY381206", beliefs, rival="RY354206"))
    read = fuse(touch(of_text("RY354206", 0.9999)), misled, SETTINGS)
    assert (read.text, read.decision, read.findings) == ("RY354206", Decision.ACCEPT, ())


def test_touch_that_felt_another_text_than_the_format_allows_is_not_passed_over() -> None:
    felt = touch(None).with_trace(open_lattice=of_text("HOUSING", 0.9999))
    seen = vision(of_text("AB1234", 0.9999))
    read = fuse(felt, seen, SETTINGS)
    assert read.decision is Decision.REVIEW
    assert "camera reads AB1234, touch HOUSING: are they of one part?" in read.messages()
    for dirt in (of_text("HOUSING", 0.7), of_text("1I", 0.99999)):
        assert fuse(touch(None).with_trace(open_lattice=dirt), seen, SETTINGS).decision is Decision.ACCEPT


@given(st.floats(0.01, 1.0))
def test_what_was_not_read_is_no_lead(read: float) -> None:
    seen = of_text("A", 0.9)
    lead = lead_nats(replace(seen, log_belief=seen.log_belief + np.log(read)), "A", "B")
    rest = (1.0 - read) / len(LETTERS)
    share = (1.0 - 0.9) / len(LETTERS)
    np.testing.assert_allclose(lead, np.log((read * (0.9 + share) + rest) / (read * share + rest)), rtol=1e-6)
    assert lead_nats(seen, "A", "ß") == lead_nats(seen, "A", "AB") == np.inf


def test_one_sense_alone() -> None:
    by_touch = fuse(touch(of_text("AB1234", 0.999)), vision(None), SETTINGS)
    assert (by_touch.text, by_touch.decision, by_touch.source) == ("AB1234", Decision.ACCEPT, "fused")
    by_vision = fuse(touch(None), vision(of_text("AB1234", 0.999)), SETTINGS)
    assert (by_vision.text, by_vision.source) == ("AB1234", "fused")
    # it is as sure as a camera by itself
    assert by_vision.confidence == pytest.approx(
        with_score(vision(of_text("AB1234", 0.999))).confidence, abs=1e-3
    )
    by_none = fuse(touch(None), vision(None), SETTINGS)
    assert (by_none.text, by_none.decision) == ("", Decision.REJECT)


@pytest.mark.parametrize("text", ["AB1234", None])
def test_the_time_of_both_senses_is_kept(text: str | None) -> None:
    one = replace(touch(of_text(text, 0.999) if text else None), seconds=MappingProxyType({"read": 2.0}))
    other = replace(vision(of_text("AB1234", 0.999)), seconds=MappingProxyType({"read": 3.0}))
    assert fuse(one, other, SETTINGS).seconds == {"read": 2.0, "vision read": 3.0}


LINES = ReaderSettings(format="AA9999", lines={"lot": "AAA99"})


def lines_of(reading: Reading, *others: OtherLine) -> Reading:
    """The reading with other lines, doubted as a sense by itself doubts them."""
    return replace(reading, others=others).with_findings(*doubts_of_lines(others, LINES))


def test_the_camera_finds_a_line_that_touch_has_missed() -> None:
    missed = lines_of(touch(of_text("AB1234", 0.999)))
    assert missed.decision is Decision.REVIEW
    assert missed.messages() == ("no text was read for the line lot",)
    camera = lines_of(vision(of_text("AB1234", 0.999)), OtherLine("lot", "LOT77", 0.99))
    read = fuse(missed, camera, LINES)
    assert (read.decision, read.others, read.messages()) == (Decision.ACCEPT, camera.others, ())
    still = fuse(missed, lines_of(vision(of_text("AB1234", 0.999))), LINES)
    assert (still.decision, still.messages()) == (Decision.REVIEW, missed.messages())


def test_a_doubtful_line_is_not_accepted_with_a_sure_serial() -> None:
    doubtful = OtherLine("lot", "LOT77", 0.5)
    sure, other = replace(doubtful, confidence=0.99), OtherLine("lot", "LOT11", 0.99)
    felt, seen = touch(of_text("AB1234", 0.999)), vision(of_text("AB1234", 0.999))
    both = fuse(lines_of(felt, doubtful), lines_of(seen, doubtful), LINES)
    assert (both.decision, both.messages()) == (Decision.REVIEW, ("low confidence: lot LOT77?",))
    assert fuse(lines_of(felt, doubtful), lines_of(seen, sure), LINES).decision is Decision.ACCEPT
    apart = fuse(lines_of(felt, sure), lines_of(seen, other), LINES)
    assert apart.decision is Decision.REVIEW
    assert apart.messages() == ("lot: touch has LOT77, the camera LOT11",)
    # by the camera alone it is doubted just so
    assert ReadingFlag.LINE_MISSING in fuse(touch(None), lines_of(seen, doubtful), LINES).flags


def test_a_line_nobody_asked_for_sends_to_review_whoever_reads_it() -> None:
    sure, more = OtherLine("lot", "LOT77", 0.99), OtherLine("", "12/26", 0.9)
    felt = lines_of(touch(of_text("AB1234", 0.999)), sure)
    read = fuse(felt, lines_of(vision(of_text("AB1234", 0.999)), sure, more), LINES)
    assert (read.decision, read.others) == (Decision.REVIEW, (sure, more))
    # unless the other one has read it for the line that was asked for
    unnamed = replace(sure, name="")
    assert fuse(felt, lines_of(vision(of_text("AB1234", 0.999)), unnamed), LINES).others == (sure,)


def test_another_number_of_characters_is_another_text() -> None:
    """Doubtful, it leaves touch alone, and a note says so; sure, it is that of another part."""
    felt = touch(of_text("AB1234", 0.999, where=boxes(6)))
    read = fuse(felt, vision(of_text("B123", 0.8)), SETTINGS)
    note = "the camera has read B123, which has another number of characters; read by touch alone"
    assert (read.text, read.decision, read.messages()) == ("AB1234", Decision.ACCEPT, (note,))
    read = fuse(felt, vision(of_text("B123", 0.9999)), SETTINGS)
    assert (read.text, read.decision) == ("AB1234", Decision.REVIEW)
    assert read.messages() == ("camera reads B123, touch AB1234: are they of one part?", note)
    # nor is a sure touch outvoted by a camera that has read more
    read = fuse(touch(of_text("AB1234", 0.9999)), vision(of_text("AB12345", 0.5)), SETTINGS)
    assert read.text == "AB1234"


BLIND = ReaderSettings(format=Grammar.parse("vin"), accept_confidence=0.5)
"""8 and H count alike in the check digit of a VIN."""
VIN, RIVAL = "1M8GDM9AXKP042788", "1MHGDM9AXKP042788"


@pytest.mark.parametrize("path", ["vision", "fused", "touch failed", "camera failed"])
def test_a_check_digit_blind_to_a_rival_keeps_every_path_from_acceptance(path: str) -> None:
    beliefs = of_text(VIN, [0.9999, 0.9999, 0.8, *[0.9999] * 14], rival=RIVAL)
    by_vision = vision(beliefs, BLIND, grammar=BLIND.grammar)
    by_touch = replace(by_vision, source="tactile")
    read = {
        "vision": by_vision,
        "fused": fuse(by_touch, by_vision, BLIND),
        "touch failed": fuse(touch(None), by_vision, BLIND),
        "camera failed": fuse(by_touch, vision(None), BLIND),
    }[path]
    assert read.text == VIN
    assert ReadingFlag.CHECK_BLIND in read.flags
    assert read.decision is Decision.REVIEW
    assert sum("8 may be H" in message for message in read.messages()) == 1


def test_a_code_is_compared_with_what_both_read() -> None:
    code = Code("QR Code", "SER AB1234", ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)))
    # the camera alone reads B for 8's twin and is held up by the code; touch knows better
    seen = checked_by_codes(vision(of_text("AB1284", 0.6, rival="AB1234")), (code,))
    assert seen.flags & ReadingFlag.CODE_DISAGREES
    made = fuse(touch(of_text("AB1234", 0.999)), seen, SETTINGS)
    assert (made.text, made.codes) == ("AB1234", (code,))
    assert not made.flags & ReadingFlag.CODE_DISAGREES
    assert made.messages()[-1] == "the QR Code holds the same serial"
    # and where both read another than the code holds, a person looks
    other = replace(code, text="SER AB1235")
    sure = checked_by_codes(vision(of_text("AB1234", 0.999)), (other,))
    made = fuse(touch(of_text("AB1234", 0.999)), sure, SETTINGS)
    assert (made.text, made.decision) == ("AB1234", Decision.REVIEW)
    assert made.flags & ReadingFlag.CODE_DISAGREES
    # by the camera alone, too
    assert fuse(touch(None), sure, SETTINGS).flags & ReadingFlag.CODE_DISAGREES


def test_a_code_in_a_photograph_without_a_scale_has_no_place_on_the_plate() -> None:
    code = Code("QR Code", "SER AB1234", ((0.0, 0.0), (40.0, 0.0), (40.0, 40.0), (0.0, 40.0)))
    seen = checked_by_codes(replace(vision(of_text("AB1234", 0.99)), unit="px"), (code,))
    (kept,) = fuse(touch(of_text("AB1234", 0.999)), seen, SETTINGS).codes
    assert (kept.text, kept.box) == ("SER AB1234", None)
