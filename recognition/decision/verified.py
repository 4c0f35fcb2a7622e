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
    expected: str,
    *,
    grammar: Grammar | None = None,
    contradicted: bool = False,
) -> Reading:
    """The reading with the states of its places for the text expected, and the verdict in its trace.

    Args:
        reading: as read.
        lattice, expected, grammar, contradicted: as of `verify`; None where no characters were found.

    Raises:
        VerifyError: a text that cannot be looked for.
    """
    if lattice is None:
        lattice = Lattice((), np.zeros((0, 0)))
    verification = verify(lattice, expected, grammar=grammar, contradicted=contradicted)
    flags, characters = reading.flags, reading.characters
    if contradicted:
        flags |= ReadingFlag.SENSES_DISAGREE
    if verification.verdict is Verdict.REFUTED:
        flags |= ReadingFlag.MISMATCH
    if verification.places == len(characters):
        states = {check.place: check.state for check in verification.characters}
        characters = tuple(replace(c, state=states.get(k, c.state)) for k, c in enumerate(characters))
    return replace(reading, characters=characters, flags=flags).with_trace(verification=verification)
