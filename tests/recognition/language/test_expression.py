"""Expressions as machines, against Python's own matcher."""

from __future__ import annotations

import itertools
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glyphs.fonts.serials import FormatError
from recognition.language.automaton import unroll
from recognition.language.expression import expression_machine, written_characters

CHARS = tuple("AB1-")


def quantified(part: str) -> st.SearchStrategy[str]:
    return st.sampled_from(["", "?", "*", "+", "{2}", "{1,3}", "{,2}", "{2,}", "+?"]).map(lambda q: part + q)


ATOMS = [
    r"A",
    r"B",
    r"1",
    r"\-",
    r".",
    r"\d",
    r"\w",
    r"\D",
    r"[AB]",
    r"[^A]",
    r"[A-B1]",
    r"[]A]",
    r"[^-A]",
    r"[\d\-]",
    r"[\D1]",
    r"[^\w]",
    r"[\w-]",
]
atoms = st.sampled_from(ATOMS)
patterns = st.recursive(
    atoms.flatmap(quantified),
    lambda inner: st.one_of(
        st.lists(inner, min_size=1, max_size=3).map("".join),
        st.lists(inner, min_size=1, max_size=3).map(lambda p: f"(?:{'|'.join(p)})"),
        inner.map(lambda p: f"({p})").flatmap(quantified),
    ),
    max_leaves=6,
)


def soon_matched(pattern: str) -> bool:
    """Whether Python's matcher, which tries and goes back, is done soon: repeats within repeats multiply."""
    endless = len(re.findall(r"[*+]|,\}", pattern))
    repeats = endless + len(re.findall(r"\?|\{", pattern))
    return endless <= 2 and repeats <= 5 and pattern.count("(") <= 4


@settings(max_examples=40, deadline=None)
@given(patterns.filter(soon_matched))
def test_matches_what_python_matches(pattern: str) -> None:
    machine = expression_machine(pattern, CHARS)
    lengths = machine.lengths()
    for n in range(1, 5):
        automaton = unroll([machine.machine], n, CHARS)
        words = list(itertools.product(range(len(CHARS)), repeat=n))
        accepted = np.zeros(len(words), bool) if automaton is None else automaton.accepts(np.array(words))
        expected = [
            re.fullmatch(pattern, "".join(CHARS[k] for k in word), re.ASCII) is not None for word in words
        ]
        assert accepted.tolist() == expected
        assert any(expected) <= (n in lengths)


def test_anchors_at_the_ends_change_nothing() -> None:
    for pattern in ("^A1$", "A1", "^A1", "A1$", "^A1|B-$"):
        assert expression_machine(pattern, CHARS).lengths() == {2}
    assert expression_machine(r"A\$", (*CHARS, "$")).lengths() == {2}


@pytest.mark.parametrize(
    ("pattern", "said"),
    [
        ("A(", "is not a regular expression"),
        ("(?!A)B", "look-ahead"),
        ("(?i)a", "option"),
        (r"(A)\1", "reference"),
        (r"\bA", "says more than which"),
        ("A^B", "at the ends"),
        ("(A$|B)", "at the ends"),
        ("", "1 to 500"),
        (".*A.{14}", "too complex"),
        ("((A{60}){60}){60}", "repeats too much"),
        ("((.?){64}){64}", "too complex"),
        ("A(){4000000000}^", "at the ends"),
    ],
)
def test_what_cannot_be_used_is_said(pattern: str, said: str) -> None:
    with pytest.raises(FormatError, match=re.escape(said)):
        expression_machine(pattern, CHARS)


def test_literal_characters_are_those_written() -> None:
    assert written_characters(r"[A-C]x\d-.[^Q]\w") == set("ABCx-0123456789")


def test_rules_that_need_too_many_states_together_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("recognition.language.automaton.MOST_STATES", 3)
    with pytest.raises(FormatError, match="leave one out"):
        unroll([expression_machine("(A.|B..|1...|-)+", CHARS).machine], 4, CHARS)
