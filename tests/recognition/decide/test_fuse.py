"""Both senses as one: against Bayes by hand, and what must never happen."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from glyphs.camera.photo import Photo
from recognition.decide import risk as room
from recognition.decide.decide import decide
from recognition.decide.decision import Decision, ReadingFlag
from recognition.decide.evidence import Evidence, SenseEvidence
from recognition.decide.fuse_lattices import FusionWeights, fuse_lattices, lead_nats
from recognition.decide.reading import Reading
from recognition.find.part_lines import PartLines
from recognition.language.box import Box
from recognition.language.constrained_decoding import choose
from recognition.language.grammar import Grammar
from recognition.language.lattice import Lattice
from recognition.language.orientation import Orientation
from recognition.see.codes import Code
from recognition.settings import ReaderSettings
from tests.support.evidence import believed_line, sense_of

CHARS = tuple("ABC12")
EXACT = 1e-9
"""Relative: a handful of products in another order."""
SETTINGS = ReaderSettings(format="AA9999", orientation=Orientation.UPRIGHT)
ANYTHING = replace(SETTINGS, format=None)
EIGHT = replace(SETTINGS, format="AA999999")
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


def touch(beliefs: Lattice | None, **more: Any) -> SenseEvidence:
    """What touch has read with these beliefs."""
    return sense_of(beliefs, "tactile", **more)


def vision(beliefs: Lattice | None, **more: Any) -> SenseEvidence:
    """What the camera has read with these beliefs."""
    return sense_of(beliefs, "vision", **more)


def alone(sense: SenseEvidence, settings: ReaderSettings = SETTINGS) -> Reading:
    return decide(Evidence.of(sense), settings)


def fuse(felt: SenseEvidence, seen: SenseEvidence, settings: ReaderSettings) -> Reading:
    return decide(Evidence.of(felt).joined(Evidence.of(seen)), settings)


@st.composite
def lattices(draw: st.DrawFn) -> Lattice:
    belief = draw(arrays(np.float64, (3, len(CHARS) + 1), elements=st.floats(0.01, 1.0)))
    return lattice((belief / belief.sum(axis=1, keepdims=True))[:, :-1])


INDEPENDENT = FusionWeights(1.0, 1.0)


@settings(deadline=None, max_examples=25)
@given(lattices(), lattices(), st.floats(0.0, 1.5))
def test_bayes_by_hand(one: Lattice, other: Lattice, camera: float) -> None:
    """A sense looked with the probability r, and is a uniform guess otherwise; the camera counts by its weight."""
    both = np.exp(fuse_lattices(one, other, weights=FusionWeights(1.0, camera)).log_belief)
    for k in range(3):
        a, b = np.exp(one.log_belief[k]), np.exp(other.log_belief[k])
        p = (a + (1 - a.sum()) / a.size) * (b + (1 - b.sum()) / b.size) ** camera
        read = 1.0 - (1.0 - a.sum()) * (1.0 - b.sum())
        np.testing.assert_allclose(both[k], read * p / p.sum(), rtol=EXACT)


@settings(deadline=None, max_examples=25)
@given(lattices(), lattices())
def test_beliefs_stay_beliefs(one: Lattice, other: Lattice) -> None:
    assert (np.exp(fuse_lattices(one, other).log_belief).sum(axis=1) <= 1.0 + EXACT).all()


@settings(deadline=None, max_examples=25)
@given(lattices())
def test_a_camera_that_sees_nothing_has_no_weight(felt: Lattice) -> None:
    blind = replace(felt, log_belief=np.full(felt.log_belief.shape, -np.inf))
    even = replace(felt, log_belief=np.full(felt.log_belief.shape, -np.log(len(CHARS))))
    other = replace(felt, log_belief=felt.log_belief[:, ::-1])
    for both in (
        fuse_lattices(felt, blind, weights=INDEPENDENT),
        fuse_lattices(felt, even, weights=INDEPENDENT),
        fuse_lattices(felt, other, weights=FusionWeights(1.0, 0.0)),
    ):
        shares = np.exp(both.log_belief - np.logaddexp.reduce(both.log_belief, axis=1)[:, None])
        unread = 1.0 - np.exp(felt.log_belief).sum(axis=1, keepdims=True)
        np.testing.assert_allclose(shares, np.exp(felt.log_belief) + unread / len(CHARS), rtol=1e-6)


def test_touch_is_believed_where_the_camera_is_as_sure_of_another_character() -> None:
    assert choose(fuse_lattices(of_text("AB12", 0.9), of_text("BA21", 0.9)), None).text == "AB12"


def test_a_text_is_no_surer_of_both_than_the_number_of_its_characters_is_of_touch() -> None:
    sure, seen = touch(of_text("AB1234", 0.9999)), vision(of_text("AB1234", 0.999))
    # of touch, whether there are six characters is open
    counted = touch(of_text("AB1234", 0.9999), likely=0.5)
    assert fuse(counted, seen, SETTINGS).trace.odds == pytest.approx(0.0, abs=0.01)
    assert fuse(sure, seen, SETTINGS).confidence > fuse(counted, seen, SETTINGS).confidence


def test_other_numbers_of_places_are_refused() -> None:
    with pytest.raises(ValueError, match="6 and 4 places"):
        fuse_lattices(of_text("AB1234", 0.9), of_text("B123", 0.9))


def test_what_the_format_kept_from_vision_is_not_held_against_touch() -> None:
    touch = lattice(np.array([[0.6, 0.1, 0.1, 0.1, 0.1]]))
    figures = lattice(np.array([[0.0, 0.0, 0.0, 0.9, 0.1]]))
    both = fuse_lattices(touch, figures, weights=INDEPENDENT)
    odds = np.exp(both.log_belief[0, 0] - both.log_belief[0, 3])
    # 0.9 of two figures is 1.8 times what it would be unseen
    np.testing.assert_allclose(odds, 0.6 / (0.1 * 1.8), rtol=EXACT)


def test_a_search_cut_short_counts_only_beside_a_whole_one_that_accepts_the_same_text() -> None:
    felt, seen = touch(of_text("AB1234", 0.9999)), vision(of_text("AB1234", 0.99))
    cut = felt.logged(stopped="stopped after 2 s")
    assert alone(felt).decision is Decision.ACCEPT
    assert (alone(cut).decision, alone(cut).flags) == (Decision.REVIEW, ReadingFlag.SEARCH_STOPPED)
    assert fuse(felt, seen.logged(stopped="stopped after 2 s"), SETTINGS).decision is Decision.ACCEPT
    doubtful = vision(of_text("AB1234", [0.999, 0.999, 0.8, 0.999, 0.999, 0.999], rival="AB7234"))
    both = fuse(cut, doubtful, SETTINGS)
    assert (both.text, both.decision) == ("AB1234", Decision.REVIEW)
    assert ReadingFlag.SEARCH_STOPPED in both.flags


def test_both_doubtful_of_the_same_are_sure_together() -> None:
    doubtful = touch(of_text("AB1234", [0.999, 0.999, 0.8, 0.999, 0.999, 0.999], rival="AB7234"))
    read = fuse(doubtful, vision(of_text("AB1234", 0.999)), SETTINGS)
    assert alone(doubtful).decision is Decision.REVIEW
    assert (read.text, read.decision, read.source) == ("AB1234", Decision.ACCEPT, "fused")
    assert read.confidence > 0.9


def test_a_camera_that_dirt_misleads_does_not_make_touch_less_sure() -> None:
    felt = touch(of_text("AB1234", [0.9999, 0.9999, 0.995, 0.9999, 0.9999, 0.9999], rival="AB7234"))
    misled = vision(of_text("AB1234", [0.9, 0.9, 0.2, 0.9, 0.9, 0.9], rival="AB7234"))
    read, by_touch = fuse(felt, misled, SETTINGS), alone(felt)
    assert (read.text, read.decision, read.source) == ("AB1234", Decision.ACCEPT, "fused")
    assert read.confidence == by_touch.confidence > min(place.confidence for place in read.characters)


@pytest.mark.parametrize(("risk", "threshold"), [(None, 0.98), (0.01, 0.999)])
def test_both_accept_at_small_risks_what_touch_accepts_alone(
    risk: float | None, threshold: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    least = {"tactile": 0.98, "vision": 0.99, "fused": 0.999}
    monkeypatch.setattr(room, "threshold_of", lambda source, risk: least[source])
    known = replace(SETTINGS, accept_risk=risk)
    felt = touch(of_text("AB1234", [0.9999, 0.9999, 0.995, 0.9999, 0.9999, 0.9999], rival="AB7234"))
    misled = vision(of_text("AB1234", [0.9, 0.9, 0.2, 0.9, 0.9, 0.9], rival="AB7234"))
    read = fuse(felt, misled, known)
    assert 0.98 < read.confidence == alone(felt, known).confidence < 0.999
    assert read.threshold == threshold
    assert read.decision is (Decision.REVIEW if risk else Decision.ACCEPT)


def test_the_photograph_of_another_part_sends_it_to_review() -> None:
    read = fuse(touch(of_text("RY354206", 0.99999)), vision(of_text("TG391882", 0.999)), EIGHT)
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


@settings(max_examples=25, deadline=None)
@given(serials, serials, st.floats(0.9, 0.9999), st.floats(0.9, 0.9999))
def test_two_serials_are_never_accepted_as_one(
    felt: str, seen: str, doubt: float, other_doubt: float
) -> None:
    """Each sense is sure of its own text, whatever the numbers of characters and in whichever place they differ."""
    sure = (
        touch(of_text(felt, doubt ** (1 / len(felt)))),
        vision(of_text(seen, other_doubt ** (1 / len(seen)))),
    )
    read, (one, other) = fuse(*sure, ANYTHING), (alone(sense, ANYTHING) for sense in sure)
    apart = f"camera reads {seen}, touch {felt}: are they of one part?"
    if felt == seen:
        assert not read.flags & ReadingFlag.SENSES_DISAGREE
    elif one.decision is other.decision is Decision.ACCEPT:
        assert read.decision is not Decision.ACCEPT
        assert read.messages()[0] == apart


def test_a_camera_whose_doubts_add_up_is_not_outvoted() -> None:
    """It is unsure of every place, but far surer of its text than of the one that touch has read."""
    doubtful = vision(of_text("TG391882", 0.6))
    assert alone(doubtful, ANYTHING).confidence < 0.1
    read = fuse(touch(of_text("RY354206", 0.9999)), doubtful, ANYTHING)
    assert (read.text, read.decision) == ("RY354206", Decision.REVIEW)
    assert read.messages()[0].startswith("camera reads TG391882, touch RY354206")


def test_a_camera_misled_by_dirt_at_two_places_leaves_the_part_to_touch() -> None:
    beliefs = [0.99, 0.99, 0.99, 0.8, 0.8, 0.99, 0.99, 0.99]
    misled = vision(of_text("RY381206", beliefs, rival="RY354206"))
    read = fuse(touch(of_text("RY354206", 0.9999)), misled, EIGHT)
    assert (read.text, read.decision, read.findings) == ("RY354206", Decision.ACCEPT, ())


def unreadable(openly: Lattice) -> SenseEvidence:
    """Touch that can read nothing in the format where it has felt another text."""
    nothing = Lattice(tuple(LETTERS), np.full((6, len(LETTERS)), -np.inf))
    return SenseEvidence("tactile", lines=PartLines(believed_line(nothing, openly)))


def test_touch_that_felt_another_text_than_the_format_allows_is_not_passed_over() -> None:
    felt = unreadable(of_text("HOUSING", 0.9999))
    seen = vision(of_text("AB1234", 0.9999))
    read = fuse(felt, seen, SETTINGS)
    assert read.decision is Decision.REVIEW
    assert "camera reads AB1234, touch HOUSING: are they of one part?" in read.messages()
    for dirt in (of_text("HOUSING", 0.7), of_text("1I", 0.99999)):
        assert fuse(unreadable(dirt), seen, SETTINGS).decision is Decision.ACCEPT


@given(st.floats(0.01, 1.0))
def test_what_was_not_read_is_no_lead(read: float) -> None:
    seen = of_text("A", 0.9)
    lead = lead_nats(replace(seen, log_belief=seen.log_belief + np.log(read)), "A", "B")
    unread = (1.0 - read) / len(LETTERS)
    share = (1.0 - 0.9) / len(LETTERS)
    np.testing.assert_allclose(
        lead, np.log((read * (0.9 + share) + unread) / (read * share + unread)), rtol=1e-6
    )
    assert lead_nats(seen, "A", "ß") == lead_nats(seen, "A", "AB") == np.inf


def test_one_sense_alone() -> None:
    by_touch = fuse(touch(of_text("AB1234", 0.999)), vision(None), SETTINGS)
    assert (by_touch.text, by_touch.decision, by_touch.source) == ("AB1234", Decision.ACCEPT, "fused")
    by_vision = fuse(touch(None), vision(of_text("AB1234", 0.999)), SETTINGS)
    assert (by_vision.text, by_vision.source) == ("AB1234", "fused")
    # it is as sure as a camera by itself
    assert by_vision.confidence == pytest.approx(alone(vision(of_text("AB1234", 0.999))).confidence, abs=1e-3)
    by_none = fuse(touch(None), vision(None), SETTINGS)
    assert (by_none.text, by_none.decision) == ("", Decision.REJECT)


@pytest.mark.parametrize("text", ["AB1234", None])
def test_the_time_of_both_senses_is_kept(text: str | None) -> None:
    one = touch(of_text(text, 0.999) if text else None, seconds={"read": 2.0})
    other = vision(of_text("AB1234", 0.999), seconds={"read": 3.0})
    seconds = fuse(one, other, SETTINGS).seconds
    assert seconds["decide"] > 0.0
    assert seconds == {"read": 2.0, "vision read": 3.0, "decide": seconds["decide"]}


LINES = replace(SETTINGS, lines={"lot": "AAA99"})
SERIAL = of_text("AB1234", 0.999)


def lot(text: str, sure: float, *, named: bool = True) -> dict[str, Any]:
    """Another line, that was asked for or not."""
    line = believed_line(of_text(text, sure ** (1 / len(text))))
    return {"others": {"lot": line}} if named else {"unassigned": (line,)}


def test_the_camera_finds_a_line_that_touch_has_missed() -> None:
    missed, unseen = touch(SERIAL), vision(SERIAL)
    assert alone(missed, LINES).decision is Decision.REVIEW
    assert alone(missed, LINES).messages() == ("no text was read for the line lot",)
    camera = vision(SERIAL, **lot("LOT77", 0.999))
    read = fuse(missed, camera, LINES)
    assert (read.decision, read.others, read.messages()) == (
        Decision.ACCEPT, alone(camera, LINES).others, (),
    )  # fmt: skip
    still = fuse(missed, unseen, LINES)
    assert (still.decision, still.messages()) == (Decision.REVIEW, alone(missed, LINES).messages())


def test_a_doubtful_line_is_not_accepted_with_a_sure_serial() -> None:
    doubtful, sure, other = lot("LOT77", 0.5), lot("LOT77", 0.9999), lot("LOT11", 0.9999)
    both = fuse(touch(SERIAL, **doubtful), vision(SERIAL, **doubtful), LINES)
    assert (both.decision, both.messages()) == (Decision.REVIEW, ("low confidence: lot LOT77?",))
    assert fuse(touch(SERIAL, **doubtful), vision(SERIAL, **sure), LINES).decision is Decision.ACCEPT
    apart = fuse(touch(SERIAL, **sure), vision(SERIAL, **other), LINES)
    assert apart.decision is Decision.REVIEW
    assert apart.messages() == ("lot: touch has LOT77, the camera LOT11",)
    # by the camera alone it is doubted just so
    assert ReadingFlag.LINE_MISSING in fuse(touch(None), vision(SERIAL, **doubtful), LINES).flags


def test_a_line_nobody_asked_for_sends_to_review_whoever_reads_it() -> None:
    sure, more = lot("LOT77", 0.9999), lot("1226", 0.99, named=False)
    read = fuse(touch(SERIAL, **sure), vision(SERIAL, **sure, **more), LINES)
    assert read.decision is Decision.REVIEW
    assert [(line.name, line.text) for line in read.others] == [("lot", "LOT77"), ("", "1226")]
    # unless the other one has read it for the line that was asked for
    unnamed = lot("LOT77", 0.99, named=False)
    read = fuse(touch(SERIAL, **sure), vision(SERIAL, **unnamed), LINES)
    assert [(line.name, line.text) for line in read.others] == [("lot", "LOT77")]


def test_another_number_of_characters_is_another_text() -> None:
    """Doubtful, it leaves touch alone, and a note says so; sure, it is that of another part."""
    felt = touch(of_text("AB1234", 0.999, where=boxes(6)))
    read = fuse(felt, vision(of_text("B123", 0.8)), ANYTHING)
    note = "the camera has read B123, which has another number of characters; read by touch alone"
    assert (read.text, read.decision, read.messages()) == ("AB1234", Decision.ACCEPT, (note,))
    read = fuse(felt, vision(of_text("B123", 0.9999)), ANYTHING)
    assert (read.text, read.decision) == ("AB1234", Decision.REVIEW)
    assert read.messages() == ("camera reads B123, touch AB1234: are they of one part?", note)
    # nor is a sure touch outvoted by a camera that has read more
    read = fuse(touch(of_text("AB1234", 0.9999)), vision(of_text("AB12345", 0.5)), ANYTHING)
    assert read.text == "AB1234"


BLIND = replace(SETTINGS, format=Grammar.parse("vin"))
"""8 and H count alike in the check digit of a VIN."""
VIN, RIVAL = "1M8GDM9AXKP042788", "1MHGDM9AXKP042788"


@pytest.mark.parametrize("path", ["vision", "fused", "touch failed", "camera failed"])
def test_a_check_digit_blind_to_a_rival_keeps_every_path_from_acceptance(
    path: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(room, "threshold_of", lambda source, risk: 0.5)
    beliefs = of_text(VIN, [0.9999, 0.9999, 0.8, *[0.9999] * 14], rival=RIVAL)
    by_vision, by_touch = vision(beliefs), touch(beliefs)
    read = {
        "vision": alone(by_vision, BLIND),
        "fused": fuse(by_touch, by_vision, BLIND),
        "touch failed": fuse(touch(None), by_vision, BLIND),
        "camera failed": fuse(by_touch, vision(None), BLIND),
    }[path]
    assert read.text == VIN
    assert ReadingFlag.CHECK_BLIND in read.flags
    assert read.decision is Decision.REVIEW
    assert sum("8 may be H" in message for message in read.messages()) == 1


def test_a_camera_that_does_not_keep_the_risk_is_accepted_only_with_touch(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(room, "threshold_of", lambda source, risk: None if source == "vision" else 0.5)
    seen, strict = vision(of_text("AB1234", 0.99999)), replace(SETTINGS, accept_risk=0.001)
    for by_camera in (alone(seen, strict), fuse(touch(None), seen, strict)):
        assert (by_camera.text, by_camera.decision) == ("AB1234", Decision.REVIEW)
        assert by_camera.messages()[0].startswith("the camera cannot promise 1 in 1,000 (touch the part, or")
    both = fuse(touch(of_text("AB1234", 0.99999)), seen, strict)
    assert (both.decision, both.messages()) == (Decision.ACCEPT, ())


def test_a_code_is_compared_with_what_both_read() -> None:
    code = Code("QR Code", "SER AB1234", ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)))
    # the camera alone reads B for 8's twin and is held up by the code; touch knows better
    seen = vision(of_text("AB1284", 0.6, rival="AB1234"), codes=(code,))
    assert alone(seen).flags & ReadingFlag.CODE_DISAGREES
    reading = fuse(touch(of_text("AB1234", 0.999)), seen, SETTINGS)
    assert (reading.text, reading.codes) == ("AB1234", (code,))
    assert not reading.flags & ReadingFlag.CODE_DISAGREES
    assert reading.messages()[-1] == "the QR Code holds the same serial"
    # and where both read another than the code holds, a person looks
    sure = vision(of_text("AB1234", 0.999), codes=(replace(code, text="SER AB1235"),))
    reading = fuse(touch(of_text("AB1234", 0.999)), sure, SETTINGS)
    assert (reading.text, reading.decision) == ("AB1234", Decision.REVIEW)
    assert reading.flags & ReadingFlag.CODE_DISAGREES
    # by the camera alone, too
    assert fuse(touch(None), sure, SETTINGS).flags & ReadingFlag.CODE_DISAGREES


def test_a_code_in_a_photograph_without_a_scale_has_no_place_on_the_plate() -> None:
    code = Code("QR Code", "SER AB1234", ((0.0, 0.0), (40.0, 0.0), (40.0, 40.0), (0.0, 40.0)))
    seen = vision(of_text("AB1234", 0.99), codes=(code,), photo=Photo(np.zeros((20, 30), dtype=np.uint8)))
    (code_read,) = fuse(touch(of_text("AB1234", 0.999)), seen, SETTINGS).codes
    assert (code_read.text, code_read.box) == ("SER AB1234", None)
