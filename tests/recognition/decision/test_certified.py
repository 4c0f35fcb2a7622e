"""What a certificate lets pass."""

from __future__ import annotations

from dataclasses import replace

from recognition.decision.contracts import CertifiedAcceptance, as_certified
from recognition.decision.decide import Decision
from recognition.decision.reading import ReadingFlag
from tests.support.readings import reading_of

READ = reading_of("A", 0.995)
ALLOWED = CertifiedAcceptance(0.995, ("tactile",))


def test_what_it_vouches_for_passes_unchanged() -> None:
    assert as_certified(READ, ALLOWED) is READ
    assert as_certified(READ, None) is READ
    # records keep six digits, and the certificate rests on those
    assert as_certified(replace(READ, confidence=0.9949996), ALLOWED).decision is Decision.ACCEPT


def test_what_is_less_sure_goes_to_review_and_says_why() -> None:
    found = as_certified(replace(READ, confidence=0.994), ALLOWED)
    assert found.decision is Decision.REVIEW
    assert ReadingFlag.NOT_CERTIFIED in found.flags
    assert found.messages()[-1] == "confidence 0.9940, certified from 0.995"


def test_a_sense_that_was_not_certified_is_not_accepted() -> None:
    assert as_certified(replace(READ, source="vision"), ALLOWED).decision is Decision.REVIEW
    assert as_certified(READ, CertifiedAcceptance(0.0, ())).decision is Decision.REVIEW


def test_it_never_accepts_by_itself() -> None:
    for doubted in (replace(READ, threshold=0.999), replace(READ, characters=())):
        assert doubted.decision is not Decision.ACCEPT
        assert as_certified(doubted, ALLOWED) is doubted
