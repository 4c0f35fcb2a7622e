"""Beliefs of touch and sight made one, place by place.

    p(c) ~ f_touch(c) f_sight(c)      f(c) = (what a sense believes of c) / (what it would believe had it not looked)

A sense looked at a place with the probability that its lattice gives to all characters there together; with the
rest it says nothing, f = 1 for every character. So the prior, every character alike, is counted once, and a sense
that did not read changes nothing. Touch leads: what it rules out stays out. What sight rules out it was told to by
its format, which has its say afterwards: of that it says nothing.

How often sight is wrong differs from part to part by far more than its own beliefs tell. Its rate of errors on a
line is learned from the line: over all rates, by how well sight foretells touch at the *other* places,

    f(c at k) = sum over rates e of p(e | places but k) ((1 - e) f(c) + e)

so that a camera that contradicts touch place after place loses its say, and one that agrees keeps it. The dirt that
leaves touch in doubt blinds the camera, too (in heavy dirt it had 5 of 25 places right where touch's best had under
0.7, and 101 of 148 where it had over 0.97): so touch's choice stands unless both together are sure of another.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from recognition.language.box import Box
from recognition.language.lattice import Lattice

SAME_PLACE_SHARE = 0.5
"""Of the usual step between characters, how far a place seen may lie from the one felt that it belongs to."""

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Reliability:
    """How far a sense's beliefs are trusted.

    Attributes:
        power: to which its beliefs are taken; under 1 where it is too sure of itself.
        rates: shares of places at which it may be wrong whatever it believes, one as likely as another beforehand.
        convincing: belief of both senses together from which another character than touch's best takes its place;
            below, sight says nothing there.

    Raises:
        ValueError: numbers out of range, or no rate.
    """

    power: float = 1.0
    rates: tuple[float, ...] = (0.0,)
    convincing: float = 0.0

    def __post_init__(self) -> None:
        shares = (*self.rates, self.convincing)
        if not 0.0 <= self.power <= 10.0 or not self.rates or not all(0.0 <= s <= 1.0 for s in shares):
            raise ValueError(
                f"{self} is out of range; power is 0 to 10, the others 0 to 1, and one rate at least"
            )


VISION_ALONE = Reliability(power=0.7, rates=(0.02, 0.1, 0.3, 0.6, 0.9), convincing=0.8)
"""Of a reader of photographs."""


def fuse_lattices(
    touch: Lattice,
    vision: Lattice,
    *,
    reliability: Reliability = VISION_ALONE,
) -> Lattice:
    """The product of both senses' beliefs at the places of touch.

    Args:
        touch: posteriors; its places, boxes and gaps are the outcome's.
        vision: posteriors.
        reliability: of sight.

    Returns:
        Beliefs over the characters of either. What neither has read is "nothing readable".
    """
    both = _Both(touch, vision, reliability)
    with np.errstate(divide="ignore"):
        log = np.log(both.prior * both.felt) + np.log(both.seen)
        total = np.logaddexp.reduce(log, axis=1)
        log = (
            np.where(np.isfinite(total)[:, None], log - total[:, None], -np.inf) + np.log(both.read)[:, None]
        )
    return Lattice(both.chars, np.minimum(log, 0.0), boxes=touch.boxes, spaces_after=touch.spaces_after)


def contradictions(
    touch: Lattice,
    vision: Lattice,
    *,
    reliability: Reliability = VISION_ALONE,
    sure: float = 0.8,
) -> tuple[tuple[int, str, str], ...]:
    """Where both senses are sure of different characters: (place from 0, touch's, sight's).

    Sight is as sure as its rate of errors at the other places lets it be.

    Args:
        touch, vision, reliability: as `fuse_lattices`.
        sure: belief from which a sense counts as sure.
    """
    both = _Both(touch, vision, replace(reliability, convincing=0.0))
    felt = both.prior * both.felt
    felt /= np.maximum(felt.sum(axis=1, keepdims=True), 1e-300)
    seen = np.where(both.considered, both.seen, 0.0)
    seen /= np.maximum(seen.sum(axis=1, keepdims=True), 1e-300)
    out = []
    for k in range(touch.n_places):
        a, b = int(felt[k].argmax()), int(seen[k].argmax())
        if a != b and felt[k, a] >= sure and seen[k, b] >= sure:
            out.append((k, both.chars[a], both.chars[b]))
    return tuple(out)


class _Both:
    """Both senses at the places of touch.

    Attributes:
        chars: of either.
        prior: (places, chars) what is possible, one as likely as another.
        felt, seen: (places, chars) factors of the senses; sight's with its rate of errors in it.
        considered: (places, chars) what sight has not ruled out.
        read: (places,) probability that either has read the place.
    """

    def __init__(self, touch: Lattice, vision: Lattice, reliability: Reliability) -> None:
        own = aligned(touch, vision)
        here = list(range(touch.n_places))
        self.chars = (*touch.chars, *(c for c in vision.chars if c not in touch.chars))
        self.felt, felt_read = _factors(touch, self.chars, here, 1.0)
        seen, seen_read = _factors(vision, self.chars, own, reliability.power)
        self.considered = _possible(vision, self.chars, own)
        possible = _possible(touch, self.chars, here)
        # of a place that touch has not read it has ruled out nothing
        possible |= ~possible.any(axis=1, keepdims=True)
        self.prior = possible / np.maximum(possible.sum(axis=1, keepdims=True), 1)
        rate = _rates(self.prior * self.felt, seen, np.array(reliability.rates))
        seen = (1.0 - rate[:, None]) * seen + rate[:, None]
        doubted = _unconvincing(self.prior * self.felt, seen, reliability.convincing)
        seen[doubted], rate[doubted] = 1.0, 1.0
        self.seen = seen
        self.read = 1.0 - (1.0 - felt_read) * (1.0 - (1.0 - rate) * seen_read)


def _rates(felt: Floats, seen: Floats, rates: Floats) -> Floats:
    """(places,) rate of sight's errors expected at each place from the others."""
    # how well sight foretells touch at a place, were it wrong at such a rate, against having said nothing
    foretold = (felt * seen).sum(axis=1) / np.maximum(felt.sum(axis=1), 1e-300)
    log = np.log(np.maximum((1.0 - rates) * foretold[:, None] + rates, 1e-300))
    others = log.sum(axis=0) - log
    weight = np.exp(others - others.max(axis=1, keepdims=True))
    return np.asarray((weight @ rates) / weight.sum(axis=1))


def _unconvincing(felt: Floats, seen: Floats, least: float) -> NDArray[np.bool_]:
    """(places,) where sight would turn touch's choice, and both together are not sure of it.

    Where touch has none, all its characters alike, there is nothing to turn.
    """
    both = felt * seen
    best = both.argmax(axis=1)
    at = np.arange(best.size)
    turned = felt[at, best] < felt.max(axis=1) * (1.0 - 1e-9)
    return np.asarray(turned & (both[at, best] < least * both.sum(axis=1)))


def aligned(touch: Lattice, vision: Lattice) -> list[int | None]:
    """For every place of touch the place of sight that is the same, or None.

    By their boxes where both have them; else by index, if both have as many.
    """
    if not vision.boxes or not touch.boxes:
        same = touch.n_places == vision.n_places
        return [k if same else None for k in range(touch.n_places)]
    here, there = _middles(touch.boxes), _middles(vision.boxes)
    apart = np.hypot(*(here[:, None] - there[None]).transpose(2, 0, 1))
    if len(here) > 1:
        step = float(np.median(np.hypot(*np.diff(here, axis=0).T)))
    else:
        step = 2.0 * (touch.boxes[0].x1_mm - touch.boxes[0].x0_mm)
    out: list[int | None] = [None] * touch.n_places
    for flat in np.argsort(apart, axis=None, kind="stable"):
        k, j = divmod(int(flat), vision.n_places)
        if apart[k, j] > SAME_PLACE_SHARE * step:
            break
        if out[k] is None and j not in out:
            out[k] = j
    return out


def _middles(boxes: Sequence[Box]) -> Floats:
    return np.array([[0.5 * (b.x0_mm + b.x1_mm), 0.5 * (b.y0_mm + b.y1_mm)] for b in boxes])


def _possible(lattice: Lattice, chars: tuple[str, ...], own: Sequence[int | None]) -> NDArray[np.bool_]:
    """(places, chars) what a sense has not ruled out."""
    out = np.zeros((len(own), len(chars)), dtype=np.bool_)
    at = [chars.index(c) for c in lattice.chars]
    for k, j in enumerate(own):
        if j is not None:
            out[k, at] = np.isfinite(lattice.log_belief[j])
    return out


def _factors(
    lattice: Lattice, chars: tuple[str, ...], own: Sequence[int | None], power: float
) -> tuple[Floats, Floats]:
    """(places, chars) belief over that without having looked, and (places,) probability of having read."""
    out = np.ones((len(own), len(chars)))
    read = np.zeros(len(own))
    at = np.array([chars.index(c) for c in lattice.chars], dtype=np.int64)
    for k, j in enumerate(own):
        if j is None:
            continue
        row = lattice.log_belief[j]
        known = np.isfinite(row)
        if not known.any():
            continue
        total = float(np.logaddexp.reduce(row))
        log = power * (row[known] - total)
        share = np.exp(log - np.logaddexp.reduce(log))
        read[k] = min(1.0, float(np.exp(total)))
        out[k, at[known]] = read[k] * share * known.sum() + 1.0 - read[k]
    return out, read
