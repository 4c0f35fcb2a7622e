"""Beliefs of several engines made one, and a lattice made a reading."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from recognition.box import Box
from recognition.constrained_decoding import choose
from recognition.decision import Thresholds, decided
from recognition.grammar import Grammar
from recognition.lattice import Lattice
from recognition.reading import Candidate, CharacterReading, Reading, ReadingFlag

FLOOR = 1e-4
"""Belief that one engine leaves to a character, as a share: none rules out what another sees clearly."""
CANDIDATES = 5
EARNED = 1.0
"""What a place read with certainty earns, nats, against what doubt costs: longer lines are not shunned."""


def certainty(lattice: Lattice) -> float:
    """How sure an engine is of a line: longer and surer is more."""
    return float((lattice.log_belief.max(axis=1) + EARNED).sum())


def joined(lattices: Mapping[str, Lattice], weights: Mapping[str, float]) -> Lattice:
    """The product of the engines' beliefs, each to the power of its weight.

    Engines that count different numbers of places cannot be joined: the surer one speaks.

    Args:
        lattices: by engine, all over the same characters.
        weights: by engine.

    Raises:
        ValueError: no lattice, or different characters.
    """
    if not lattices:
        raise ValueError("no engine has read anything; there is nothing to join")
    names = sorted(lattices, key=lambda n: -weights[n] * max(certainty(lattices[n]), 0.0))
    lead = lattices[names[0]]
    if any(lattices[n].chars != lead.chars for n in names):
        raise ValueError("the engines' lattices are over different characters; ask all for the same")
    same = [n for n in names if lattices[n].n_places == lead.n_places]
    if len(same) == 1:
        return lead
    total = np.zeros(lead.log_belief.shape)
    missing = np.zeros(lead.n_places)
    possible = np.zeros(lead.log_belief.shape, dtype=np.bool_)
    for name in same:
        log = lattices[name].log_belief
        possible |= np.isfinite(log)
        read = np.logaddexp.reduce(log, axis=1)
        share = np.maximum(np.exp(log - read[:, None]), FLOOR)
        total += weights[name] * np.log(share)
        missing += weights[name] * (1.0 - np.exp(np.minimum(read, 0.0)))
    total = np.where(possible, total, -np.inf)
    total -= np.logaddexp.reduce(total, axis=1)[:, None]
    # that nothing readable stands there is for all engines to say, not for one
    there = 1.0 - missing / sum(weights[n] for n in same)
    boxes = next((lattices[n].boxes for n in ("templates", *same) if n in same and lattices[n].boxes), ())
    return Lattice(lead.chars, total + np.log(np.maximum(there, 1e-12))[:, None], boxes=boxes)


def as_reading(
    lattice: Lattice,
    settings: Thresholds,
    *,
    grammar: Grammar | None = None,
    flags: ReadingFlag = ReadingFlag.NONE,
    source: str = "vision",
) -> Reading:
    """The best serial, accepted where all of its characters are sure enough.

    Args:
        lattice: beliefs.
        settings: thresholds of confidence and margin.
        grammar: that the serial obeys beyond the characters at each place; what it overrules is not accepted.
        flags: doubts beside these.
        source: of the reading.
    """
    belief, text = np.exp(lattice.log_belief), ""
    choice = choose(lattice, grammar) if grammar is not None and lattice.n_places else None
    if choice is not None and choice.text:
        belief, text = choice.places, choice.text
    box = lattice.boxes or (Box(0.0, 0.0, 0.0, 0.0),) * lattice.n_places
    characters = [_character(lattice.chars, row, box[k], text[k : k + 1]) for k, row in enumerate(belief)]
    confidence = float(np.prod([c.confidence for c in characters])) if choice is None else choice.probability
    hull = None
    if lattice.boxes:
        hull = Box(
            min(b.x0_mm for b in lattice.boxes),
            min(b.y0_mm for b in lattice.boxes),
            max(b.x1_mm for b in lattice.boxes),
            max(b.y1_mm for b in lattice.boxes),
        )
    return decided(
        characters,
        confidence,
        settings,
        flags=flags,
        choice=choice,
        grammar=grammar,
        box=hull,
        source=source,
        spaces_after=lattice.spaces_after,
    )


def _character(
    chars: tuple[str, ...], belief: NDArray[np.float64], box: Box, chosen: str = ""
) -> CharacterReading:
    order = np.argsort(-belief, kind="stable")[:CANDIDATES]
    if chosen:
        first = chars.index(chosen)
        order = np.array([first, *(i for i in order if i != first)][:CANDIDATES])
    kept = [i for i in order if belief[i] > 0.0] or [int(order[0])]
    return CharacterReading(
        tuple(Candidate(chars[i], float(belief[i]), float(min(belief[i], 1.0))) for i in kept), box
    )
