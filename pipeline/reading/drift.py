"""Watches whether the parts that are read are of the kind that was certified.

Every EVERY parts the last WINDOW of them are compared with the certificate's; what differs is told once, until they
are alike again.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import TYPE_CHECKING

from recognition.decision.likeness import Unlike, unlike

if TYPE_CHECKING:
    from pipeline.reading.certificate import Certificate
    from recognition.decision.evidence import Measure

EVERY = 20
"""Parts between two comparisons."""
WINDOW = 200
"""Latest parts that are compared; older ones would hide what has changed since."""


class DriftWatch:
    """Compares parts as they are read with a certificate's.

    Attributes:
        found: how the parts differ, as of the last comparison; empty where they do not.
        parts: parts that were looked at.
        first: what was said when the parts were first found to differ; empty where they never were.
    """

    def __init__(self, certificate: Certificate) -> None:
        self._certificate = certificate
        self._latest: deque[Mapping[Measure, float]] = deque(maxlen=WINDOW)
        self._waiting = 0
        self.parts = 0
        self.found: tuple[Unlike, ...] = ()
        self.first = ""

    def add(self, source: str, measures: Mapping[Measure, float]) -> bool:
        """Look at one more part; whether it is with this one that the parts are found to differ.

        Args:
            source: of its reading; one that was not certified is not looked at.
            measures: of the part; empty where it could not be read.
        """
        if not measures or source not in self._certificate.sources:
            return False
        self._latest.append(measures)
        self.parts += 1
        self._waiting += 1
        return self._waiting >= EVERY and self.compare()

    def compare(self) -> bool:
        """Compare now, unless it was done with the last part; whether the parts are now first found to differ."""
        if not self._waiting:
            return False
        before, self._waiting = self.found, 0
        self.found = unlike(self._certificate.kind, self._latest)
        self.first = self.first or self.message()
        return bool(self.found) and not before

    def message(self) -> str:
        """How the parts differ, for a person; empty where they do not."""
        if not self.found:
            return ""
        return (
            f"these parts are unlike the certified ones, for which alone the certificate of "
            f"{self._certificate.made_at:%Y-%m-%d} holds: {'; '.join(map(str, self.found[:3]))}; certify again on "
            f"parts like these"
        )
