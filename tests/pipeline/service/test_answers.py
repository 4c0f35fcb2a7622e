"""Fields of the interface."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from glyphs.plain_text import is_hidden
from pipeline.reading.triage import ReadPart
from pipeline.service.api import HIDDEN
from pipeline.service.web.problem import Problem
from tests.support.service_fixtures import inline_service, triggered
from tests.support.store_samples import reading


@given(st.characters(max_codepoint=0xFFFF))
def test_the_pattern_holds_hidden_characters_alone(char: str) -> None:
    if re.fullmatch(f"[{HIDDEN}]", char):
        assert is_hidden(char)


def test_a_name_has_one_form_and_hidden_characters_are_refused(tmp_path: Path) -> None:
    part = ReadPart((reading("KX40", "tactile"),))
    with inline_service(tmp_path, instead=lambda *_: part) as served:

        def sent(**fields: str) -> Any:
            return served[1].post("/v1/parts", files={"scan": ("a.npz", b"x")}, data=fields)

        assert sent(name=" Gehause\u0308  7").json()["name"] == "Gehausë 7"
        assert served[1].get("/v1/parts", params={"name": "GEHAUSË"}).json()[0]["name"] == "Gehausë 7"
        for fields in ({"name": "a\u202eb"}, {"name": "a\U000e0041"}, {"expected": "K1\u3164"}):
            answer = sent(**fields)
            assert (answer.status_code, answer.headers["content-type"]) == (422, "application/problem+json")
        with pytest.raises(Problem) as caught:
            triggered(served, "a\u200bb")
        assert caught.value.status == 422
