"""Acceptance under a certificate: only readings as sure as those shown to be right often enough."""

from __future__ import annotations

from dataclasses import dataclass

from recognition.decision.decide import Decision
from recognition.decision.flags import Finding, ReadingFlag
from recognition.decision.reading import Reading

DIGITS = 6
"""To which confidences are kept in records, on which a certificate rests."""


@dataclass(frozen=True)
class CertifiedAcceptance:
    """Readings that a certificate lets pass, beside the settings.

    Attributes:
        confidence: least confidence, 0 to 1.
        sources: of the readings that were certified: "tactile", "vision", "fused"; of none nothing is accepted.
    """

    confidence: float
    sources: tuple[str, ...]


def as_certified(reading: Reading, allowed: CertifiedAcceptance | None) -> Reading:
    """The reading, sent to review where a certificate does not vouch for it; as it is without a certificate."""
    if allowed is None or reading.decision is not Decision.ACCEPT:
        return reading
    if reading.source not in allowed.sources:
        why = f"the certificate says nothing of what is read so ({reading.source})"
    elif round(reading.confidence, DIGITS) < allowed.confidence:
        why = f"confidence {reading.confidence:.4f}, certified from {allowed.confidence:g}"
    else:
        return reading
    return reading.with_findings(Finding(ReadingFlag.NOT_CERTIFIED, why))
