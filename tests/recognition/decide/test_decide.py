"""From beliefs of a line to a reading: gaps, other lines, a format that is overruled, and nothing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from recognition.decide.decide import decide
from recognition.decide.decision import BROKEN, EXPLANATIONS, Decision, Finding, ReadingFlag, decision_of
from recognition.decide.evidence import Evidence, Log, SenseEvidence, Source
from recognition.decide.judges.format import IN_FORMAT, small_letters
from recognition.decide.reading import Reading
from recognition.find.part_lines import PartLines
from recognition.find.request import LineFormat
from recognition.language.box import Box, hull
from recognition.language.confusions import CharacterState, PlaceState
from recognition.language.grammar import Grammar
from recognition.language.orientation import Orientation
from recognition.recogniser.read_line import ReadLine, combine_looks, word_gaps
from recognition.recogniser.steps import Steps
from recognition.see.text_line import HEIGHT_ROWS, TextLine
from recognition.settings import ReaderSettings

# ------------------------------------------------------------------------------------------------------------ decide

THRESHOLD = 0.9
CHARS = "AB812"
LINE = TextLine.straight(3.0, 10.0, length_mm=20.0, height_mm=5.0, turned_deg=2.0)


def rules(grammar: Grammar | None = None, lines: Mapping[str, LineFormat] | None = None) -> ReaderSettings:
    return ReaderSettings(format=grammar, lines=lines or {}, orientation=Orientation.UPRIGHT)


def line_of(
    text: str, *, sure: float = 0.999, rival: str = "", grammar: Grammar | None = None, at: TextLine = LINE
) -> ReadLine:
    """A line that the recogniser reads so, a character every 20 columns and a gap where there is a blank."""
    plain = text.replace(" ", "")
    columns = np.cumsum([20.0 if c != " " else 30.0 for c in text])[[c != " " for c in text]]
    blank, shares = np.full(2 * len(plain) + 1, 0.999), np.zeros((2 * len(plain) + 1, len(CHARS)))
    where = np.zeros(2 * len(plain) + 1)
    for k, char in enumerate(plain):
        blank[2 * k + 1] = 0.0 if rival else 1.0 - sure
        shares[2 * k + 1, CHARS.index(char)] = sure
        if rival:
            shares[2 * k + 1, CHARS.index(rival[k])] += 1.0 - sure
        where[2 * k + 1] = columns[k]
        where[2 * k] = columns[k] - 5.0
    where[-1] = columns[-1] + 5.0
    line = combine_looks(at, [Steps.of(blank, shares, CHARS, where)], grammar)
    assert line is not None
    return line


def read(
    main: ReadLine | None,
    *others: ReadLine,
    grammar: Grammar | None = None,
    source: Source = "tactile",
    flags: ReadingFlag = ReadingFlag.NONE,
) -> Reading:
    log = Log(findings=tuple(map(Finding.of, flags)))
    sense = SenseEvidence(source, lines=PartLines(main, others=others), log=log)
    return decide(Evidence.of(sense), rules(grammar))


def test_a_sure_line_is_accepted_with_all_that_is_known() -> None:
    reading = read(line_of("AB812"))
    assert (reading.text, reading.decision, reading.flags) == ("AB812", Decision.ACCEPT, ReadingFlag.NONE)
    assert reading.confidence > 0.9
    assert reading.height_mm == 5.0
    assert reading.rotation_deg == pytest.approx(2.0)
    assert reading.box == hull([c.box for c in reading.characters])
    assert reading.trace.line is LINE
    assert [*reading.trace.by_expert] == ["network"]
    assert reading.trace.open_lattice is not None
    for character in reading.characters:
        shares = [c.probability for c in character.candidates]
        assert shares == sorted(shares, reverse=True)
        assert sum(shares) <= 1.0 + 1e-9


@given(
    st.text(CHARS, min_size=4, max_size=12), st.floats(0.6, 0.99999), st.sampled_from(["tactile", "vision"])
)
@settings(max_examples=40, deadline=None)
def test_no_place_is_less_sure_than_the_whole_text(text: str, sure: float, source: Source) -> None:
    reading = read(line_of(text, sure=sure), source=source)
    for character in reading.characters:
        assert character.confidence >= reading.confidence
        shares = [c.probability for c in character.candidates]
        assert sum(shares) <= 1.0 + 1e-9
        assert min(shares) >= 0.0


def test_another_line_that_nobody_asked_for_sends_the_part_to_review() -> None:
    other = line_of("B21", at=TextLine.straight(3.0, 20.0, length_mm=12.0, height_mm=5.0))
    reading = read(line_of("AB812"), other)
    assert reading.text == "AB812"
    assert reading.decision is Decision.REVIEW
    assert ReadingFlag.UNREAD_MARKS in reading.flags
    assert any("B21" in finding.text for finding in reading.findings)


def test_another_line_that_the_serials_format_does_not_allow_is_named_and_holds_nothing_up() -> None:
    other = line_of("B21", at=TextLine.straight(3.0, 20.0, length_mm=12.0, height_mm=5.0))
    grammar = Grammar(format="AA999")
    reading = read(line_of("AB812", grammar=grammar), other, grammar=grammar)
    assert (reading.text, reading.decision, reading.flags) == ("AB812", Decision.ACCEPT, ReadingFlag.NONE)
    assert [(line.text, line.may_be_serial) for line in reading.others] == [("B21", False)]
    assert reading.messages() == ("another line reads “B21”, which does not fit the serial's format",)
    # as many characters, of other kinds
    kinds = read(line_of("AB812", grammar=grammar), line_of("12812", at=other.line), grammar=grammar)
    assert kinds.decision is Decision.ACCEPT
    # two serials on one plate
    twice = read(
        line_of("AB812", grammar=grammar), line_of("BB221", at=other.line, sure=0.9), grammar=grammar
    )
    assert twice.decision is Decision.REVIEW
    assert twice.messages() == ("another line reads “BB221”",)


def test_a_format_that_changes_what_was_read_says_so() -> None:
    grammar = Grammar(format="AA9")
    # the second is an 8 for sure, which the format does not allow there
    found = read(line_of("A81", sure=0.99, rival="BB2", grammar=grammar), grammar=grammar)
    assert found.text == "AB1"
    assert found.decision is Decision.REVIEW
    # what is read is clear: the hint is about the format, whatever the score and the strokes say
    undecided = Finding(
        ReadingFlag.STROKES_UNDECIDED, "8 or B at place 2: covered (clean it and scan it again)"
    )
    doubtful = replace(found, confidence=0.1, findings=(*found.findings, undecided))
    for reading in (found, doubtful):
        assert reading.messages() == (
            "place 2 reads as a digit (“8”), which the format does not allow (check the part and the format)",
        )
    # another number of characters
    longer = Grammar(format="AA99")
    other = read(line_of("A81", sure=0.999, grammar=longer), grammar=longer)
    assert other.decision is not Decision.ACCEPT
    assert other.messages()[0] == (
        "found 3 characters (“A81”): it does not fit the format AA99 (check the part and the format)"
    )
    # where the line is not clear, the format is named as one that has changed the text, and the doubt stays
    unsure = read(line_of("A81", sure=0.7, rival="BB2", grammar=grammar), grammar=grammar)
    assert ReadingFlag.FORMAT_NOT_MET not in unsure.flags
    # a format that is met changes nothing
    met = Grammar(format="A99")
    plain = read(line_of("A81", grammar=met), grammar=met)
    assert (plain.text, plain.decision) == ("A81", Decision.ACCEPT)


def test_a_sign_that_is_none_of_the_formats_is_not_taken_for_its_character() -> None:
    grammar = Grammar(format="AA9")
    # at the last place hardly anything is heard but that something stands there
    sure = line_of("AB2", grammar=grammar)
    steps = sure.looks[0]
    shares, blank = np.exp(steps.log_chars), np.exp(steps.log_blank)
    shares[5], blank[5] = 0.1 * shares[5], 1e-4
    line = combine_looks(LINE, [Steps.of(blank, shares, CHARS, steps.columns)], grammar)
    assert line is not None
    reading = read(line, grammar=grammar)
    assert (reading.text, reading.decision) == ("AB2", Decision.REVIEW)
    assert reading.messages() == ("2 at place 3 may be a sign outside the format (compare it with the part)",)
    assert read(sure, grammar=grammar).decision is Decision.ACCEPT


def test_a_twin_is_what_the_format_makes_of_it() -> None:
    # the place is read as the 8's twin here: B for 8 is none, and is told of
    grammar = Grammar(format="AA9")
    line = line_of("AB8", sure=0.05, rival="ABB", grammar=grammar)
    assert line.evidence < IN_FORMAT["tactile"]
    assert line.evidence_of(grammar, alike=("8B",)) > -0.1
    assert read(line, grammar=grammar).flags & ReadingFlag.FORMAT_NOT_MET


def test_a_wide_step_is_a_space_unless_the_format_says_where_they_are() -> None:
    assert read(line_of("AB 812")).text == "AB 812"
    grammar = Grammar(format="A A999")
    reading = read(line_of("AB 812", grammar=grammar), grammar=grammar)
    assert reading.text == "A B812"


def test_word_gaps_stand_out_in_themselves_and_beside_the_others() -> None:
    columns = np.array([0.0, 0.8, 1.6, 3.2, 4.0]) * HEIGHT_ROWS
    assert word_gaps(columns) == {2}
    # far apart, but alike; and a step that is hardly wider
    assert word_gaps(np.arange(5.0) * 2.0 * HEIGHT_ROWS) == frozenset()
    assert word_gaps(np.array([0.0, 0.8, 1.6, 2.7, 3.5]) * HEIGHT_ROWS) == frozenset()
    assert word_gaps(columns[:2]) == word_gaps(np.zeros(0)) == frozenset()


def test_no_line_and_a_line_that_says_nothing_are_no_characters() -> None:
    blind = line_of("A8B", sure=1e-4, grammar=Grammar(sets=(CHARS,) * 3))
    for reading in (read(None, flags=ReadingFlag.DROPOUTS), read(blind, flags=ReadingFlag.DROPOUTS)):
        assert (reading.text, reading.decision, reading.confidence) == ("", Decision.REJECT, 0.0)
        # what was known of the scan is still said
        assert reading.flags == ReadingFlag.NO_CHARACTERS | ReadingFlag.DROPOUTS


def test_nothing_that_can_be_read_where_a_line_was_asked_for_is_no_line() -> None:
    """Noise of the land, of which the format still makes its likeliest text."""
    grammar = Grammar(sets=(CHARS,) * 3)
    lot = LineFormat(grammar)
    for sure, lines in ((1e-4, []), (0.9, ["A8B"])):
        part = PartLines(line_of("AB812"), {"lot": line_of("A8B", sure=sure, grammar=grammar)})
        evidence = Evidence.of(SenseEvidence("tactile", lines=part))
        reading = decide(evidence, rules(lines={"lot": lot}))
        assert [line.text for line in reading.others] == lines
        words = () if lines else ("no text was read for the line lot",)
        assert reading.messages()[: len(words)] == words


def test_a_hull_holds_its_boxes() -> None:
    assert hull([]) is None
    assert hull([Box(0, 1, 2, 3), Box(-1, 2, 1, 5)]) == Box(-1, 1, 2, 5)


def _steps(columns: np.ndarray, **beliefs: np.ndarray) -> Steps:
    return Steps.of(np.ones(columns.size), np.zeros((columns.size, len(CHARS))), CHARS, columns, **beliefs)


def test_word_gaps_need_to_be_heard_where_somebody_listens() -> None:
    columns = np.array([0.0, 0.8, 1.6, 3.2, 4.0]) * HEIGHT_ROWS
    where = np.arange(0.0, 4.0, 0.1) * HEIGHT_ROWS
    deaf = _steps(where, gap=np.zeros(where.size))
    hears = _steps(where, gap=np.where(np.abs(where - 0.4 * HEIGHT_ROWS) < 3.0, 0.9, 0.0))
    assert word_gaps(columns, [_steps(where)]) == word_gaps(columns) == {2}
    assert word_gaps(columns, [deaf]) == frozenset()
    assert word_gaps(columns, [hears]) == {0}


def test_small_letters_that_nobody_asked_for_go_to_a_person() -> None:
    columns = np.array([0.0, 1.0, 2.0]) * HEIGHT_ROWS
    where = np.arange(0.0, 2.1, 0.1) * HEIGHT_ROWS
    seen = _steps(where, small=np.where(np.abs(where - columns[1]) < 3.0, 0.9, 0.0))
    (finding,) = small_letters([seen], columns, "ABC")
    assert finding.flag is ReadingFlag.CASE_UNKNOWN
    assert "B at place 2" in finding.text
    assert small_letters([_steps(where)], columns, "ABC") == ()


# ---------------------------------------------------------------------------------------------------------- decision

READ = PlaceState(CharacterState.READ, "A", 0.99)
UNREAD = PlaceState(CharacterState.NOT_READ, "A", 0.1)


@pytest.mark.parametrize(
    ("places", "score", "threshold", "flags", "wanted"),
    [
        ([READ], 0.99, 0.98, ReadingFlag.NONE, Decision.ACCEPT),
        ([READ], 0.98, 0.98, ReadingFlag.NONE, Decision.ACCEPT),
        ([READ], 0.97999, 0.98, ReadingFlag.NONE, Decision.REVIEW),
        ([READ], 0.1, None, ReadingFlag.NONE, Decision.ACCEPT),
        ([None], 0.99, 0.98, ReadingFlag.NONE, Decision.ACCEPT),
        ([READ, READ, UNREAD], 0.99, 0.98, ReadingFlag.NONE, Decision.ACCEPT),
        ([READ, UNREAD], 0.99, 0.98, ReadingFlag.NONE, Decision.REJECT),
        ([], 0.99, 0.98, ReadingFlag.NONE, Decision.REJECT),
        ([READ], 0.99, 0.98, ReadingFlag.JAMMED, Decision.ACCEPT),
        ([READ], 0.99, 0.98, EXPLANATIONS, Decision.ACCEPT),
    ],
)
def test_contracts_score_and_threshold_decide(
    places: list[PlaceState | None],
    score: float,
    threshold: float | None,
    flags: ReadingFlag,
    wanted: Decision,
) -> None:
    assert decision_of(places, score=score, threshold=threshold, flags=flags) is wanted


@pytest.mark.parametrize("flag", [flag for flag in ReadingFlag if flag & BROKEN])
def test_every_broken_contract_sends_a_sure_reading_to_a_person(flag: ReadingFlag) -> None:
    assert decision_of([READ], score=1.0, threshold=0.98, flags=flag) is Decision.REVIEW
    assert decision_of([UNREAD], score=1.0, threshold=0.98, flags=flag) is Decision.REJECT


def test_what_explains_a_low_score_breaks_no_contract() -> None:
    assert not BROKEN & EXPLANATIONS
