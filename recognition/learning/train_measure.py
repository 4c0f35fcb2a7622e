"""Accuracy of a network on strips of known text: the best class of every step, no format."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from rapidfuzz.distance import Levenshtein

from recognition.experts.recogniser import CHARACTERS
from recognition.learning.network import COLUMNS, Recogniser
from recognition.learning.training_samples import TALL_ROWS, WIDE_MARGIN, TrainingStrip
from recognition.views.text_line import HEIGHT_ROWS, MARGIN, ROWS

Measured = dict[str, tuple[int, int, int]]


def plain(strip: TrainingStrip) -> NDArray[np.float32]:
    """A strip as it is cut for reading, (LAYERS, ROWS, columns)."""
    tall = strip.layers.astype(np.float32)
    up = (TALL_ROWS - ROWS) // 2
    cut = round((WIDE_MARGIN - MARGIN) * HEIGHT_ROWS)
    tall = tall[:, up : up + ROWS, cut : tall.shape[2] - cut]
    return np.pad(tall, ((0, 0), (0, 0), (0, -tall.shape[2] % COLUMNS)))


def decode(beliefs: NDArray[np.float32]) -> str:
    """The best class of every step, (steps, classes), repeats and blanks left out."""
    best = beliefs.argmax(axis=1)
    kept = [k for k, before in zip(best, [0, *best[:-1]], strict=True) if k and k != before]
    return "".join(CHARACTERS[k - 1] for k in kept).strip()


@torch.no_grad()
def measure(network: Recogniser, strips: Sequence[TrainingStrip]) -> Measured:
    """Characters, mistakes and lines by source and severity; spaces do not count."""
    network.eval()
    found: dict[str, list[int]] = defaultdict(lambda: [0, 0, 0])
    for strip in strips:
        said = decode(
            network(torch.from_numpy(plain(strip))[None].to(network.drawn.bell.device))[0].cpu().numpy()
        ).replace(" ", "")
        text = strip.text.replace(" ", "")
        dirt = (
            "clean" if strip.severity == 0 else f"{min(0.9, 0.3 * round(strip.severity / 0.3 + 0.001)):.1f}"
        )
        for key in (f"{strip.source} {dirt}", strip.source, "all"):
            for k, value in enumerate((len(text), Levenshtein.distance(text, said), 1)):
                found[key][k] += value
    network.train()
    return {key: (n, wrong, lines) for key, (n, wrong, lines) in sorted(found.items())}


def shares(found: Measured, digits: int) -> dict[str, str]:
    """Characters that are right, in words."""
    return {key: f"{100 * (1 - wrong / n):.{digits}f} % of {n}" for key, (n, wrong, _) in found.items()}
