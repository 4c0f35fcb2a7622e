"""The network that finds lines: for a view at one scale, whether each cell lies in the middle of a line.

view (LAYERS, rows, columns), characters about FINDER_ROWS high -> cells of CELL x CELL pixels, FINDINGS of each:

0  middle      logit: within a quarter of a height of a line's middle
1  height      of the characters over FINDER_ROWS, octaves
2  turned      rotation of the line there, radians from +x towards +y
3  down        from the cell to the line's middle, character heights
"""

from __future__ import annotations

from torch import Tensor, nn

from recognition.find.finder import FINDER_ROWS
from recognition.learning.network import Normalise
from recognition.see.view import LAYERS

FINDINGS = 4
_DILATIONS = (1, 2, 4, 1, 2)


class Conv(nn.Sequential):
    """A convolution that keeps the size, with normalisation and ReLU."""

    def __init__(self, into: int, out: int, size: int = 3, *, stride: int = 1, dilation: int = 1) -> None:
        padding = dilation * (size // 2)
        super().__init__(
            nn.Conv2d(into, out, size, stride=stride, padding=padding, dilation=dilation, bias=False),
            nn.BatchNorm2d(out),
            nn.ReLU(inplace=True),
        )


class _Dilated(nn.Module):
    def __init__(self, channels: int, dilation: int) -> None:
        super().__init__()
        self.conv = Conv(channels, channels, dilation=dilation)

    def forward(self, x: Tensor) -> Tensor:
        return x + self.conv(x)


class Finder(nn.Module):
    """Network that returns the findings of every cell."""

    def __init__(self, *, width: int = 48) -> None:
        super().__init__()
        self.normalise = Normalise(FINDER_ROWS)
        self.body = nn.Sequential(
            Conv(LAYERS, width // 2, 5, stride=2),
            Conv(width // 2, width, 3, stride=2),
            *(_Dilated(width, dilation) for dilation in _DILATIONS),
        )
        self.head = nn.Conv2d(width, FINDINGS, 1)

    def forward(self, view: Tensor) -> Tensor:
        """(n, LAYERS, rows, columns), multiples of CELL, to (n, FINDINGS, rows / CELL, columns / CELL)."""
        return self.read(self.normalise(view))

    def read(self, normal: Tensor) -> Tensor:
        outputs: Tensor = self.head(self.body(normal)).float()
        return outputs
