"""What matching costs against the matrix products that it stands for, on one core.

    OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 NUMBA_NUM_THREADS=1 python tests/benchmarks/matching.py

The search scores every template at every place of a line, the second look every template at every small shift of a
cell, the leaders leaning and turned as well. As matrix products these are (windows x pixels) (pixels x templates) in
single precision, one for the search and one a cell. Both are timed on the line that the reading benchmark reads: the
scores, and numpy's products of matrices of just these sizes, which it finds written out and need not normalise.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from one_core import HEIGHT_MM, TEXT, a_scan

from glyphs.fonts.outlines import load_font
from recognition import refine
from recognition.match import dense_scores, search_templates
from recognition.refine import fine_templates, refine_line
from recognition.search import Hypothesis, LineSearch
from recognition.templates import TemplateCache
from whisker_array.estimation.edges import edge_map

ALPHABET = "ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789"
ROUNDS = 40


class Compared(NamedTuple):
    """Least times of the scores and of the plain product of their size.

    Attributes:
        name: which scores.
        products: how many products they are.
        windows, pixels, templates: sizes of each.
        scores_s, product_s: least times.
    """

    name: str
    products: int
    windows: int
    pixels: int
    templates: int
    scores_s: float
    product_s: float

    @property
    def ratio(self) -> float:
        """Of the scores to the product."""
        return self.scores_s / self.product_s


def least_s(do: Callable[[], object]) -> float:
    """Least time of many rounds: other work only adds."""
    do()
    times = []
    for _ in range(ROUNDS):
        start = time.perf_counter()
        do()
        times.append(time.perf_counter() - start)
    return min(times)


def compared(
    name: str, do: Callable[[], object], *, products: int, windows: int, pixels: int, templates: int
) -> Compared:
    """The scores against the products."""
    rng = np.random.default_rng(1)
    seen = rng.normal(size=(products, windows, pixels)).astype(np.float32)
    known = rng.normal(size=(templates, pixels)).astype(np.float32)
    # turn by turn, so that other work on the machine falls on both
    pairs = [(least_s(do), least_s(lambda: [one @ known.T for one in seen])) for _ in range(3)]
    scores, product = (min(times) for times in zip(*pairs, strict=True))
    return Compared(name, products, windows, pixels, templates, scores, product)


def comparisons() -> list[Compared]:
    """The search of a line, and the cells of the line found."""
    scan = a_scan(TEXT, 1)
    edges = edge_map(scan)
    search = LineSearch(edges, scan.touch, TemplateCache(), chars=ALPHABET, places=None)
    fit = search.fit(Hypothesis(load_font("gothic"), HEIGHT_MM, 1.0, 0.0), raised=False)
    templates, image = search.templates(fit.hypothesis, raised=False), search.image(0.0)
    known = search_templates(templates, edges.directions)
    channels, rows, cols = fit.image.channels.shape
    # windows of each template's own width, at the places where they lie in the image
    tall, wide = 2 * known.half_rows + 1, 2 * float(known.half_cols.mean()) + 1
    found = [
        compared(
            "search",
            lambda: dense_scores(fit.image, templates, edges.directions),
            products=1,
            windows=(rows - tall + 1) * round(cols - wide + 1),
            pixels=round(channels * tall * wide),
            templates=len(templates.chars),
        )
    ]
    refine_line(fit, image, templates, edges.directions)
    _, _, fine_rows, fine_cols = fine_templates(templates, edges.directions)[0.0].shape
    half = templates.half_width[[p.template for p in fit.placed]].mean() * refine.PIXELS
    side = refine.MAX_SIDE_HEIGHTS * refine.PIXELS
    inked = refine.CELL_ROWS_HEIGHTS * refine.PIXELS
    cell_rows = min(fine_rows, 2 * int(np.ceil(inked)) + 1)
    shifts = (2 * refine.SHIFT_ROWS + 1) * (2 * refine.SHIFT_COLUMNS + 1)
    # half the land between neighbours, or as far as a cell may reach
    step = np.diff([p.column for p in fit.placed]).mean() * refine.PIXELS / 16
    cell_cols = min(fine_cols, round(min(2 * (half + side), step)) + 1)
    # a leaning template is two more, a turned one three
    leaning = 2 * refine.LEADERS + 3 * refine.TURNED_LEADERS * len(refine.TURNS_DEG)
    found.append(
        compared(
            "cells",
            lambda: refine.score_cells(fit, image, templates, edges.directions),
            products=len(fit.placed),
            windows=shifts,
            pixels=channels * cell_rows * cell_cols,
            templates=len(templates.chars) + leaning,
        )
    )
    return found


if __name__ == "__main__":
    for one in comparisons():
        print(
            f"{one.name}: {one.products} x {one.windows} windows x {one.pixels} pixels x {one.templates} templates: "
            f"{1e3 * one.scores_s:.2f} ms, plain products {1e3 * one.product_s:.2f} ms, ratio {one.ratio:.2f}"
        )
