"""Contracts besides the format: a certificate, the part's codes, and the characters enrolled in a learned font.

A reading that breaks one goes to review, whatever its score is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from recognition.decision.decide import Decision, Finding, ReadingFlag
from recognition.decision.reading import Reading
from recognition.language.code_text import holds

if TYPE_CHECKING:
    from recognition.marks.laid_text import LaidText
    from recognition.views.codes import Code

DIGITS = 6
"""Decimals of a confidence in records; certificates are computed from records."""


@dataclass(frozen=True)
class CertifiedAcceptance:
    """Limits of a certificate for acceptance, in addition to the settings.

    Attributes:
        confidence: least confidence, 0 to 1.
        sources: sources of the certified readings: "tactile", "vision", "fused"; others are not accepted.
    """

    confidence: float
    sources: tuple[str, ...]


def as_certified(reading: Reading, allowed: CertifiedAcceptance | None) -> Reading:
    """Send a reading to review if a certificate does not cover it; without a certificate nothing changes."""
    if allowed is None or reading.decision is not Decision.ACCEPT:
        return reading
    if reading.source not in allowed.sources:
        why = f"the certificate does not cover this sense ({reading.source})"
    elif round(reading.confidence, DIGITS) < allowed.confidence:
        why = f"confidence {reading.confidence:.4f}, certified from {allowed.confidence:g}"
    else:
        return reading
    return reading.with_findings(Finding(ReadingFlag.NOT_CERTIFIED, why))


def checked_by_codes(reading: Reading, codes: Sequence[Code]) -> Reading:
    """Add the part's codes; send the reading to review if no code has its serial and one has another serial.

    A code with the same serial also shows which way up the part lies.

    Args:
        reading: a decided reading.
        codes: codes of the part's photographs.
    """
    made = replace(reading.without_flags(ReadingFlag.CODE_DISAGREES), codes=tuple(codes))
    said = [holds(code.text, made.text) for code in made.codes]
    if True in said:
        return made.without_flags(ReadingFlag.ORIENTATION_UNKNOWN)
    others = [code for code, same in zip(made.codes, said, strict=True) if same is False and made.text]
    return made.with_findings(
        *(
            Finding(
                ReadingFlag.CODE_DISAGREES,
                f"the {code.kind} holds “{code.text}”, the marks read “{made.text}” (look at the part)",
            )
            for code in others
        )
    )


def doubted_guesses(
    reading: Reading, laid: LaidText, places: Sequence[str] | None, *, near_fit: float = 0.05
) -> Reading:
    """Send a reading to review if one of its characters may be missing from its learned font.

    If O was never enrolled, its shape comes from another font, and an enrolled Q fits a true O about as well. A
    character is doubtful if it is such a guess, or if a guess fits nearly as well.

    Args:
        reading: reading of the line.
        laid: its text fitted in a font.
        places: characters allowed at each place of a known format, or None.
        near_fit: greatest shortfall in correlation of a guess that may still be right; where an enrolled character won
            over the right guess, it won by 0.01 or 0.02 (E for F, Q for O).
    """
    guessed = {c for c, glyph in laid.font.glyphs.items() if glyph.guessed}
    if not guessed:
        return reading
    doubts = []
    for k, character in enumerate(reading.characters):
        allowed = (
            guessed & set(places[k]) if places is not None and len(places) == len(laid.text) else guessed
        )
        own = laid.laid[k]
        least = -1.0 if own is None else own.fit - near_fit
        near = [c for c in sorted(allowed) if laid.felt.lay(k, c, laid.font, laid.face).fit > least]
        never = [character.char] if character.char in guessed else near
        if never:
            what = f"place {k + 1}: {', '.join(never)} was never enrolled in {reading.font}"
            doubts.append(Finding(ReadingFlag.FOREIGN_SHAPES, what, (k + 1,)))
    return reading.with_findings(*doubts)
