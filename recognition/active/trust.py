"""The acceptance threshold for a part that is read repeatedly while it is felt."""

from __future__ import annotations

from recognition.decision.decide import Decision, Finding, ReadingFlag
from recognition.decision.reading import Reading
from recognition.decision.score import serial_is_sure

EVEN = 0.5
"""Confidence above which a text is a candidate."""


class Trust:
    """Acceptance threshold that rises with the number of candidate texts.

    Reading the same text again costs nothing. Each new text is one more chance to be wrong: after k candidate texts,
    1/k of the doubt 1 - score is allowed (Bonferroni). The doubt is that of touch's threshold for the accepted risk.
    """

    def __init__(self, threshold: float) -> None:
        """Start with a new part.

        Args:
            threshold: least score while there is only one candidate text.
        """
        self._threshold = threshold
        self._candidates: set[str] = set()

    def accepts(self, reading: Reading) -> bool:
        """Count the text as a candidate, and return whether the serial is sure."""
        if reading.confidence > EVEN:
            self._candidates.add(reading.text)
        least = 1.0 - (1.0 - self._threshold) / max(len(self._candidates), 1)
        return serial_is_sure(reading) and reading.confidence >= least

    def apply_trust(self, reading: Reading) -> Reading:
        """Send an accepted reading to review if it is not sure enough."""
        if reading.decision is not Decision.ACCEPT or self.accepts(reading):
            return reading
        before = Finding(ReadingFlag.BELIEVED_OTHERWISE, "low confidence: an earlier look read another text")
        return reading.with_findings(before)
