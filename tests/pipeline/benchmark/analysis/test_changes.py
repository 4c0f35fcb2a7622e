"""What a change did: flips by hand, refusals, parts made again, and the command."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from pipeline.benchmark.analysis.changes import Flip, NotComparableError, changes, flip_of
from pipeline.benchmark.exam.condition import given_levels
from pipeline.benchmark.exam.specimens import Item
from pipeline.benchmark.report import change_report
from pipeline.benchmark.report.worst_parts import WorstPart
from pipeline.benchmark.trials.journal import Trial, TrialJournal
from pipeline.benchmark.trials.run import Benchmark, remake
from pipeline.cli.main import main
from recognition.settings import ReaderSettings
from tests.factories import designed_parts
from tests.support.run_tables import csv_rows

pytestmark = pytest.mark.usefixtures("inline")
PARTS = designed_parts(parts=3, severities=(0.3, 0.6), given=("format", "font,format"))
BENCHMARK = Benchmark(PARTS, ("tactile",), ReaderSettings())


def trials(texts: str, *, decision: str = "review") -> list[Trial]:
    """Of every part and given; the n-th reads the n-th letter, which should be A."""
    blanks = [
        Trial(item.part, item.number, {**item.condition.levels, **given_levels(facts)}, "tactile", "A")
        for item in PARTS.items()
        for facts in item.given
    ]
    return [replace(b, text=t, decision=decision) for b, t in zip(blanks, texts, strict=True)]


def kept(folder: Path, members: list[Trial]) -> Path:
    with TrialJournal(folder, BENCHMARK.description()) as book:
        for part in dict.fromkeys(t.part for t in members):
            book.keep(part, tuple(t for t in members if t.part == part))
    return folder


def not_drawn(_: Benchmark, ranked: tuple[WorstPart, Item]) -> WorstPart:
    assert ranked[0].part == ranked[1].part
    return replace(ranked[0], picture="data:image/jpeg;base64,AAAA")


@pytest.mark.parametrize(
    ("before", "after", "flip"),
    [
        ("A accept", "A accept", None), ("B review", "C review", None), ("B accept", "C accept", None),
        ("A review", "B accept", Flip.ACCEPTED_WRONG), ("B review", "B accept", Flip.ACCEPTED_WRONG),
        ("A accept", "B review", Flip.LOST), ("A accept", "A review", Flip.NOT_ACCEPTED),
        ("B accept", "A accept", Flip.GAINED), ("A review", "A accept", Flip.ACCEPTED),
        ("B accept", "B review", Flip.WITHDRAWN),
    ],
)  # fmt: skip
def test_how_a_reading_changed(before: str, after: str, flip: Flip | None) -> None:
    was, now = (replace(trials("A" * 12)[0], text=t, decision=d) for t, d in (before.split(), after.split()))
    assert flip_of(was, now) is flip


def test_readings_are_paired_by_part_and_what_was_given() -> None:
    """All with the font are gained at dirt 0.3 alone; the readings without it stay as they were."""
    order = [(t.severity, t.given) for t in trials("A" * 12)]
    after = "".join("A" if level == (0.3, "font,format") else "B" for level in order)
    compared = changes(trials("B" * 12), trials(after))
    assert compared.parts == 6
    assert [(row.compared.first.reader, row.compared.parts) for row in compared.overall] == [
        ("tactile, given format", 6), ("tactile, given font, format", 6),
    ]  # fmt: skip
    assert [row.compared.serials.only_first for row in compared.overall] == [0, 3]
    by_level = {
        (r.compared.first.reader, r.level): r.compared for r in compared.by_factor if r.factor == "severity"
    }
    assert by_level["tactile, given font, format", 0.3].characters.difference.value == 1.0
    assert by_level["tactile, given font, format", 0.6].characters.difference.value == 0.0
    assert compared.counts["tactile, given font, format"] == {Flip.GAINED: 3}


def test_other_parts_are_refused() -> None:
    whole = trials("A" * 12)
    with pytest.raises(NotComparableError, match="1 parts are only in the first run"):
        changes(whole, [t for t in whole if t.part != whole[0].part])
    with pytest.raises(NotComparableError, match="have the same name but differ"):
        changes(whole, [replace(t, truth="B") for t in whole])
    with pytest.raises(NotComparableError, match="no reader is in both"):
        changes(whole, [replace(t, mode="vision") for t in whole])
    other = replace(PARTS, design=PARTS.design.model_copy(update={"seed": 2}))
    with pytest.raises(NotComparableError, match="seed was 1, now 2"):
        changes(whole, whole, ({"parts": PARTS.description()}, {"parts": other.description()}))


def test_parts_are_made_again_from_what_the_book_says() -> None:
    description = json.loads(json.dumps(BENCHMARK.description()))
    wanted = [item.part for item in PARTS.items()]
    benchmark, items = remake(description, wanted[-1:])
    assert list(items) == wanted[-1:]
    again, first = items[wanted[-1]], PARTS.items()[-1]
    assert (again.number, again.condition, again.given) == (first.number, first.condition, first.given)
    assert benchmark.parts.make(again).truth == PARTS.make(first).truth
    assert benchmark.settings_for(again.condition, again.given[1]) == BENCHMARK.settings_for(
        first.condition, first.given[1]
    )


def test_the_command_shows_what_flipped(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(change_report, "draw_worst", not_drawn)
    monkeypatch.setattr(change_report, "SHOWN", 2)
    before = kept(tmp_path / "a", trials("AAAAABBBBBBB", decision="review"))
    after = kept(
        tmp_path / "b",
        [*trials("AABBABBBBAAA", decision="review")[:-1], *trials("B" * 12, decision="accept")[-1:]],
    )
    assert main(["benchmark", "compare", str(before), str(after)]) == 0
    printed = capsys.readouterr().out
    assert all(len(line) <= 80 for line in printed.splitlines() if not line.startswith("wrote"))
    rows = csv_rows(after / "compare.csv")
    assert [r["flip"] for r in rows] == [
        Flip.ACCEPTED_WRONG.value, Flip.LOST.value, Flip.LOST.value, Flip.GAINED.value, Flip.GAINED.value,
    ]  # fmt: skip
    assert (rows[0]["text_a"], rows[0]["text_b"], rows[0]["decision_b"]) == ("B", "B", "accept")
    page = (after / "compare.html").read_text(encoding="utf-8")
    assert page.count("data:image/jpeg") == 2
    assert "3 more in compare.csv" in page
    assert "http" not in page


def test_a_folder_without_a_benchmark_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["benchmark", "compare", str(tmp_path), str(tmp_path)]) == 1
    assert "trials.db" in capsys.readouterr().err
