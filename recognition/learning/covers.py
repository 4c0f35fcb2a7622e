"""Cover the stroke that distinguishes two characters, so that the network learns to leave them undecided.

5  6     with the lower left of either covered, both are possible; the label is still the stamped character, so the
   ##    loss is smallest if the posterior of each is its frequency
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import torch
from torch import Tensor
from torch.nn import functional as f

from recognition.learning.augment import edges_of
from recognition.see.text_line import HEIGHT_ROWS
from recognition.see.view import EDGES, GREY, HEIGHTS, KNOWN

Spot = tuple[float, float, float, float]

_RIVALS: tuple[tuple[str, Spot], ...] = (
    ("38", (0.0, 0.15, 0.45, 0.85)), ("0D", (0.0, 0.0, 0.35, 1.0)), ("B8", (0.0, 0.0, 0.4, 1.0)),
    ("56", (0.0, 0.5, 0.45, 1.0)), ("DO", (0.0, 0.6, 0.35, 1.0)), ("S8", (0.0, 0.45, 0.45, 0.95)),
    ("BE", (0.5, 0.0, 1.0, 1.0)), ("CO", (0.6, 0.25, 1.0, 0.75)), ("C0", (0.6, 0.25, 1.0, 0.75)),
    ("PR", (0.4, 0.5, 1.0, 1.0)), ("FP", (0.5, 0.0, 1.0, 0.6)), ("CG", (0.45, 0.45, 1.0, 1.0)),
    ("OQ", (0.5, 0.6, 1.0, 1.1)), ("OG", (0.5, 0.3, 1.0, 0.9)), ("FE", (0.2, 0.7, 1.0, 1.1)),
    ("UV", (0.0, 0.6, 1.0, 1.05)), ("IL", (0.3, 0.75, 1.0, 1.05)), ("JI", (0.0, 0.6, 0.7, 1.05)),
    ("1I", (0.0, 0.0, 0.45, 0.4)), ("1L", (0.3, 0.75, 1.0, 1.05)), ("27", (0.2, 0.75, 1.0, 1.05)),
    ("DU", (0.0, 0.0, 1.0, 0.3)), ("VY", (0.2, 0.5, 0.8, 1.05)), ("AH", (0.0, 0.0, 1.0, 0.3)),
    ("HN", (0.2, 0.15, 0.8, 0.85)), ("MN", (0.3, 0.0, 0.9, 0.7)), ("XK", (0.0, 0.0, 0.5, 1.0)),
    ("0O", (0.25, 0.2, 0.75, 0.8)), ("49", (0.0, 0.0, 0.6, 0.4)),
)  # fmt: skip
"""Pairs of characters, and where they differ: left, top, right, bottom as shares of a character's box."""
_SPOTS = {
    char: [spot for pair, spot in _RIVALS if char in pair]
    for char in {c for pair, _ in _RIVALS for c in pair}
}


def cover_rivals(
    tall: Tensor,
    texts: Sequence[str],
    places: Sequence[Sequence[tuple[float, float]]],
    *,
    rng: torch.Generator,
    share: float = 0.12,
) -> Tensor:
    """Cover, in place, a share of the strokes that distinguish characters of (n, LAYERS, rows, columns) from rivals."""
    for strip, text, where in zip(tall, texts, places, strict=True):
        for char, (first, last) in zip(text, where, strict=False):
            spots = _SPOTS.get(char.upper())
            if spots and _draw(rng) < share:
                _cover(strip, spots[int(_draw(rng) * len(spots))], first, last, rng)
    return tall


def _draw(rng: torch.Generator) -> float:
    return float(torch.rand(1, generator=rng))


def _cover(strip: Tensor, spot: Spot, first: float, last: float, rng: torch.Generator) -> None:
    rows = strip.shape[1]
    top = (rows - HEIGHT_ROWS) / 2
    grown = 0.12 * (_draw(rng) - 0.3)
    x0, x1 = (first + (last - first) * share for share in (spot[0] - grown, spot[2] + grown))
    y0, y1 = (top + HEIGHT_ROWS * share for share in (spot[1] - grown, spot[3] + grown))
    left, right = max(0, math.floor(x0) - 4), min(strip.shape[2], math.ceil(x1) + 4)
    up, down = max(0, math.floor(y0) - 4), min(rows, math.ceil(y1) + 4)
    if right - left < 6 or down - up < 6:
        return
    soft = 0.5 + 1.5 * _draw(rng)
    x = torch.arange(left, right) + 0.5
    y = (torch.arange(up, down) + 0.5)[:, None]
    ragged = 2.0 * _smooth((down - up, right - left), 5, "bilinear", rng)
    inside = torch.minimum(torch.minimum(x - x0, x1 - x), torch.minimum(y - y0, y1 - y)) + ragged
    mask = torch.sigmoid(inside / soft)
    part = strip[:, up:down, left:right]
    kind = _draw(rng)
    if kind < 0.12:
        part *= (mask < 0.5).float()
        return
    part[HEIGHTS] *= 1 - mask
    part[EDGES:KNOWN] *= 1 - mask
    if kind < 0.7:
        _add_lump(part, mask, rng)
    grey = part[GREY]
    if bool(grey.any()):
        shade = float(strip[GREY].mean()) * (0.3 + 1.4 * _draw(rng))
        texture = 0.08 * _draw(rng) * torch.randn(mask.shape, generator=rng)
        part[GREY] = (grey * (1 - mask) + (shade + texture) * mask).clamp(0, 1) * part[KNOWN]


def _add_lump(part: Tensor, mask: Tensor, rng: torch.Generator) -> None:
    rough = _smooth((mask.shape[0], mask.shape[1]), 4, "bicubic", rng)
    height = 0.02 * math.exp(0.8 * float(torch.randn(1, generator=rng)))
    lump = height * mask * (1 + 0.4 * rough) * part[KNOWN]
    if bool(part[HEIGHTS].any()):
        part[HEIGHTS] += lump
    if bool(part[EDGES:KNOWN].any()):
        have = (part[EDGES:KNOWN].abs().amax(dim=(1, 2), keepdim=True) > 0).float()
        part[EDGES:KNOWN] += edges_of(lump[None, None])[0] * have


def _smooth(size: tuple[int, int], cell: int, mode: str, rng: torch.Generator) -> Tensor:
    coarse = torch.randn(1, 1, *(max(2, n // cell) for n in size), generator=rng)
    return f.interpolate(coarse, size=size, mode=mode)[0, 0]
