"""What a run has come to, in numbers and lines, and its progress."""

from __future__ import annotations

import io
import json
import sys
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.common.reading_records import ReadingRecord, ReasonRecord
from pipeline.runs.progress import Progress
from pipeline.runs.summary import MOST_REASONS, Summary


def read(
    part: str, text: str = "", decision: str = "", confidence: float = 0.0, *codes: str, **more: Any
) -> ReadingRecord:
    reasons = tuple(ReasonRecord(code, (len(text),)) for code in codes)
    return ReadingRecord("tactile", text, decision, confidence, part=part, reasons=reasons, **more)


RECORDS = (
    read("a", "A1", "accept", 0.99, seconds=0.5),
    read("b", "B2", "review", 0.50, "low_confidence", "not_in_order", "low_confidence", seconds=4.0),
    read("c", "C3", "review", 0.60, "low_confidence", seconds=1.5),
    read("d", "", "reject", seconds=0.1),
    read("f", "", "reject", 0.0, "no_characters", seconds=0.1),
    read("e", error="/x/e.npz: is empty; copy or save it again", seconds=0.01),
)


def counted(*records: ReadingRecord) -> Summary:
    summary = Summary()
    for record in records:
        summary.add(record)
    return summary


def test_decisions_reasons_rate_and_slowest_are_told() -> None:
    lines = counted(*RECORDS).lines(elapsed_s=2.0, read_now=4, workers=2)
    assert lines[0] == "6 parts, 1 accept, 2 review, 2 reject, 1 with an error"
    told = "\n".join(lines)
    assert "     2  low confidence" in told
    assert "     1  not in order" in told
    assert "     1  not sure enough" in told
    assert "     1  no serial found (the rows say why)" in told
    assert "     1  is empty; copy or save it again" in told
    assert "4 read in 2.0 s with 2 workers: 2.00 a second, 1.03 s of work each" in told
    assert lines[-1].startswith("slowest: b 4.00 s, c 1.50 s, a 0.50 s")


def test_a_larger_risk_is_named_only_where_it_accepts_more() -> None:
    told = counted(*RECORDS).lines(elapsed_s=2.0, read_now=4, workers=2)
    assert "1 of these lack nothing but a higher score: a larger --accept-risk accepts more" in told
    hopeless = counted(read("c", "C3", "review", 0.01, "low_confidence"))
    assert not any("accept-risk" in line for line in hopeless.lines(elapsed_s=2.0, read_now=1, workers=1))


@pytest.mark.parametrize(
    ("error", "kind"),
    [
        ("has 2,000 x 30.5 samples", "has # x # samples"),
        ("has no column 'x' (it has “X”)", "has no column '...' (it has '...')"),
        ("is no .x3p, 12, at 3.5 mm", "is no .x3p, #, at # mm"),
        (f"is odd: {'a word ' * 40}", f"is odd: {'a word ' * 21}a …"),
    ],
)
def test_numbers_and_names_make_no_error_of_their_own(error: str, kind: str) -> None:
    assert counted(read("a", error=f"/x/a.npz: {error}")).faults == {kind: 1}


def test_a_format_that_fits_no_part_is_named_once() -> None:
    digit = (
        "place 2 reads as a letter (“{}”), which the format does not allow (check the part and the format)"
    )
    longer = "found 8 characters (“KX123456”), but the format has 7 (check the part and the format)"

    def hints(*messages: str) -> list[str]:
        records = [
            read(f"p{k}", "K5", "review", 0.5, "format_not_met", messages=(message,) if message else ())
            for k, message in enumerate(messages)
        ]
        lines = counted(*records).lines(elapsed_s=1.0, read_now=len(records), workers=1)
        return [line for line in lines if "--format" in line]

    assert hints(*map(digit.format, "XFS")) == ["place 2 reads as a letter on every part: check --format"]
    assert hints(digit.format("X"), digit.format("F"), "") == [
        "place 2 reads as a letter on 2 of 3 parts: check --format"
    ]
    assert hints(longer, longer) == ["found 8 characters, but the format has 7 on every part: check --format"]
    # of a single part, or of few, the part may be the cause
    assert hints(digit.format("X")) == []
    assert hints(digit.format("X"), *[""] * 5) == []


def test_the_same_in_json() -> None:
    told = json.loads(json.dumps(counted(*RECORDS).as_json()))
    assert (told["parts"], told["accept"], told["review"], told["reject"], told["errors"]) == (6, 1, 2, 2, 1)
    assert told["reasons"]["low confidence"] == 2
    assert told["slowest"][0] == {"part": "b", "seconds": 4.0}


@given(st.lists(st.floats(0.0, 1e3, allow_nan=False), max_size=30))
def test_the_slowest_are_the_slowest(seconds: list[float]) -> None:
    rows = [read(f"p{k}", "A", "accept", seconds=s) for k, s in enumerate(seconds)]
    assert [s for s, _ in counted(*rows).slowest] == sorted(seconds, reverse=True)[:5]


def test_memory_does_not_grow_with_the_rows() -> None:
    """Whatever errors say, word for word different."""
    words = ("".join(chr(97 + (k >> shift) % 16) for shift in (0, 4, 8, 12)) for k in range(2_000))
    summary = counted(*(read("p", error=f"{word}.npz: {word} is odd") for word in words))
    assert len(summary.faults) < 600
    assert summary.errors == sum(summary.faults.values()) == 2_000
    assert len(summary.lines(elapsed_s=1.0, read_now=1, workers=1)) <= MOST_REASONS + 8


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_a_log_has_a_line_a_minute(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now = 0.0
    monkeypatch.setattr("time.monotonic", lambda: now)
    with Progress() as progress:
        progress.start(2000, 1000)
        for k in range(200):
            now += 0.5
            progress.advance(failed=k < 3)
        progress.step("for a terminal only")
    shown = capsys.readouterr()
    assert shown.out == ""
    assert shown.err.splitlines() == [
        "1,120 of 2,000 parts, 2.00 a second, 3 with an error, about 7 min left"
    ]


@pytest.mark.parametrize("total", [1, 3])
def test_a_terminal_shows_the_step_of_a_single_part_too(total: int, monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setenv("TERM", "xterm")
    with Progress() as progress:
        progress.start(total)
        progress.step("drawing the [report]")
        progress._bar.refresh()
        progress.advance()
    assert "drawing the [report]" in terminal.getvalue()
    assert ("0/3" in terminal.getvalue()) == (total == 3)
