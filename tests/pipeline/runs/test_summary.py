"""What a run has come to, in numbers and lines."""

from __future__ import annotations

import json
import tracemalloc
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.common.reading_records import ReadingRecord
from pipeline.runs.summary import MOST_REASONS, Summary


def read(
    part: str, text: str = "", decision: str = "", confidence: float = 0.0, *messages: str, **more: Any
) -> ReadingRecord:
    return ReadingRecord("tactile", text, decision, confidence, part=part, messages=messages, **more)


RECORDS = (
    read("a", "A1", "accept", 0.99, seconds=0.5),
    read("b", "B2", "review", 0.50, "weak character 3", "marks are dirty", seconds=4.0),
    read("c", "C3", "review", 0.60, "weak character 5", seconds=1.5),
    read("d", "", "reject", seconds=0.1),
    read("e", error="/x/e.npz: is empty; copy or record it again", seconds=0.01),
)


def counted(*records: ReadingRecord) -> Summary:
    summary = Summary()
    for record in records:
        summary.add(record)
    return summary


def test_decisions_reasons_rate_and_slowest_are_told() -> None:
    lines = counted(*RECORDS).lines(elapsed_s=2.0, read_now=4, workers=2)
    assert lines[0] == "5 parts, 1 accept, 2 review, 1 reject, 1 with an error"
    told = "\n".join(lines)
    # what differs from part to part is one reason
    assert "     2  weak character #" in told
    assert "     1  marks are dirty" in told
    assert "     1  not sure enough" in told
    assert "     1  is empty; copy or record it again" in told
    assert "4 read in 2.0 s with 2 workers: 2.00 a second, 1.22 s of work each" in told
    assert lines[-1].startswith("slowest: b 4.00 s, c 1.50 s, a 0.50 s")


def test_a_message_with_a_semicolon_in_brackets_is_one() -> None:
    messages = ("place 1: I or J (one upright; serifs are missing in some fonts)", "marks are dirty")
    reasons = counted(read("a", "I1", "review", 0.5, *messages)).reasons
    assert counted(read("a", "I1", "review", 0.5, "low confidence: 1 or I at place 1?")).reasons == {
        "low confidence": 1
    }
    assert dict(reasons) == {
        "place #: I or J (one upright; serifs are missing in some fonts)": 1,
        "marks are dirty": 1,
    }


@pytest.mark.parametrize(
    ("message", "kind"),
    [
        ("low confidence: lot LOT77?", "low confidence"),
        ("most strokes are missing: I at place 1 (clean it and scan it again)", "most strokes are missing"),
        ("too shallow for R: 7 at place 2 0.061 mm (at least 0.0762)", "too shallow for R"),
        ("no character can be made out: places 3 and 4 (clean it)", "no character can be made out"),
        ("0 or O at place 4: the strokes fit both", "0 or O at place #: the strokes fit both"),
        (
            "confidence 0.965 is below the threshold 0.98: 1 or I at place 3?",
            "confidence # is below the threshold #",
        ),
        (
            "confidence 0.5 is below the threshold 0.98: K at place 1 is the least sure",
            "confidence # is below the threshold #",
        ),
        ("it does not fit the format AA9999", "it does not fit the format AA9999"),
        ("place 5: touch has 3, the camera 8", "place #: touch has #, the camera #"),
    ],
)
def test_places_and_characters_make_no_reason_of_their_own(message: str, kind: str) -> None:
    assert counted(read("a", "I1", "review", 0.5, message)).reasons == {kind: 1}


def test_nothing_read_now_has_no_rate() -> None:
    assert not any(
        "a second" in line for line in counted(*RECORDS).lines(elapsed_s=0.0, read_now=0, workers=1)
    )


def test_the_same_in_json() -> None:
    told = json.loads(json.dumps(counted(*RECORDS).as_json()))
    assert (told["parts"], told["accept"], told["review"], told["reject"], told["errors"]) == (5, 1, 2, 1, 1)
    assert told["reasons"]["weak character #"] == 2
    assert told["slowest"][0] == {"part": "b", "seconds": 4.0}


def test_verdicts_are_counted() -> None:
    rows = [
        read(str(k), "A1", "accept", verdict=v) for k, v in enumerate(("confirmed", "refuted", "confirmed"))
    ]
    assert counted(*rows).counts() == "3 parts, 3 accept, 2 confirmed, 1 refuted"


@given(st.lists(st.floats(0.0, 1e3, allow_nan=False), max_size=30))
def test_the_slowest_are_the_slowest(seconds: list[float]) -> None:
    rows = [read(f"p{k}", "A", "accept", seconds=s) for k, s in enumerate(seconds)]
    assert [s for _, s in counted(*rows).slowest] == sorted(seconds, reverse=True)[:5]


def test_memory_does_not_grow_with_the_rows() -> None:
    """Whatever errors say, word for word different: 20,000 rows take no more than 2,000 did."""
    summary = Summary()

    def add(count: int, start: int) -> int:
        tracemalloc.start()
        for k in range(start, start + count):
            word = "".join(chr(97 + (k >> shift) % 16) for shift in (0, 4, 8, 12))
            summary.add(read(f"p{k}", error=f"{word}.npz: {word} is odd"))
        grown, _ = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        return grown

    add(2_000, 0)
    # a list of words, were they kept, would take 2 MB
    assert add(20_000, 2_000) < 100_000
    assert summary.errors == sum(summary.faults.values()) == 22_000
    assert len(summary.lines(elapsed_s=1.0, read_now=1, workers=1)) <= MOST_REASONS + 8


def test_texts_of_other_lines_are_one_reason() -> None:
    rows = [read(str(k), "A", "review", 0.5, f"another line reads “LOT{k}”") for k in range(3)]
    assert list(counted(*rows).reasons.values()) == [3]
