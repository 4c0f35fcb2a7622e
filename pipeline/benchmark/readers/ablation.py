"""Ablation: the decision without one of its rules, a contract or a term of the score."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from pipeline.common.settings import SettingsError

if TYPE_CHECKING:
    from recognition.decision.evidence import Measure
    from recognition.decision.flags import ReadingFlag
    from recognition.decision.reading import Reading


def rules() -> dict[str, ReadingFlag | Measure]:
    """List contracts and terms of the score by name, such as unread-marks or strokes."""
    from recognition.decision.evidence import Measure
    from recognition.decision.flags import BROKEN, MEASURE_FLAGS
    from recognition.decision.score import SOURCES, score_of

    terms = {term for source in SOURCES for term in score_of(source).terms if term is not Measure.ODDS}
    single = (*(BROKEN & ~MEASURE_FLAGS), *sorted(terms))
    named = {str(rule.name).lower().replace("_", "-"): rule for rule in single}
    return {**named, "mark-rules": MEASURE_FLAGS}


def leave_out(name: str) -> Callable[[Reading], Reading]:
    """Make a function that decides on a reading without one rule; nothing is read again.

    Raises:
        SettingsError: no such rule; names all.
    """
    from recognition.decision.flags import ReadingFlag
    from recognition.decision.score import with_score

    known = rules()
    if name not in known:
        what = f"there is no rule {name!r} to leave out"
        raise SettingsError(what, hint=f"the rules are {', '.join(known)}")
    rule = known[name]
    if isinstance(rule, ReadingFlag):
        return lambda reading: reading.without_flags(rule)
    return lambda reading: with_score(reading, without=frozenset({rule}))
