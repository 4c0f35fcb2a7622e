"""Values of a reading that are computed when they are first read."""

from __future__ import annotations

import pickle
from dataclasses import dataclass, replace

import pytest

from recognition.decide.deferred import deferrable, deferred
from recognition.decide.judges.strokes import cut_characters, missing_strokes, named_font, undecided_strokes
from tests.support.evidence import judged, text_of


@deferrable("depth")
@dataclass(frozen=True)
class Mark:
    name: str
    depth: float = 0.0


def test_a_value_is_computed_once_and_not_before_it_is_read() -> None:
    computed = []
    mark = Mark("K", deferred(lambda: computed.append(1) or 0.2))
    assert computed == []
    assert (mark.depth, mark.depth, computed) == (0.2, 0.2, [1])


def test_a_deferred_value_compares_copies_and_travels_as_the_value() -> None:
    mark = Mark("K", deferred(lambda: 0.2))
    assert pickle.loads(pickle.dumps(mark)) == mark == Mark("K", 0.2)
    assert replace(mark, name="7") == Mark("7", 0.2)
    assert Mark("K").depth == 0.0


def test_a_sure_text_is_judged_without_its_strokes() -> None:
    def unwanted(*_: object, **__: object) -> None:
        pytest.fail("the strokes were compared")

    sure = text_of("K7", score=0.99)
    sure.marks.strokes = unwanted  # type: ignore[union-attr, method-assign]
    assert judged(sure, cut_characters, missing_strokes, undecided_strokes, named_font) == ()
