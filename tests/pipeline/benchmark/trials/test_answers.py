"""Anybody's answers as trials: what counts, what is named, what is refused."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest

from glyphs.errors import FileError
from pipeline.benchmark.exam.condition import Condition
from pipeline.benchmark.exam.listed_parts import ListedParts
from pipeline.benchmark.exam.specimens import Item
from pipeline.benchmark.trials.answers import designed_items, load_answers
from pipeline.cli.exam import score
from pipeline.cli.exit_status import USAGE, CommandError
from pipeline.common.settings import SettingsError
from tests.factories import designed_parts

ITEMS = tuple(
    Item(f"rust-{k}", k, Condition(soil="rust", severity=0.3), truth=text)
    for k, text in enumerate(("AB12", "CD34", "EF56"))
)


def _table(folder: Path, *lines: str, name: str = "mine.csv") -> Path:
    (folder / name).write_text("\n".join(lines) + "\n")
    return folder / name


def test_answers_become_trials(tmp_path: Path) -> None:
    table = _table(
        tmp_path, "file,serial,confidence,Decision", "lines/rust-0-photo.png,AB 12,0.95,", "rust-2,EF5,0.99,reject",
        "photos/other.png,X1,,",
    )  # fmt: skip
    answers = load_answers(table, ITEMS, reader="mine", given="format")
    first, second, third = answers.trials
    assert (first.text, first.right, first.decision, first.confidence) == ("AB12", True, "accept", 0.95)
    assert [c.char for c in first.characters] == list("AB12")
    assert first.levels == {
        "soil": "rust", "severity": 0.3, "font_given": False, "height_given": False, "format_given": True,
    }  # fmt: skip
    assert (second.text, second.decision, second.right) == ("", "reject", False)
    assert (third.text, third.decision) == ("EF5", "reject")
    assert {t.mode for t in answers.trials} == {"mine"}
    assert (answers.missing, answers.unknown) == (("rust-1",), ("other",))


@pytest.mark.parametrize(
    ("heading", "cell", "decision"),
    [
        ("accepted", "yes", "accept"),
        ("accepted", "0", "review"),
        ("decision", "Review", "review"),
        ("confidence", "0.9", "accept"),
        ("confidence", "0.5", "review"),
        ("confidence", "", "review"),
    ],
)
def test_who_decides(tmp_path: Path, heading: str, cell: str, decision: str) -> None:
    table = _table(tmp_path, f"part,text,{heading}", f"rust-0,AB12,{cell}")
    assert load_answers(table, ITEMS, reader="r", given="format").trials[0].decision == decision


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        (("part,text,confidence", "rust-0,AB12,high"), "line 2: the confidence is 'high'"),
        (("part,text,confidence", "rust-0,AB12,1.2"), "line 2: the confidence is '1.2'"),
        (("part,text,confidence", "rust-0,AB12,nan"), "line 2: the confidence is 'nan'"),
        (("part,text,decision", "rust-0,A,1", ""), "line 2: the decision is '1'"),
        (("part,text,accepted", "rust-1,A,0", "rust-0,A,maybe"), "line 3: accepted is 'maybe'"),
        (("part,text", "rust-0,A", "rust-0-edges,B"), "lines 2 and 3 answer rust-0"),
        (("part,text", "rust-0,A", "rust-0,B"), "line 3 names rust-0 a second time"),
        (("part,text", "weld-0,A"), "answers no part of the exam"),
        (("part,words", "rust-0,A"), "has the columns part, words"),
    ],
)
def test_what_cannot_be_is_named_with_its_line(tmp_path: Path, lines: tuple[str, ...], says: str) -> None:
    with pytest.raises(FileError) as caught:
        load_answers(_table(tmp_path, *lines), ITEMS, reader="r", given="format")
    assert says in str(caught.value)
    assert "mine.csv" in str(caught.value)


def test_a_table_of_truth_has_factors(tmp_path: Path) -> None:
    table = _table(
        tmp_path, "part,text,severity,raised,soil,die", "a,AB 12,0.6,True,mud,", "b,CD34,0.6,False,9,v-groove"
    )
    first, second = ListedParts.of_table(table).items()
    assert (first.truth, first.number, second.number) == ("AB12", 0, 1)
    assert first.condition.levels == {"severity": 0.6, "raised": True, "soil": "mud"}
    assert second.condition.levels == {"severity": 0.6, "raised": False, "soil": 9.0, "die": "v-groove"}
    with pytest.raises(FileError, match=r"line 2: the severity is 'deep'"):
        ListedParts.of_table(_table(tmp_path, "part,text,severity", "a,AB,deep"))
    with pytest.raises(FileError, match="holds answers and not the truth; give the truth with --truth"):
        ListedParts.of_table(_table(tmp_path, "part,text,confidence", "a,AB,0.9"))


def test_readers_are_scored_and_compared(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    truth = _table(tmp_path, "part,text", *(f"p{k},AB{k:02d}" for k in range(8)), name="truth.csv")
    all_right = _table(
        tmp_path, "part,text,accepted", *(f"p{k},AB{k:02d},yes" for k in range(8)), name="a.csv"
    )
    half = _table(
        tmp_path, "part,text,accepted", *(f"p{k},AB0{k // 2},yes" for k in range(7)), "z,A,no", name="b.csv"
    )
    score([half, all_right], truth=truth, out=tmp_path / "B", give="format")
    printed = capsys.readouterr()
    document = (tmp_path / "B" / "benchmark.md").read_text()
    # of 32 characters: one wrong in each of p1 to p6, all four of p7
    assert re.search(
        r"\| b \| 8 \| 31\.2 \| 31\.2 \| 68\.8 \([^|]* \| 12\.5 \(2\.2 to 47\.1\) \| 87\.5 \| 6 of 7 ",
        document,
    )
    assert re.search(r"\| b \| a \| −31\.2 \([^|]* \| 0 \| 7 \| 0\.016 \|", document)
    assert " b " in printed.out
    assert "b: 1 without an answer, counted as read empty: p7" in printed.err
    assert "b: 1 not in the exam, not counted: z" in printed.err
    written = json.loads((tmp_path / "B" / "benchmark.json").read_text())
    assert (written["parts"], written["benchmark"]["modes"]) == (8, ["b", "a"])
    assert len((tmp_path / "B" / "benchmark.csv").read_text().splitlines()) == 1 + 2 * 8
    assert "Benchmark" in (tmp_path / "B" / "report.html").read_text()


def test_a_design_is_scored_without_making_it() -> None:
    parts = designed_parts(formats=("AA99", "9A"), parts=3)
    items = designed_items(replace(parts, first=5))
    assert [item.part for item in items] == [item.part for item in parts.items()[:5]]
    assert [len(item.truth) for item in items] == [4, 2, 4, 2, 4]
    with pytest.raises(SettingsError, match="parts is 7"):
        replace(parts, first=7)


def test_flags_that_do_not_go_together(tmp_path: Path) -> None:
    table = _table(tmp_path, "part,text", "a,A")
    for more in (
        {},
        {"design": "x", "truth": table},
        {"truth": table, "parts": 3},
        {"truth": table, "name": "a,b"},
    ):
        with pytest.raises(CommandError) as caught:
            score([table], **more)  # type: ignore[arg-type]
        assert caught.value.status == USAGE
