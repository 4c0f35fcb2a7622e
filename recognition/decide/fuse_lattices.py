"""Combine the posteriors of touch and camera, place by place.

    log p(c) = w_touch log l_touch(c) + w_camera log l_camera(c)        up to a constant

l(c) is a sense's probability of a character relative to a guess. What a sense has not read is spread over all
characters, so a sense that sees nothing has no weight: l is 1. A character that touch rules out stays out. The camera
rules out only what its format does, and the format acts later.

The weight of the camera is below 1: dirt that leaves touch in doubt misleads it too, so the senses do not err
independently. `python tests/benchmarks/fit_score.py` fits `fuse_lattices.fit.json`: a conditional logit of the true
character of each place. Weights that depend on contrast, roughness, cover or sureness of a sense lower the log loss on
another generator by at most 2.2 %: what a sense knows of its own quality is in its posteriors.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from recognition.decide.score import log_odds, share
from recognition.language.lattice import Lattice

Floats = NDArray[np.float64]
FITTED = Path(__file__).with_name("fuse_lattices.fit.json")


@dataclass(frozen=True)
class FusionWeights:
    """Weights of the log-likelihood ratios of both senses, 0 or more."""

    touch: float
    camera: float


@cache
def fitted_weights() -> FusionWeights:
    """Load the fitted weights."""
    return FusionWeights(**json.loads(FITTED.read_text(encoding="utf-8"))["weights"])


def fuse_lattices(touch: Lattice, camera: Lattice, *, weights: FusionWeights | None = None) -> Lattice:
    """Combine the posteriors of both senses at the places of touch, over characters of either. Raises ValueError."""
    if touch.n_places != camera.n_places:
        raise ValueError(f"{touch.n_places} and {camera.n_places} places cannot be the same ones")
    weights = fitted_weights() if weights is None else weights
    chars = (*touch.chars, *(c for c in camera.chars if c not in touch.chars))
    (felt, felt_read), (seen, seen_read) = (
        relative_likelihood(lattice, chars) for lattice in (touch, camera)
    )
    possible = np.isfinite(log_over(touch, chars))
    # of a place that touch has not read it has ruled out nothing
    possible |= ~possible.any(axis=1, keepdims=True)
    read = 1.0 - (1.0 - felt_read) * (1.0 - seen_read)
    with np.errstate(divide="ignore"):
        log = np.where(possible, weights.touch * np.log(felt) + weights.camera * np.log(seen), -np.inf)
        log += np.log(read)[:, None] - np.logaddexp.reduce(log, axis=1)[:, None]
    return Lattice(chars, np.minimum(log, 0.0), boxes=touch.boxes)


def contradict(touch: Lattice, camera: Lattice, *, sure: float = 0.97) -> bool:
    """Whether both senses are sure of different characters at a place."""
    bests = (np.exp(lattice.log_belief).max(axis=1, initial=0.0) >= sure for lattice in (touch, camera))
    return any(a != b for a, b, *both in zip(touch.text, camera.text, *bests, strict=True) if all(both))


def lead_nats(lattice: Lattice, text: str, other: str) -> float:
    """Log ratio of the probabilities of two texts by one sense; what it has not read counts for neither."""
    if len(other) != lattice.n_places or not set(other) <= set(lattice.chars):
        return math.inf
    belief, _ = relative_likelihood(lattice, lattice.chars)
    ours, others = ([lattice.chars.index(c) for c in characters] for characters in (text, other))
    places = np.arange(lattice.n_places)
    return float((np.log(belief[places, ours]) - np.log(belief[places, others])).sum())


def odds_by_touch(text: str, felt_text: str, felt: Lattice, felt_odds: float) -> float:
    """Log odds of a text by touch alone, which has read `felt_text` with `felt_odds`, perhaps another one."""
    lead = lead_nats(felt, felt_text, text)
    return log_odds(share(felt_odds) * math.exp(-lead))


def relative_likelihood(lattice: Lattice, chars: tuple[str, ...]) -> tuple[Floats, Floats]:
    """(places, chars) probabilities relative to a guess, and (places,) probability that the place was read."""
    log = log_over(lattice, chars)
    out, known = np.exp(log), np.isfinite(log)
    read = np.minimum(out.sum(axis=1), 1.0)
    guess = 1.0 / np.maximum(known.sum(axis=1), 1)[:, None]
    # what was not read is spread over all characters; those that a sense has ruled out count as a guess
    return np.where(known, out / guess + (1.0 - read)[:, None], 1.0), read


def log_over(lattice: Lattice, chars: tuple[str, ...]) -> Floats:
    """(places, chars) log posteriors over other characters; -inf of one that the lattice lacks or excludes."""
    log = np.full((lattice.n_places, len(chars)), -np.inf)
    log[:, [chars.index(c) for c in lattice.chars]] = lattice.log_belief
    return log
