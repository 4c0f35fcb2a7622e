"""The recogniser's network: a strip of a line in, posteriors along it out. Training needs torch (extra `train`).

strip (LAYERS, ROWS, W) -> normalise -> 1x1, three channels -> 1.2 times as large -> body of PP-OCRv6 -> head
    -> a step for every 20 / 3 columns
"""

from __future__ import annotations

import math
import re

import torch
from torch import Tensor, nn
from torch.nn import functional as f

from recognition.learning.public_start import ROWS as PICTURE_ROWS
from recognition.learning.public_start import PublicStart
from recognition.see.text_line import HEIGHT_ROWS
from recognition.see.view import EDGES, GREY, HEIGHTS, KNOWN, LAYERS

_BROAD = 0.4
"""Sigma of the blur that is subtracted, character heights: broader structures belong to the plate, not the mark."""
_COARSENESS = 6
"""Pixels per character height at which layers are blurred."""
COLUMNS = 20
"""Columns of a strip are a multiple of this, which is 24 columns of the picture and three steps."""


class Normalise(nn.Module):
    """Subtract the broad shape from layers and bound them: a lump of dirt then does not hide the mark beside it."""

    def __init__(self, height_rows: int = HEIGHT_ROWS) -> None:
        super().__init__()
        self.coarse = max(1, height_rows // _COARSENESS)
        sigma = _BROAD * height_rows / self.coarse
        reach = math.ceil(2.5 * sigma)
        steps = torch.arange(-reach, reach + 1, dtype=torch.float32)
        bell = torch.exp(-0.5 * (steps / sigma) ** 2)
        self.register_buffer("bell", (bell / bell.sum()).repeat(3, 1, 1, 1), persistent=False)
        self.reach = reach

    def _blur(self, x: Tensor) -> Tensor:
        small = f.avg_pool2d(x, self.coarse)
        bell = self.bell[: x.shape[1]]
        small = f.conv2d(small, bell.transpose(2, 3), padding=(self.reach, 0), groups=x.shape[1])
        small = f.conv2d(small, bell, padding=(0, self.reach), groups=x.shape[1])
        return f.interpolate(small, scale_factor=self.coarse, mode="bilinear")

    def forward(
        self, strip: Tensor, *, relief_half: float = 0.02, edge_half: float = 0.2, grey_half: float = 1.0
    ) -> Tensor:
        """Normalise each layer of (n, LAYERS, rows, columns) to -1 to 1; these values become one half."""
        known = strip[:, KNOWN : KNOWN + 1]
        surfaces = strip[:, HEIGHTS : GREY + 1] * known
        blurred = self._blur(torch.cat([surfaces, known], dim=1))
        weight = blurred[:, 2:].clamp(min=1e-3)
        flat = (surfaces - blurred[:, :2] / weight) * known
        heights, grey = flat[:, :1], flat[:, 1:]
        spread = (self._blur(grey * grey) / weight + 1e-6).sqrt()
        return torch.cat(
            [
                _squash(heights, relief_half),
                _squash(grey / spread, grey_half),
                _squash(strip[:, EDGES:KNOWN], edge_half),
                known,
            ],
            dim=1,
        )


def _squash(x: Tensor, half: float) -> Tensor:
    return x / (x.abs() + half)


class Recogniser(nn.Module):
    """Network that returns log posteriors along a strip; the blank comes before its characters."""

    def __init__(self, start: PublicStart, characters: str) -> None:
        super().__init__()
        self.normalise = Normalise()
        self.first = nn.Conv2d(LAYERS, 3, 1)
        with torch.no_grad():
            self.first.weight.zero_()
            self.first.weight[:, [HEIGHTS, GREY]] = 1.0
            self.first.bias.zero_()  # type: ignore[union-attr]
        self.body = start.body
        self.head = start.head(characters)

    def forward(self, strip: Tensor) -> Tensor:
        """(n, LAYERS, ROWS, columns) to (n, steps, 1 + characters); columns are a multiple of `COLUMNS`."""
        return self.read(self.normalise(strip))

    def read(self, normal: Tensor) -> Tensor:
        rows, columns = normal.shape[2:]
        size = (PICTURE_ROWS, columns * PICTURE_ROWS // rows)
        picture = f.interpolate(self.first(normal), size=size, mode="bilinear", align_corners=False)
        return self.head(self.body(picture)).float().log_softmax(dim=2)

    def early(self, *, early: int = 40) -> list[nn.Parameter]:
        """Weights that respond to edges and strokes, not characters: the first two thirds of the convolutions."""
        weights_of_edges = [*self.first.parameters()]
        for name, weights in self.body.named_parameters():
            number = re.fullmatch(r"Conv/(\d+)\.weight", name)
            if (number and int(number[1]) < early) or (number is None and weights.ndim == 4):
                weights_of_edges.append(weights)
        return weights_of_edges

    def train(self, mode: bool = True) -> Recogniser:
        """Switch the mode as torch does, but keep the statistics of normalisation learned from print."""
        super().train(mode)
        for module in self.body.modules():
            if isinstance(module, nn.BatchNorm2d):
                module.eval()
        return self
