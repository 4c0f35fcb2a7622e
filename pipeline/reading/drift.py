"""Monitor whether the parts being read are of the kind that was certified: after every EVERY parts, the last WINDOW
parts are compared. A difference is reported once, until the parts are alike again."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Mapping
from typing import TYPE_CHECKING

from pipeline.reading.certificate import Certificate, certificate_of
from pipeline.reading.certificate_statistics import Unlike, unlike

if TYPE_CHECKING:
    from pipeline.common.settings import ReadSettings
    from recognition.decide.score import Measure

EVERY = 20  # parts between two comparisons
WINDOW = 200  # most recent parts that are compared; older ones would hide a recent change


def watch_of(settings: ReadSettings) -> DriftWatch | None:
    """Make the watch of parts read with these settings; None without a certificate. Errors: `certificate_of`."""
    certificate = certificate_of(settings)
    return None if certificate is None else DriftWatch(certificate)


class DriftWatch:
    """Running comparison of the latest `window` parts with those of a certificate; threads may share it."""

    window = WINDOW

    def __init__(self, certificate: Certificate) -> None:
        self.certificate = certificate
        self._latest: deque[Mapping[Measure, float]] = deque(maxlen=WINDOW)
        self._waiting = 0
        self._lock = threading.Lock()
        self.parts = 0
        self._differing: tuple[Unlike, ...] = ()
        self.first = ""

    def add(self, source: str, measures: Mapping[Measure, float]) -> bool:
        """Add a part's measures, none if it could not be read; whether they raise a new difference."""
        if not measures or source not in self.certificate.sources:
            return False
        with self._lock:
            self._latest.append(measures)
            self.parts += 1
            self._waiting += 1
            return self._waiting >= EVERY and self.compare()

    def compare(self) -> bool:
        if not self._waiting:
            return False
        before, self._waiting = self._differing, 0
        self._differing = unlike(self.certificate.kind, self._latest)
        self.first = self.first or self.message()
        return bool(self._differing) and not before

    def message(self) -> str:
        if not self._differing:
            return ""
        return (
            f"these parts are unlike the certified ones, and the certificate of "
            f"{self.certificate.made_at:%Y-%m-%d} holds only for those: "
            f"{'; '.join(map(str, self._differing[:3]))}; certify again on parts like these"
        )
