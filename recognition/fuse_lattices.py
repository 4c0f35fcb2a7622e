"""Beliefs of touch and sight made one, place by place.

    p(c) ~ f_touch(c) f_sight(c)      f(c) = (what a sense believes of c) / (what it would believe had it not looked)

A sense looked at a place with the probability that its lattice gives to all characters there together; with the
rest it says nothing, f = 1 for every character. What it never considered (by its format) it says nothing of either.
So the prior, every character alike, is counted once, and a sense that did not read changes nothing.

Sight is tempered: its beliefs to a power, a share of them given up, and all of it doubted where the senses
contradict each other place after place, as they do when sight has taken something else for the line.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recognition.lattice import Lattice
from recognition.reading import Box

SAME_PLACE_SHARE = 0.5
"""Of the usual step between characters, how far a place seen may lie from the one felt that it belongs to."""

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Reliability:
    """How far a sense's beliefs are trusted.

    Attributes:
        power: to which its beliefs are taken; under 1 where it is too sure of itself.
        wrong_place: probability that a place's belief is about something else.
        wrong_line: probability that the whole line's is.

    Raises:
        ValueError: numbers out of range.
    """

    power: float = 1.0
    wrong_place: float = 0.0
    wrong_line: float = 0.0

    def __post_init__(self) -> None:
        if not 0.0 <= self.power <= 10.0 or not all(0.0 <= p < 1.0 for p in (self.wrong_place, self.wrong_line)):
            raise ValueError(f"{self} has numbers out of range; power is 0 to 10, the others are 0 up to below 1")


SIGHT_ALONE = Reliability(power=0.7, wrong_place=0.05, wrong_line=0.2)
"""Of a reader of photographs."""
SIGHT_AT_TOUCH = Reliability(power=0.7, wrong_place=0.03, wrong_line=0.05)
"""Of sight asked at the places of touch."""


def fuse_lattices(
    touch: Lattice,
    sight: Lattice,
    *,
    sight_boxes: Sequence[Box] | None = None,
    reliability: Reliability = SIGHT_ALONE,
) -> Lattice:
    """The product of both senses' beliefs at the places of touch.

    Args:
        touch: posteriors; its places, boxes and gaps are the outcome's.
        sight: posteriors.
        sight_boxes: boxes of sight's places brought to the plate frame; sight's own unless given.
        reliability: of sight.

    Returns:
        Beliefs over the characters of either. What neither has read is "nothing readable".

    Raises:
        ValueError: boxes that are not one a place.
    """
    own = aligned(touch, sight, sight_boxes)
    chars = (*touch.chars, *(c for c in sight.chars if c not in touch.chars))
    felt, felt_read = _factors(touch, chars, list(range(touch.n_places)), Reliability())
    seen, seen_read = _factors(sight, chars, own, reliability)
    possible = _possible(touch, chars, list(range(touch.n_places))) | _possible(sight, chars, own)
    prior = possible / np.maximum(possible.sum(axis=1, keepdims=True), 1)
    if reliability.wrong_line > 0.0:
        # how much better touch is foretold by sight than by nothing
        agreement = float(np.log(np.maximum((prior * felt * seen).sum(axis=1), 1e-300)).sum())
        against = float(np.log(np.maximum((prior * felt).sum(axis=1), 1e-300)).sum())
        odds = np.log(1.0 / reliability.wrong_line - 1.0) + agreement - against
        trust = 1.0 / (1.0 + np.exp(-np.clip(odds, -50.0, 50.0)))
        seen = trust * seen + (1.0 - trust)
        seen_read = trust * seen_read
    with np.errstate(divide="ignore"):
        log = np.log(prior) + np.log(felt) + np.log(seen)
        total = np.logaddexp.reduce(log, axis=1)
        read = 1.0 - (1.0 - felt_read) * (1.0 - seen_read)
        log = np.where(np.isfinite(total)[:, None], log - total[:, None], -np.inf) + np.log(read)[:, None]
    return Lattice(chars, np.minimum(log, 0.0), boxes=touch.boxes, spaces_after=touch.spaces_after)


def tempered(lattice: Lattice, reliability: Reliability) -> Lattice:
    """What is left of a sense's beliefs after doubt of it."""
    places = list(range(lattice.n_places))
    factor, read = _factors(lattice, lattice.chars, places, reliability)
    possible = _possible(lattice, lattice.chars, places)
    share = np.where(possible, factor, 0.0)
    share /= np.maximum(share.sum(axis=1, keepdims=True), 1e-300)
    with np.errstate(divide="ignore"):
        log = np.log(share) + np.log(read)[:, None]
    return Lattice(lattice.chars, np.minimum(log, 0.0), boxes=lattice.boxes, spaces_after=lattice.spaces_after)


def aligned(touch: Lattice, sight: Lattice, sight_boxes: Sequence[Box] | None = None) -> list[int | None]:
    """For every place of touch the place of sight that is the same, or None.

    By their boxes where both have them; else by index, if both have as many.

    Raises:
        ValueError: boxes that are not one a place.
    """
    boxes = tuple(sight_boxes) if sight_boxes is not None else sight.boxes
    if boxes and len(boxes) != sight.n_places:
        raise ValueError(f"{len(boxes)} boxes for {sight.n_places} places of sight")
    if not boxes or not touch.boxes:
        same = touch.n_places == sight.n_places
        return [k if same else None for k in range(touch.n_places)]
    here, there = _middles(touch.boxes), _middles(boxes)
    apart = np.hypot(*(here[:, None] - there[None]).transpose(2, 0, 1))
    if len(here) > 1:
        step = float(np.median(np.hypot(*np.diff(here, axis=0).T)))
    else:
        step = 2.0 * (touch.boxes[0].x1_mm - touch.boxes[0].x0_mm)
    out: list[int | None] = [None] * touch.n_places
    for flat in np.argsort(apart, axis=None, kind="stable"):
        k, j = divmod(int(flat), sight.n_places)
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
    lattice: Lattice, chars: tuple[str, ...], own: Sequence[int | None], reliability: Reliability
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
        total = np.logaddexp.reduce(row) if known.any() else -np.inf
        if total == -np.inf:
            continue
        log = reliability.power * (row[known] - total)
        share = np.exp(log - np.logaddexp.reduce(log))
        read[k] = min(1.0, float(np.exp(total))) * (1.0 - reliability.wrong_place)
        out[k, at[known]] = read[k] * share * known.sum() + 1.0 - read[k]
    return out, read
