"""One form of a name, and one comparison."""

from __future__ import annotations

from datetime import UTC, datetime

import pytest
from hypothesis import given
from hypothesis import strategies as st

from glyphs.plain_text import has_hidden
from pipeline.common.names import HiddenCharacterError, clean_name, folded, printable_name
from pipeline.common.people_records import Person
from pipeline.common.records import ReviewAction, ReviewRecord

SPELLINGS = (
    "Jörg Müller",
    "Jo\u0308rg Mu\u0308ller",
    "JÖRG MÜLLER",
    " Jörg  Müller ",
    "Jörg\u00a0Müller",
    "Ｊörg Müller",
)
HIDDEN = (
    "Jörg\u200b Müller",
    "Jörg Müller\u202e",
    "Jörg\u034f Müller",
    "Jörg Müller\u3164",
    "Jörg Müller\ufe0f",
    "Jörg\tMüller",
    "Jörg Müller\U000e0041",
    "Jörg Müller\x00",
)


@pytest.mark.parametrize("spelling", SPELLINGS)
def test_all_spellings_of_a_name_are_one_person(spelling: str) -> None:
    assert folded(spelling) == folded(SPELLINGS[0])
    review = ReviewRecord(ReviewAction.CONFIRM, "K1", "K1", SPELLINGS[0], at=datetime.now(UTC))
    assert Person(spelling).wrote(review)
    assert not Person("Jorg Muller").wrote(review)
    assert clean_name(spelling).casefold() == "jörg müller"


@pytest.mark.parametrize("name", HIDDEN)
def test_hidden_characters_are_refused_or_replaced(name: str) -> None:
    with pytest.raises(HiddenCharacterError):
        clean_name(name)
    with pytest.raises(HiddenCharacterError):
        Person(name)
    assert "_" in printable_name(name)
    if "\t" not in name:
        assert folded(name) == folded(SPELLINGS[0])


@given(st.text())
def test_a_name_has_one_form_whatever_it_comes_as(text: str) -> None:
    name = printable_name(text)
    assert not has_hidden(name)
    assert clean_name(name) == name
    assert folded(folded(text)) == folded(text)
