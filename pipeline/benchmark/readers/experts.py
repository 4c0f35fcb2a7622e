"""Experts by themselves: what the format makes of their beliefs alone.

    reading by touch --trace.by_expert--> lattice of network, templates --one of them--format--> a reading

Nothing is read twice. So the line and its places are those of the whole, and so is the time that is charged.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from pipeline.benchmark.readers.mode import PartReadings

if TYPE_CHECKING:
    from recognition.decision.reading import Reading
    from recognition.reader import Reader
    from recognition.senses.settings import ReaderSettings

EXPERT_MODES = ("tactile network", "tactile templates", "vision network")
"""Sense and expert (`recognition.senses.settings.EXPERTS`)."""


class ExpertMode:
    """One expert of one sense."""

    def __init__(self, name: str, reader: Reader) -> None:
        """Prepare.

        Args:
            name: of `EXPERT_MODES`.
            reader: of both senses.
        """
        sense, self.expert = name.split()
        self.uses: tuple[str, ...] = ("touch",) if sense == "tactile" else ("vision",)
        self.settings = reader.settings
        _ = reader.touch if sense == "tactile" else reader.vision

    def read(self, senses: PartReadings) -> Reading:
        """What the expert would have read; nothing where it had no say."""
        whole = senses.touch if self.uses == ("touch",) else senses.vision
        return alone(whole, self.expert, self.settings)


def alone(whole: Reading, expert: str, settings: ReaderSettings) -> Reading:
    """A reading as one of its experts would have it.

    Args:
        whole: as all experts together have it.
        expert: its name.
        settings: thresholds and format.
    """
    from recognition.belief.calibration import calibration_of
    from recognition.decision.decide import decided
    from recognition.decision.reading_of_line import characters_of
    from recognition.language.constrained_decoding import choose

    lattice = whole.trace.by_expert.get(expert)
    if lattice is None:
        return replace(decided((), 0.0, settings), source=whole.source, seconds=whole.seconds)
    choice = choose(lattice, settings.grammar)
    return decided(
        characters_of(choice, lattice),
        calibration_of(whole.source).confidence(choice.probability),
        settings,
        choice=choice,
        grammar=settings.grammar,
        source=whole.source,
        seconds=whole.seconds,
    )


def experts_in(modes: tuple[str, ...]) -> tuple[str, ...]:
    """The modes of the experts that have a say in these modes."""
    senses = {sense for sense in ("tactile", "vision") if {sense, "fused"} & {*modes}}
    return tuple(mode for mode in EXPERT_MODES if mode.split()[0] in senses)
