"""Limits with which a search or a rule would do harm are refused."""

from __future__ import annotations

import pytest

from recognition.search.correlation_search import CorrelationLimits
from recognition.search.line_search import SearchLimits


@pytest.mark.parametrize(
    ("limits", "wrong", "why"),
    [
        (SearchLimits, {"most_lines": 0}, "greater than 0"),
        (SearchLimits, {"most_moved": 0}, "greater than 0"),
        (SearchLimits, {"sure": 0.95}, "ascend"),
        (CorrelationLimits, {"size_step": 1.0}, "greater than 1"),
        (CorrelationLimits, {"smallest": 0.0}, "greater than 0"),
    ],
)
def test_limits_that_do_harm_are_refused(limits: type, wrong: dict, why: str) -> None:
    with pytest.raises(ValueError, match=why):
        limits(**wrong)
