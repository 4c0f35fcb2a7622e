"""Fields of the interface."""

from __future__ import annotations

import re

from hypothesis import given
from hypothesis import strategies as st

from glyphs.plain_text import is_hidden
from pipeline.service.api import HIDDEN


@given(st.characters(max_codepoint=0xFFFF))
def test_the_pattern_holds_hidden_characters_alone(char: str) -> None:
    if re.fullmatch(f"[{HIDDEN}]", char):
        assert is_hidden(char)
