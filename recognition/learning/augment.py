"""Augmentation of strips: another crop, size, slant and bend, lost scan lines, spots, inverted brightness."""

from __future__ import annotations

import math

import torch
from torch import Tensor
from torch.nn import functional as f

from recognition.learning.network import COLUMNS
from recognition.recogniser.recogniser import WIDER
from recognition.see.text_line import HEIGHT_ROWS, ROWS
from recognition.see.view import EDGES, GREY, HEIGHTS, KNOWN


def augment(tall: Tensor, columns: Tensor, *, rng: torch.Generator) -> Tensor:
    """Crop augmented strips (n, LAYERS, ROWS, columns') out of taller ones; columns' is a multiple of `COLUMNS`."""
    return add_noise(_crop_again(tall, columns, rng), rng=rng)


def add_noise(strips: Tensor, *, rng: torch.Generator) -> Tensor:
    """Add lumps, gaps and noise to strips or views, (n, LAYERS, rows, columns)."""
    n = strips.shape[0]
    felt = (strips[:, EDGES:KNOWN].abs().amax(dim=(1, 2, 3)) > 0).float()
    strips = _add_lumps(strips, felt, rng)
    strips = _drop_data(strips, felt, rng)
    grey = strips[:, GREY]
    seen = (grey.amax(dim=(1, 2), keepdim=True) > 0).float() * strips[:, KNOWN]
    inverted = (torch.rand(n, 1, 1, generator=rng) < 0.5).float()
    power = torch.exp(0.4 * torch.randn(n, 1, 1, generator=rng))
    grey = grey.clamp(0.0, 1.0) ** power
    strips[:, GREY] = (inverted * (1.0 - grey) + (1.0 - inverted) * grey) * seen
    # noise on every layer that the strip has
    size = torch.exp(torch.randn(n, 1, 1, 1, generator=rng) - 1.0)
    noise = torch.randn(strips[:, :KNOWN].shape, generator=rng) * size
    there = (strips[:, :KNOWN].abs().amax(dim=(2, 3), keepdim=True) > 0).float()
    spread = torch.tensor([0.004, 0.02, 0.03, 0.03, 0.03, 0.03]).reshape(1, -1, 1, 1)
    strips[:, :KNOWN] += noise * spread * there * strips[:, KNOWN:]
    return strips


def _crop_again(
    tall: Tensor, columns: Tensor, rng: torch.Generator, *, size: tuple[float, float] = (0.08, 0.16)
) -> Tensor:
    # size: spread of the logarithm of the line height, felt and photographed: in photographs it is found less exactly.
    n, _, rows, wide = tall.shape
    seen = (tall[:, GREY].amax(dim=(1, 2)) > 0).float().reshape(n, 1, 1)

    def draw(spread: float | Tensor, *, normal: bool = True) -> Tensor:
        drawn = torch.randn(n, 1, 1, generator=rng) if normal else 2 * torch.rand(n, 1, 1, generator=rng) - 1
        return spread * drawn

    high = torch.exp(draw(size[0] + (size[1] - size[0]) * seen))
    wider = torch.exp(draw(0.14)) * high / WIDER
    before = (0.4 + draw(0.36, normal=False)) * HEIGHT_ROWS  # columns of the margin to cut off
    after = (0.4 + draw(0.36, normal=False)) * HEIGHT_ROWS
    width = columns.reshape(n, 1, 1).float()
    needed = ((width - before - after) / wider).clamp(min=16.0)
    out = int(
        math.ceil(float(needed.max()) / (3 * COLUMNS)) * 3 * COLUMNS
    )  # few different shapes: a kernel is made for each
    v = (torch.arange(ROWS).float() + 0.5 - ROWS / 2).reshape(1, ROWS, 1)
    u = (torch.arange(out).float() + 0.5).reshape(1, 1, out)
    along = u / needed - 0.5
    bend = draw(0.06) * HEIGHT_ROWS * (4 * along * along - 0.5) + torch.tan(draw(0.02)) * (u - needed / 2)
    down = v * high + bend + draw(0.06) * HEIGHT_ROWS
    right = before + u * wider + draw(0.12) * v
    # a few pixels of smooth displacement
    shift = torch.randn(n, 2, 4, 12, generator=rng) * draw(0.6).abs().unsqueeze(1)
    shift = f.interpolate(shift, size=(ROWS, out), mode="bicubic", align_corners=True)
    y = (down + shift[:, 0] + rows / 2) * 2 / rows - 1
    x = (right + shift[:, 1]) * 2 / wide - 1
    strips = f.grid_sample(tall, torch.stack([x, y], dim=-1), mode="bilinear", align_corners=False)
    return strips * ((u < needed) & (right < width)).float().unsqueeze(1)


def _drop_data(strips: Tensor, felt: Tensor, rng: torch.Generator) -> Tensor:
    n, _, rows, columns = strips.shape

    def happens(share: float, *shape: int) -> Tensor:
        return (torch.rand(n, *shape, 1, 1, generator=rng) < share).float()

    felt_ways = torch.ones(n, 4, 1, 1)
    felt_ways *= 1 - happens(0.3, 1) * happens(0.4, 4)
    felt_ways *= 1 - happens(0.15, 1)  # heights alone, as from an instrument
    strips[:, EDGES:KNOWN] *= felt_ways
    none = (felt_ways.amax(dim=1, keepdim=True) == 0).float()
    strips[:, HEIGHTS : HEIGHTS + 1] *= 1 - happens(0.12, 1) * (1 - none) * felt.reshape(n, 1, 1, 1)
    missing = happens(0.1, 1) * (torch.rand(n, 1, rows, 1, generator=rng) < 0.12).float()
    spots = torch.randn(n, 1, 6, max(4, columns // 8), generator=rng)
    spots = f.interpolate(spots, size=(rows, columns), mode="bilinear")
    hidden = happens(0.25, 1) * (spots > 1.0 + torch.rand(n, 1, 1, 1, generator=rng)).float()
    known = (1 - missing) * (1 - hidden)
    return strips * known


def _add_lumps(strips: Tensor, felt: Tensor, rng: torch.Generator) -> Tensor:
    n, _, rows, columns = strips.shape
    fine = int(torch.randint(2, 7, (1,), generator=rng))
    lumps = torch.randn(n, 1, max(2, rows // fine), max(4, columns // fine), generator=rng)
    lumps = f.interpolate(lumps, size=(rows, columns), mode="bicubic", align_corners=False)
    least = 1.2 * torch.rand(n, 1, 1, 1, generator=rng) + 0.3
    size = torch.exp(0.8 * torch.randn(n, 1, 1, 1, generator=rng)) * 0.02
    sign = torch.where(torch.rand(n, 1, 1, 1, generator=rng) < 0.7, 1.0, -1.0)
    happens = (torch.rand(n, 1, 1, 1, generator=rng) < 0.35).float()
    pile = happens * sign * size * (lumps - least).clamp(min=0.0) * strips[:, KNOWN:]
    there = (strips[:, HEIGHTS : HEIGHTS + 1].abs().amax(dim=(2, 3), keepdim=True) > 0).float()
    strips[:, HEIGHTS : HEIGHTS + 1] += pile * there
    have = (strips[:, EDGES:KNOWN].abs().amax(dim=(2, 3), keepdim=True) > 0).float()
    strips[:, EDGES:KNOWN] += edges_of(pile) * have * strips[:, KNOWN:] * felt.reshape(n, 1, 1, 1)
    return strips


def edges_of(pile: Tensor, *, preload: float = 0.2) -> Tensor:
    """(n, 4, rows, columns) edges that a tip would feel on heights; a lift of `preload` doubles the moment."""
    dx = f.pad(pile[..., 2:] - pile[..., :-2], (1, 1)) * HEIGHT_ROWS / 2
    dy = f.pad(pile[:, :, 2:] - pile[:, :, :-2], (0, 0, 1, 1)) * HEIGHT_ROWS / 2
    lift = pile / preload
    edges = torch.cat([lift + 0.7 * dx, lift + 0.7 * dy, lift - 0.7 * dx, lift - 0.7 * dy], dim=1)
    return edges.clamp(-3, 3)
