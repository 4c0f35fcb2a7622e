"""A reading with the verdict on the text that its part should read."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from recognition.decision.flags import ReadingFlag
from recognition.decision.reading import Reading
from recognition.decision.verify import Verdict, verify
from recognition.language.grammar import Grammar
from recognition.language.lattice import Lattice


def with_verification(
    reading: Reading,
    lattice: Lattice | None,
    text: str,
    *,
    grammar: Grammar | None = None,
    contradicted: bool = False,
) -> Reading:
    """The reading with the states of its places for the text expected, and the verdict in its trace.

    Args:
        reading: as read.
        lattice: beliefs made without knowing the text; None where no characters were found.
        text: expected.
        grammar: names the rival.
        contradicted: two senses are sure of different characters: nothing is confirmed.

    Raises:
        VerifyError: a text that cannot be looked for.
    """
    if lattice is None:
        lattice = Lattice((), np.zeros((0, 0)))
    verification = verify(lattice, text, grammar=grammar)
    if contradicted and verification.verdict is Verdict.CONFIRMED:
        verification = replace(verification, verdict=Verdict.UNDECIDED)
    flags = reading.flags
    if contradicted:
        flags |= ReadingFlag.SENSES_DISAGREE
    if verification.verdict is Verdict.REFUTED:
        flags |= ReadingFlag.MISMATCH
    characters = reading.characters
    if verification.places == len(characters):
        states = {check.place: check.state for check in verification.characters if check.place is not None}
        characters = tuple(replace(c, state=states.get(k, c.state)) for k, c in enumerate(characters))
    return replace(reading, characters=characters, flags=flags).with_trace(verification=verification)
