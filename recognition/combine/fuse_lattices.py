"""Combine the posteriors of touch and camera, place by place.

    p(c) ~ touch'(c) camera'(c)        log-likelihood ratios add
    s'(c) = (1 - e) s(c) + e g         g: a guess, even over the characters that a sense has not ruled out

A sense is misled on a part with the probability e: dirt or light show it something else, and its posteriors say
nothing, however sure they are. So e limits what a place can say for a character: at 0.3 the camera adds 4 nats at most,
at 1 nothing, and both senses misled by the same dirt cannot add up to certainty. What a sense has not read is spread
over all characters as well: a sense that sees nothing has no weight. A character that touch rules out stays out. The
camera rules out only what its format does, and the format acts later.

The probabilities e, and what they depend on, are in `fuse_lattices.fit.json`; `python tests/benchmarks/fit_score.py`
fits them.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from recognition.language.lattice import Lattice

Floats = NDArray[np.float64]
FITTED = Path(__file__).with_name("fuse_lattices.fit.json")


@dataclass(frozen=True)
class Misled:
    """Probability that the posteriors of a sense say nothing about a part: a logistic curve of its sureness.

    Attributes:
        bias: log odds at a sureness of 0.
        slope: log odds per nat of sureness (`sureness`).
    """

    bias: float
    slope: float

    def probability(self, lattice: Lattice) -> float:
        """Probability for a part with these posteriors."""
        return float(1.0 / (1.0 + math.exp(-(self.bias + self.slope * sureness(lattice)))))


@cache
def misled() -> Mapping[str, Misled]:
    """Load the fitted curves of the senses, "touch" and "camera"."""
    fitted = json.loads(FITTED.read_text(encoding="utf-8"))["misled"]
    return {sense: Misled(**values) for sense, values in fitted.items()}


def fuse_lattices(touch: Lattice, camera: Lattice, *, curves: Mapping[str, Misled] | None = None) -> Lattice:
    """Combine the posteriors of both senses at the places of touch.

    Args:
        touch: posteriors; its places and boxes are the outcome's.
        camera: posteriors of as many places.
        curves: probability that "touch" and "camera" are misled; None for the fitted curves.

    Returns:
        Posteriors over the characters of either. What neither has read is "nothing readable".

    Raises:
        ValueError: other numbers of places.
    """
    if touch.n_places != camera.n_places:
        raise ValueError(f"{touch.n_places} and {camera.n_places} places cannot be the same ones")
    curves = misled() if curves is None else curves
    chars = (*touch.chars, *(c for c in camera.chars if c not in touch.chars))
    possible = possible_characters(touch, chars)
    # of a place that touch has not read it has ruled out nothing
    possible |= ~possible.any(axis=1, keepdims=True)
    log, unread = np.zeros(possible.shape), np.ones(touch.n_places)
    for lattice, curve in ((touch, curves["touch"]), (camera, curves["camera"])):
        relative, read = relative_likelihood(lattice, chars)
        nothing = curve.probability(lattice)
        log += np.log((1.0 - nothing) * relative + nothing)
        unread *= 1.0 - read
    log = np.where(possible, log, -np.inf)
    with np.errstate(divide="ignore"):
        log += np.log1p(-unread)[:, None] - np.logaddexp.reduce(log, axis=1)[:, None]
    return Lattice(chars, np.minimum(log, 0.0), boxes=touch.boxes)


def sureness(lattice: Lattice, *, most_nats: float = 9.0) -> float:
    """Mean log ratio of the best to the second best character of a place, nats; 0 without places.

    Args:
        lattice: posteriors of a sense.
        most_nats: greatest ratio of one place; the experts are never surer (`combine_experts`).
    """
    if not lattice.n_places:
        return 0.0
    relative, _ = relative_likelihood(lattice, lattice.chars)
    second, best = np.sort(relative, axis=1)[:, -2:].T if len(lattice.chars) > 1 else (relative[:, 0],) * 2
    return float(np.log(best / second).clip(0.0, most_nats).mean())


def contradict(touch: Lattice, camera: Lattice, *, sure: float = 0.97) -> bool:
    """Whether both senses are sure of different characters at a place.

    Args:
        touch: posteriors.
        camera: posteriors of as many places.
        sure: belief from which a sense counts as sure.
    """
    bests = (np.exp(lattice.log_belief).max(axis=1, initial=0.0) >= sure for lattice in (touch, camera))
    return any(a != b for a, b, *both in zip(touch.text, camera.text, *bests, strict=True) if all(both))


def lead_nats(lattice: Lattice, text: str, other: str) -> float:
    """Log ratio of the probabilities of two texts by one sense; what it has not read counts for neither.

    Args:
        lattice: posteriors of the sense.
        text: text of its characters, as long as it has places.
        other: another text; infinitely less likely if it has another length or other characters.
    """
    if len(other) != lattice.n_places or not set(other) <= set(lattice.chars):
        return math.inf
    belief, _ = relative_likelihood(lattice, lattice.chars)
    ours, others = ([lattice.chars.index(c) for c in characters] for characters in (text, other))
    places = np.arange(lattice.n_places)
    return float((np.log(belief[places, ours]) - np.log(belief[places, others])).sum())


def relative_likelihood(lattice: Lattice, chars: tuple[str, ...]) -> tuple[Floats, Floats]:
    """(places, chars) probabilities relative to a guess, and (places,) probability that the place was read.

    What was not read is spread over all characters; those that a sense has ruled out count as a guess.
    """
    out = np.zeros((lattice.n_places, len(chars)))
    out[:, [chars.index(c) for c in lattice.chars]] = np.exp(lattice.log_belief)
    read, known = np.minimum(out.sum(axis=1), 1.0), possible_characters(lattice, chars)
    guess = 1.0 / np.maximum(known.sum(axis=1), 1)[:, None]
    return np.where(known, out / guess + (1.0 - read)[:, None], 1.0), read


def possible_characters(lattice: Lattice, chars: tuple[str, ...]) -> NDArray[np.bool_]:
    """(places, chars) whether a sense has not excluded a character."""
    out = np.zeros((lattice.n_places, len(chars)), dtype=np.bool_)
    out[:, [chars.index(c) for c in lattice.chars]] = np.isfinite(lattice.log_belief)
    return out
