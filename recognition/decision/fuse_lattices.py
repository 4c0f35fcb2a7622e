"""Combine the posteriors of touch and camera, place by place.

    p(c) ~ touch(c) * camera(c) ** power      what a sense has not read is spread over all characters: it says nothing

A character that touch rules out stays out. The camera rules out only what its format does, and the format acts later.
The camera's power is below 1, for the dirt that leaves touch in doubt blinds it, too. Of 743 parts of two generators
that both had read, touch had 97.1 % of characters and 635 serials right; powers of 0.3, 0.5, 0.7 and 1 gave 640, 648,
648 and 643 serials.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from recognition.language.lattice import Lattice

Floats = NDArray[np.float64]


def fuse_lattices(touch: Lattice, camera: Lattice, *, power: float = 0.7) -> Lattice:
    """Combine the posteriors of both senses at the places of touch.

    Args:
        touch: posteriors; its places and boxes are the outcome's.
        camera: posteriors of as many places.
        power: power to which the camera's beliefs are taken.

    Returns:
        Beliefs over the characters of either. What neither has read is "nothing readable".

    Raises:
        ValueError: other numbers of places.
    """
    if touch.n_places != camera.n_places:
        raise ValueError(f"{touch.n_places} and {camera.n_places} places cannot be the same ones")
    chars = (*touch.chars, *(c for c in camera.chars if c not in touch.chars))
    (felt, felt_read), (seen, seen_read) = _spread(touch, chars), _spread(camera, chars)
    possible = _possible(touch, chars)
    # of a place that touch has not read it has ruled out nothing
    possible |= ~possible.any(axis=1, keepdims=True)
    read = 1.0 - (1.0 - felt_read) * (1.0 - seen_read)
    with np.errstate(divide="ignore"):
        log = np.where(possible, np.log(felt) + power * np.log(seen), -np.inf)
        log += np.log(read)[:, None] - np.logaddexp.reduce(log, axis=1)[:, None]
    return Lattice(chars, np.minimum(log, 0.0), boxes=touch.boxes)


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
    belief, _ = _spread(lattice, lattice.chars)
    ours, others = ([lattice.chars.index(c) for c in characters] for characters in (text, other))
    places = np.arange(lattice.n_places)
    return float((np.log(belief[places, ours]) - np.log(belief[places, others])).sum())


def _spread(own: Lattice, chars: tuple[str, ...]) -> tuple[Floats, Floats]:
    """(places, chars) probabilities relative to a guess, and (places,) probability that the place was read.

    What was not read is spread over all characters; those that a sense has ruled out count as a guess.
    """
    out = np.zeros((own.n_places, len(chars)))
    out[:, [chars.index(c) for c in own.chars]] = np.exp(own.log_belief)
    read, known = np.minimum(out.sum(axis=1), 1.0), _possible(own, chars)
    guess = 1.0 / np.maximum(known.sum(axis=1), 1)[:, None]
    return np.where(known, out / guess + (1.0 - read)[:, None], 1.0), read


def _possible(own: Lattice, chars: tuple[str, ...]) -> NDArray[np.bool_]:
    """(places, chars) whether a sense has not excluded a character."""
    out = np.zeros((own.n_places, len(chars)), dtype=np.bool_)
    out[:, [chars.index(c) for c in own.chars]] = np.isfinite(own.log_belief)
    return out
