"""Experts by themselves: what the format makes of their beliefs alone.

    reading by touch --trace.by_expert--> lattice of network, templates --one of them--format--> a reading

Nothing is read twice. So the line and its places are those of the whole, and so is the time that is charged.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from recognition.decision.reading import Reading
    from recognition.senses.settings import ReaderSettings

EXPERT_MODES = ("tactile network", "tactile templates", "vision network")
"""Sense and expert (`recognition.senses.settings.EXPERTS`)."""


def alone(whole: Reading, expert: str, settings: ReaderSettings) -> Reading:
    """A reading as one of its experts would have it.

    Args:
        whole: as all experts together have it.
        expert: its name.
        settings: thresholds and format.
    """
    from recognition.decision.flags import ReadingFlag
    from recognition.decision.reading import Reading
    from recognition.decision.reading_of_line import characters_of, contracts_of_choice
    from recognition.decision.score import score_of
    from recognition.language.constrained_decoding import choose

    made = Reading((), 0.0, source=whole.source, seconds=whole.seconds, threshold=settings.accept_confidence)
    lattice = whole.trace.by_expert.get(expert)
    if lattice is None:
        return replace(made, flags=ReadingFlag.NO_CHARACTERS)
    choice = choose(lattice, settings.grammar)
    made = replace(
        made,
        characters=tuple(characters_of(choice, lattice)),
        confidence=score_of(whole.source).of_belief(choice.probability),
    )
    return contracts_of_choice(made, choice, settings.grammar)


def experts_in(modes: tuple[str, ...]) -> tuple[str, ...]:
    """The modes of the experts that have a say in these modes."""
    senses = {sense for sense in ("tactile", "vision") if {sense, "fused"} & {*modes}}
    return tuple(mode for mode in EXPERT_MODES if mode.split()[0] in senses)
