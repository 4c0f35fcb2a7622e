"""The accepted risk: the greatest share of wrong readings among those accepted.

none is set --1 in 1,000, or the least that the sense keeps--> risk
risk --thresholds tested for the sense--> the least score that keeps it: accepted from there
                                     \\--> none: a contract is broken, and nothing is accepted
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

from glyphs.errors import MarksError
from recognition.decide.decision import Finding, ReadingFlag
from recognition.decide.risk_text import CANNOT_PROMISE, USUAL_RISK, risk_in_words
from recognition.decide.score import SENSE_NAMES, SOURCES, score_of

ALONE_RISK = 0.005
"""Risk up to which both senses together accept what one of them accepts alone. A larger risk would not be kept: parts
on which the senses disagree, most of them right, go to review (`python tests/benchmarks/fit_score.py`)."""
_INSTEAD = {
    "tactile": "photograph the part as well",
    "vision": "touch the part",
    "fused": "read it by touch alone",
}


def risk_of(source: str, accept_risk: float | None) -> float:
    """Accepted risk of a source of readings: the one that is set, or else `USUAL_RISK`, or the least that it keeps."""
    if accept_risk is not None:
        return accept_risk
    least = score_of(source).least_risk
    return max(USUAL_RISK, least) if least < 1.0 else USUAL_RISK


@cache
def threshold_of(source: str, risk: float) -> float | None:
    """Least score at which a source of readings keeps a risk; None if none was shown to."""
    return score_of(source).threshold(risk)


def least_score(source: str, risk: float) -> float:
    """Least score from which a text counts as sure: the tested threshold, or 1 - risk if there is none."""
    threshold = threshold_of(source, risk)
    return 1.0 - risk if threshold is None else threshold


def threshold_beside(source: str, risk: float) -> float | None:
    """Least score from which one sense accepts although both have read; None where both must be sure together."""
    return threshold_of(source, risk) if risk <= ALONE_RISK else None


def risk_findings(source: str, risk: float) -> tuple[Finding, ...]:
    """Report that a source of readings cannot keep a risk; empty if it can."""
    if threshold_of(source, risk) is not None:
        return ()
    others = [other for other in ("tactile", "fused") if other != source]
    helps = any(threshold_of(other, risk) is not None for other in others)
    steps = (_INSTEAD[source],) * helps + _larger_risk((source,))
    text = f"{SENSE_NAMES[source]} {CANNOT_PROMISE} {risk_in_words(risk)}"
    return (Finding(ReadingFlag.RISK_NOT_KEPT, f"{text} ({', or '.join(steps)})" if steps else text),)


def require_kept(risk: float, sources: Sequence[str] = SOURCES) -> None:
    """Check that one of these sources keeps the risk. Raises MarksError: nothing would be accepted."""
    if all(threshold_of(source, risk) is None for source in sources):
        subject = f"{SENSE_NAMES[sources[0]]} cannot" if len(sources) == 1 else "no sense can"
        steps = (*_larger_risk(sources), "certify your own parts for less")
        raise MarksError(f"{subject} promise {risk_in_words(risk)}", hint=", and ".join(steps))


def _larger_risk(sources: Sequence[str]) -> tuple[str, ...]:
    least = min(score_of(source).least_risk for source in sources)
    return (f"allow {risk_in_words(least)} with accept_risk",) if least < 1.0 else ()
