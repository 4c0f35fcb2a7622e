"""Calibration of the recogniser on single characters, covered and not, of fonts and soils that it never saw::

    python tests/benchmarks/cover_reliability.py FONTS ... --parts 150 --seed 500 --out covers.svg

FONTS are folders; of them the held-out families alone. Parts have the soils that nothing learns from, and half of the
strips get a cover over the stroke that tells each of their characters from another (`covers`). Of every place the
posterior of the likeliest character is held against how often it is right. Prints a table in Markdown, and draws it.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch

from glyphs.errors import MarksError
from pipeline.benchmark.exam.design import design_named
from recognition.learning.covers import cover_rivals
from recognition.learning.train_recogniser import crop_for_reading, gather
from recognition.learning.training_fonts import find_fonts
from recognition.learning.training_parts import draw_part
from recognition.learning.training_samples import TrainingStrip, strips_of
from recognition.recogniser.recogniser import CHARACTERS, posteriors, steps_of

SOILS = design_named("marks-exam-1-1600").kept_out_soils
"""That nothing in this tree learns from."""
_EDGES = np.array([0.0, 0.5, 0.8, 0.9, 0.97, 1.0001])
"""Edges of the bins of posteriors."""
_CHARS = CHARACTERS[:36]


@dataclass(frozen=True)
class Place:
    """A place of a line: how sure the recogniser is of its likeliest character, whether that stands there."""

    source: str
    covered: bool
    sure: float
    right: bool


def read_places(strips: Sequence[TrainingStrip], *, covered: bool) -> Iterator[Place]:
    """Posteriors of the capitals and figures of strips, the number of places known."""
    for strip in strips:
        chars = [c for c in strip.text.upper() if c != " "]
        if not all(c in _CHARS for c in chars):
            continue
        steps = steps_of(posteriors(crop_for_reading(strip)), chars=_CHARS)
        found = steps.places((_CHARS,) * len(chars))
        for char, log in zip(chars, found.log_belief if found is not None else (), strict=False):
            best = int(log.argmax())
            yield Place(strip.source, covered, float(np.exp(log[best])), _CHARS[best] == char)


def cover(strips: Sequence[TrainingStrip], *, seed: int) -> list[TrainingStrip]:
    """The strips with a cover over every character that has a rival."""
    rng = torch.Generator().manual_seed(seed)
    made = []
    for strip in strips:
        tall, _ = gather([strip])
        cover_rivals(tall, [strip.text], [strip.places], rng=rng, share=1.0)
        made.append(replace(strip, layers=tall[0].numpy().astype(np.float16)))
    return made


def table(places: Sequence[Place]) -> str:
    """Rows of source and cover, a column for each bin: share right, mean posterior and number of places."""
    bins = list(itertools.pairwise(_EDGES))
    head = ["places", "all", *(f"{low:g} to {min(high, 1.0):g}" for low, high in bins)]
    lines = [f"| {' | '.join(head)} |", "|---" * len(head) + "|"]
    for source in sorted({p.source for p in places}):
        for covered in (False, True):
            own = [p for p in places if (p.source, p.covered) == (source, covered)]
            cells = [_cell(own), *(_cell([p for p in own if low <= p.sure < high]) for low, high in bins)]
            lines.append(f"| {source}{', covered' if covered else ''} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _cell(places: Sequence[Place]) -> str:
    if not places:
        return "none"
    right, sure = np.mean([p.right for p in places]), np.mean([p.sure for p in places])
    return f"{100 * right:.1f} % right at {100 * sure:.1f} ({len(places):,})"


def draw(places: Sequence[Place], out: Path) -> None:
    """The reliability diagram, a panel for each source."""
    import matplotlib.pyplot as plt

    sources = sorted({p.source for p in places})
    figure, panels = plt.subplots(
        1, len(sources), figsize=(3.4 * len(sources), 3.4), sharey=True, squeeze=False
    )
    for panel, source in zip(panels[0], sources, strict=True):
        panel.plot([0, 1], [0, 1], color="0.7", linewidth=1)
        for covered, colour in ((False, "tab:blue"), (True, "tab:orange")):
            own = [p for p in places if (p.source, p.covered) == (source, covered)]
            edges = np.linspace(0.0, 1.0001, 9)
            groups = [[p for p in own if a <= p.sure < b] for a, b in itertools.pairwise(edges)]
            shown = [
                (np.mean([p.sure for p in g]), np.mean([p.right for p in g])) for g in groups if len(g) >= 10
            ]
            if shown:
                panel.plot(
                    *zip(*shown, strict=True), "o-", color=colour, label="covered" if covered else "as it is"
                )
        panel.set(title=source, xlabel="posterior of the likeliest", xlim=(0, 1), ylim=(0, 1))
    panels[0][0].set_ylabel("share right")
    panels[0][0].legend(frameon=False)
    figure.tight_layout()
    figure.savefig(out)


def main(*folders: Path, parts: int = 150, seed: int = 500, out: Path) -> None:
    """Draw parts, cover them, read them, print and draw the result.

    Args:
        folders: of TrueType or OpenType files.
        parts: how many.
        seed: of the parts.
        out: picture, SVG or PNG.
    """
    fonts = find_fonts(folders).held_out
    places: list[Place] = []
    for k in range(parts):
        rng = np.random.default_rng((seed, k))
        try:
            strips = strips_of(draw_part(fonts, rng, soils=SOILS))
        except (MarksError, ValueError):  # drawn at random, some things cannot be
            continue
        strips = [s for s in strips if s.places]
        places += read_places(strips, covered=False)
        places += read_places(cover(strips, seed=seed + k), covered=True)
    print(table(places))
    draw(places, out)


if __name__ == "__main__":
    from cyclopts import run

    run(main)
