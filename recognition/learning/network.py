"""The recogniser's network: a strip of a line in, beliefs along it out.

    strip (LAYERS, ROWS, W) -> drawn -> 5x5 /2 -> 3x3 x2 -> /2 -> 3x3 x2 -> /2 down -> 3x3 x2 -> one row
        -> 5 along x2 -> 2 steps a column

The first step is part of the network: layers are flattened and bounded here, so what trains and what reads cannot draw
differently. Needs torch (extra `train`); reading needs onnxruntime alone.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn
from torch.nn import functional as f

from recognition.views.text_line import HEIGHT_ROWS
from recognition.views.view import EDGES, GREY, HEIGHTS, KNOWN, LAYERS

_RELIEF_HALF, _EDGE_HALF, _GREY_HALF = 0.02, 0.2, 1.0
"""What is drawn half way to 1: heights in character heights, enhancement, brightness in spreads of what lies around."""
_BROAD = 0.4
"""Sigma, character heights: what is broader is the plate, not the mark."""
_COARSENESS = 6
"""Of the pixels that it is blurred in: so many to a character."""
STEPS = 4
"""Columns of a strip are a multiple of this."""


class Drawn(nn.Module):
    """Layers flattened and bounded: a lump of dirt does not hide the mark beside it."""

    def __init__(self, height_rows: int = HEIGHT_ROWS) -> None:
        super().__init__()
        self.coarse = max(1, height_rows // _COARSENESS)
        sigma = _BROAD * height_rows / self.coarse
        reach = math.ceil(2.5 * sigma)
        at = torch.arange(-reach, reach + 1, dtype=torch.float32)
        bell = torch.exp(-0.5 * (at / sigma) ** 2)
        bell = torch.outer(bell, bell)
        self.register_buffer("bell", (bell / bell.sum())[None, None].repeat(3, 1, 1, 1), persistent=False)
        self.reach = reach

    def _broad(self, x: Tensor) -> Tensor:
        """Blurred, by way of coarser pixels; three layers at most."""
        small = f.avg_pool2d(x, self.coarse)
        small = f.conv2d(small, self.bell[: x.shape[1]], padding=self.reach, groups=x.shape[1])
        return f.interpolate(small, scale_factor=self.coarse, mode="bilinear")

    def forward(self, strip: Tensor) -> Tensor:
        """(n, LAYERS, rows, columns) to the same shape, each layer within -1 and 1."""
        known = strip[:, KNOWN : KNOWN + 1]
        surfaces = strip[:, HEIGHTS : GREY + 1] * known
        blurred = self._broad(torch.cat([surfaces, known], dim=1))
        weight = blurred[:, 2:].clamp(min=1e-3)
        flat = (surfaces - blurred[:, :2] / weight) * known
        heights, grey = flat[:, :1], flat[:, 1:]
        spread = (self._broad(grey * grey) / weight + 1e-6).sqrt()
        return torch.cat(
            [
                _bounded(heights, _RELIEF_HALF),
                _bounded(grey / spread, _GREY_HALF),
                _bounded(strip[:, EDGES:KNOWN], _EDGE_HALF),
                known,
            ],
            dim=1,
        )


def _bounded(x: Tensor, half: float) -> Tensor:
    return x / (x.abs() + half)


class Conv(nn.Sequential):
    """A convolution that keeps the size, normalised and cut at 0."""

    def __init__(self, into: int, out: int, size: int | tuple[int, int] = 3, **options: object) -> None:
        padding = size // 2 if isinstance(size, int) else (0, size[1] // 2)
        super().__init__(
            nn.Conv2d(into, out, size, padding=padding, bias=False, **options),  # type: ignore[arg-type]
            nn.BatchNorm2d(out),
            nn.ReLU(inplace=True),
        )


class _Again(nn.Module):
    """A convolution over what is there, added to it."""

    def __init__(self, channels: int, size: int | tuple[int, int] = 3) -> None:
        super().__init__()
        self.conv = Conv(channels, channels, size)

    def forward(self, x: Tensor) -> Tensor:
        return x + self.conv(x)


class Recogniser(nn.Module):
    """Beliefs along a strip.

    Args:
        classes: blank and characters.
        width: of the first layers; the others grow with it.
    """

    def __init__(self, classes: int, *, width: int = 48) -> None:
        super().__init__()
        w, self.classes = width, classes
        self.drawn = Drawn()
        self.body = nn.Sequential(
            Conv(LAYERS, w // 2, 5, stride=2),
            Conv(w // 2, w), nn.MaxPool2d(2),
            _Again(w), _Again(w),
            Conv(w, 2 * w), _Again(2 * w), nn.MaxPool2d((2, 1)),
            Conv(2 * w, 3 * w), _Again(3 * w),
            Conv(3 * w, 5 * w, (5, 1)), nn.Dropout(0.1),
            _Again(5 * w, (1, 5)), _Again(5 * w, (1, 5)),
        )  # fmt: skip
        self.head = nn.Conv2d(5 * w, 2 * classes, 1)

    def forward(self, strip: Tensor) -> Tensor:
        """(n, LAYERS, ROWS, columns) to (n, steps, classes), the logarithms of beliefs; a step is 2 columns."""
        return self.read(self.drawn(strip))

    def read(self, drawn: Tensor) -> Tensor:
        """The same, of a strip that is drawn."""
        x = self.head(self.body(drawn))
        n, _, _, steps = x.shape
        x = x.reshape(n, self.classes, 2, steps).permute(0, 3, 2, 1).reshape(n, 2 * steps, self.classes)
        return x.float().log_softmax(dim=2)
