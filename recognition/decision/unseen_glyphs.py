"""Doubts about characters that a partly learned font was never taught.

Where O was never enrolled, its shape is another font's, and the Q that was answers a true O about as well.
A character is doubted where it is such a guess, or where a guess comes near it.
"""

from __future__ import annotations

from collections.abc import Sequence

from recognition.decision.flags import Finding, ReadingFlag
from recognition.decision.reading import Reading
from recognition.marks.laid_text import LaidText


def doubted_guesses(
    reading: Reading, laid: LaidText, places: Sequence[str] | None, *, near_score: float = 0.05
) -> Reading:
    """The reading, sent to review where a character of it may be one that its font was never taught.

    Args:
        reading: of the line.
        laid: its text in the templates of a font.
        places: characters allowed at each place of a known format, or None.
        near_score: correlation by which a guess may fall short and still be meant: where a character that was felt
            answered instead of the guess that stood there, it was by 0.01 or 0.02 (E for F, Q for O).
    """
    known = laid.glyphs.chars
    guessed = {c for c in known if laid.font.glyphs[c].guessed}
    if not guessed:
        return reading
    doubts = []
    for k, (character, scores) in enumerate(zip(reading.characters, laid.correlations(), strict=True)):
        best = dict(zip(known, scores.tolist(), strict=True))
        allowed = set(places[k]) if places is not None and len(places) == len(laid.fits) else set(best)
        least = best.get(character.char, -1.0) - near_score
        near = [c for c in sorted(guessed & allowed) if c != character.char and best[c] > least]
        never = [character.char] if character.char in guessed else near
        if never:
            what = f"place {k + 1}: {', '.join(never)} was never enrolled in {reading.font}"
            doubts.append(Finding(ReadingFlag.FOREIGN_SHAPES, what, (k + 1,)))
    return reading.with_findings(*doubts)
