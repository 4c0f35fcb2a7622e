"""Experts by themselves, and without one of them: what the format makes of their beliefs alone.

    reading by touch --trace.by_expert--> lattice of own, print, templates --one, or some pooled--format--> a reading

Nothing is read twice. So the line and its places are those of the whole, and so is the time that is charged.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from pipeline.benchmark.readers.mode import PartReadings

if TYPE_CHECKING:
    from recognition.decision.reading import Reading
    from recognition.reader import Reader
    from recognition.senses.settings import ReaderSettings

EXPERT_MODES = (
    *("tactile own", "tactile print", "tactile templates", "vision own", "vision print"),
    *("tactile own+templates", "tactile own+print", "tactile print+templates"),
)
"""Sense and experts (`recognition.senses.settings.EXPERTS`); a plain install has own and templates."""


class ExpertMode:
    """Some experts of one sense."""

    def __init__(self, name: str, reader: Reader) -> None:
        """Prepare.

        Args:
            name: of `EXPERT_MODES`.
            reader: of both senses.

        Raises:
            EngineMissingError: the expert is not installed.
        """
        from recognition.experts import generic

        sense, experts = name.split()
        self.experts = tuple(experts.split("+"))
        if "print" in self.experts:
            generic.check_installed()
        self.uses: tuple[str, ...] = ("touch",) if sense == "tactile" else ("vision",)
        self.settings = reader.settings
        _ = reader.touch if sense == "tactile" else reader.vision

    def read(self, senses: PartReadings) -> Reading:
        """What the experts would have read; nothing where none had a say."""
        whole = senses.touch if self.uses == ("touch",) else senses.vision
        return alone(whole, self.experts, self.settings)


def alone(whole: Reading, experts: Sequence[str], settings: ReaderSettings) -> Reading:
    """A reading as some of its experts would have it.

    Args:
        whole: as all experts together have it.
        experts: their names.
        settings: thresholds and format.
    """
    from recognition.belief.calibration import calibration_for
    from recognition.belief.line_belief import pooled
    from recognition.belief.weights import weights_of
    from recognition.decision.decide import decided
    from recognition.decision.reading_of_line import characters_of
    from recognition.language.constrained_decoding import choose
    from recognition.views.view import ViewKind

    heard = {name: own for name, own in whole.trace.by_expert.items() if name in experts}
    if not heard:
        return replace(decided((), 0.0, settings), source=whole.source, seconds=whole.seconds)
    kind = ViewKind.PHOTO if whole.source == "vision" else ViewKind.FELT
    # an expert by itself is taken at its word
    weights = weights_of(kind).among(heard)
    lattice = pooled(heard, weights) if len(experts) > 1 else next(iter(heard.values()))
    choice = choose(lattice, settings.grammar)
    return decided(
        characters_of(choice, lattice),
        calibration_for(whole.source, heard).confidence(choice.probability),
        settings,
        choice=choice,
        grammar=settings.grammar,
        source=whole.source,
        seconds=whole.seconds,
    )


def experts_in(modes: tuple[str, ...]) -> tuple[str, ...]:
    """The modes of the experts that have a say in these modes, as far as they are installed."""
    from recognition.experts import generic

    senses = {sense for sense in ("tactile", "vision") if {sense, "fused"} & {*modes}}
    there = {"own", "templates"} | ({"print"} if generic.is_installed() else set())
    named = [(mode, *mode.split()) for mode in EXPERT_MODES]
    return tuple(mode for mode, sense, experts in named if sense in senses and there >= {*experts.split("+")})
