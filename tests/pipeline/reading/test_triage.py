"""How far a reading takes a part, and what comes of it beside the line's own reader."""

from __future__ import annotations

import pytest

from pipeline.common.reading_records import ReadingRecord
from pipeline.common.records import Agreement, PartState
from pipeline.reading.triage import agreement_of, state_after


def reading(text: str = "KX407251", decision: str = "accept", source: str = "vision") -> ReadingRecord:
    return ReadingRecord(source, text, decision, 0.9)


@pytest.mark.parametrize(
    ("made", "expected", "agreement", "state"),
    [
        (reading(), "KX407251", Agreement.SAME, PartState.ACCEPTED),
        (reading("KX40 7251"), " KX4 07251 ", Agreement.SAME, PartState.ACCEPTED),  # blanks are not stamped
        (reading(), "KX407257", Agreement.OTHER, PartState.ACCEPTED),
        (reading(), "NO READ", Agreement.OTHER, PartState.ACCEPTED),
        (reading(decision="review"), "KX407251", Agreement.SAME, PartState.TOUCH_NEEDED),
        (reading(decision="review", source="fused"), "KX407251", Agreement.SAME, PartState.REVIEW),
        (reading("", "reject"), "KX407251", Agreement.NOTHING, PartState.TOUCH_NEEDED),
        (reading(), "", Agreement.ALONE, PartState.ACCEPTED),
        (reading("", "reject"), " ", Agreement.ALONE, PartState.TOUCH_NEEDED),
    ],
)
def test_beside_the_lines_own_reader(
    made: ReadingRecord, expected: str, agreement: Agreement, state: PartState
) -> None:
    assert (agreement_of(made, expected), state_after(made)) == (agreement, state)
