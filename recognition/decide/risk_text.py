"""A risk as people write it: 0.001, 1/1000 or 1 in 1,000."""

from __future__ import annotations

import math
import re

USUAL_RISK = 0.001
"""Greatest share of wrong readings among those accepted, if no other is set (`risk.risk_of`)."""
CANNOT_PROMISE = "cannot promise"
"""Words of the message that a sense does not keep the risk; `pipeline.runs.summary` counts these messages."""
_ODDS = re.compile(r"(\d+)\s*(?:/|in)\s*(\d[\d,]*)", re.IGNORECASE)


def parse_risk(text: str) -> float:
    """Parse a risk written as 0.001, 1/1000 or 1 in 1,000. Raises ValueError."""
    odds = _ODDS.fullmatch(text.strip())
    try:
        return check_risk(float(text) if odds is None else int(odds[1]) / int(odds[2].replace(",", "")))
    except (ValueError, ArithmeticError) as error:
        raise ValueError("write a risk between 0 and 1, such as 0.001, 1/1000 or 1 in 1000") from error


def check_risk(risk: float) -> float:
    """Return the risk. Raises ValueError if it does not lie between 0 and 1."""
    if not 0.0 < risk < 1.0:
        raise ValueError(f"accept_risk is {risk}; it lies between 0 and 1")
    return risk


def risk_in_words(risk: float, *, rounding: float = 0.01) -> str:
    """Write a risk as "1 in 1,000"; one that would need more rounding than this is written as a decimal."""
    parts = round(1.0 / risk)
    return (
        f"1 in {parts:,}" if parts > 1 and math.isclose(parts * risk, 1.0, rel_tol=rounding) else f"{risk:g}"
    )
