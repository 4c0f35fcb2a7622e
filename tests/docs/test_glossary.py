"""The glossary explains every word that a reading can show."""

from __future__ import annotations

from pathlib import Path

from pipeline.runs.summary import GLOSSARY
from recognition.decide.decision import Decision, ReadingFlag
from recognition.decide.verify import Verdict
from recognition.language.confusions import CharacterState
from recognition.marks.grade import LIMITS, Action

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / GLOSSARY).read_text(encoding="utf-8")


def test_every_reason_is_explained_with_its_code() -> None:
    for flag in ReadingFlag:
        assert f"| {flag.text.partition(' (')[0]} | `{(flag.name or '').lower()}` |" in PAGE


def test_every_word_of_a_row_is_explained() -> None:
    words = (*Decision, *Verdict, *(set(CharacterState) - {CharacterState.READ}))
    for word in (*words, *(action.value for action in Action if action is not Action.NONE)):
        assert str(word) in PAGE


def test_the_limits_of_the_grades_are_those_of_the_program() -> None:
    for measure, limits in LIMITS.items():
        (line,) = [line for line in PAGE.splitlines() if line.startswith(f"| {measure} ")]
        assert [float(cell) for cell in line.split("|")[3:-1]] == list(limits)
