"""The kernels of a cell against the matrix products that they stand for, written out in numpy."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.lib.stride_tricks import sliding_window_view

from recognition.experts.templates.cell_scores import CellInk, Scored, cell_ink, straight_scores, tilted_score

FLOAT32 = 5e-5
"""Of a correlation in single precision, over some hundred pixels, ink below 1e-4 of the strongest left out."""
SV, SU, UP, LEFT, RIGHT = 2, 3, 5, 4, 6
HALF_HEIGHT, LEAN = 4.0, 0.5


def some(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """An image, and templates of which most is land."""
    rng = np.random.default_rng(seed)
    templates = rng.normal(size=(4, 3, 15, 17)) * (rng.random((4, 3, 15, 17)) < 0.4)
    return rng.normal(size=(3, 26, 33)).astype(np.float32), templates.astype(np.float32)


def windows_at(layers: np.ndarray, row: int, column: int) -> np.ndarray:
    """(shifts, channels, pixels) of the cell, land beyond the map."""
    pad = 20
    wide = np.pad(layers, ((0, 0), (pad, pad), (pad, pad)))
    r, c = row - UP - SV + pad, column - LEFT - SU + pad
    cut = wide[:, r : r + 2 * (UP + SV) + 1, c : c + LEFT + RIGHT + 2 * SU + 1]
    seen = sliding_window_view(cut, (2 * UP + 1, LEFT + RIGHT + 1), axis=(1, 2))
    return seen.transpose(1, 2, 0, 3, 4).reshape((2 * SV + 1) * (2 * SU + 1), 3, -1).astype(np.float64)


def window_of(template: np.ndarray) -> np.ndarray:
    """(channels, rows, cols) of a template in the cell."""
    row, col = template.shape[1] // 2, template.shape[2] // 2
    return template[:, row - UP : row + UP + 1, col - LEFT : col + RIGHT + 1].astype(np.float64)


def centred(values: np.ndarray) -> np.ndarray:
    """(..., channels, pixels) with each channel's mean off, as vectors."""
    free = values - values.mean(axis=-1, keepdims=True)
    return free.reshape(*values.shape[:-2], -1)


def scored(layers: np.ndarray, templates: np.ndarray, row: int, column: int, *, only: slice = slice(0, 4)):
    ink = cell_ink(templates, UP)
    return ink, straight_scores(layers, ink, only.start, only.stop, (row, column, UP, LEFT, RIGHT, SV, SU))


def tilted(cell: Scored, ink: CellInk, t: int, half_width: float) -> tuple[float, int]:
    return tilted_score(
        cell, 2 * SU + 1, ink, t,
        up=UP, left=LEFT, right=RIGHT, half_width=half_width, half_height=HALF_HEIGHT, most_lean=LEAN,
    )  # fmt: skip


# in the middle, leaning over each rim, beyond the map
PLACES = [(13, 16), (1, 2), (25, 32), (13, -3), (0, 31)]


@pytest.mark.parametrize(("row", "column"), PLACES)
@settings(max_examples=5, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_straight_scores_are_the_best_correlations(seed: int, row: int, column: int) -> None:
    layers, templates = some(seed)
    _, (best, shift, *_) = scored(layers, templates, row, column)
    shifts = centred(windows_at(layers, row, column))
    spread = np.maximum(np.linalg.norm(shifts, axis=1), 1e-6)
    flat = centred(np.stack([window_of(t).reshape(3, -1) for t in templates]))
    table = shifts @ (flat / np.linalg.norm(flat, axis=1, keepdims=True)).T / spread[:, None]
    np.testing.assert_allclose(best, table.max(axis=0), atol=FLOAT32)
    np.testing.assert_allclose(table[shift, np.arange(4)], table.max(axis=0), atol=FLOAT32)


def test_one_template_alone_scores_as_among_all() -> None:
    layers, templates = some(7)
    _, (all_best, all_shift, *_) = scored(layers, templates, 12, 15)
    for t in range(4):
        _, (best, shift, *_) = scored(layers, templates, 12, 15, only=slice(t, t + 1))
        assert (best[0], shift[0]) == (all_best[t], all_shift[t])


def leaning(shifts: np.ndarray, spread: np.ndarray, template: np.ndarray, half_width: float) -> np.ndarray:
    """Scores of a template whose depth may lean, its parts made orthogonal as vectors of pixels."""
    window = window_of(template)
    u = np.clip((np.arange(window.shape[2]) - LEFT) / half_width, -1.0, 1.0)
    v = np.clip((np.arange(window.shape[1]) - UP) / HALF_HEIGHT, -1.0, 1.0)
    base = centred(window.reshape(3, -1))
    size = np.linalg.norm(base)
    known = [base / size]
    upright = shifts @ known[0] / spread
    total = upright**2
    for part in (window * u[None, None, :], window * v[None, :, None]):
        free = centred(part.reshape(3, -1))
        for axis in known:
            free = free - (free @ axis) * axis
        length = np.linalg.norm(free)
        known.append(free / length)
        found = np.abs(shifts @ known[-1] / spread)
        taken = np.minimum(found, LEAN * np.abs(upright) * length / size)
        total += taken * (2.0 * found - taken)
    return np.where(upright > 0.0, np.sqrt(np.minimum(total, 1.0)), upright)


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(1.0, 9.0))
def test_tilted_scores_are_those_of_leaning_templates(seed: int, half_width: float) -> None:
    layers, templates = some(seed)
    ink, cell = scored(layers, templates, 13, 16)
    shifts = centred(windows_at(layers, 13, 16))
    spread = np.linalg.norm(shifts, axis=1)
    for t in range(4):
        score, at = tilted(cell, ink, t, half_width)
        expected = leaning(shifts, spread, templates[t], half_width)
        assert score == pytest.approx(expected.max(), abs=FLOAT32)
        assert expected[at] == pytest.approx(expected.max(), abs=FLOAT32)
        assert score >= cell.best[t] - FLOAT32


def test_a_template_struck_aslant_is_known_again() -> None:
    layers, templates = some(3)
    window = window_of(templates[2])
    u = np.clip((np.arange(window.shape[2]) - LEFT) / 5.0, -1.0, 1.0)
    layers = np.zeros_like(layers)
    layers[:, 13 - UP : 13 + UP + 1, 16 - LEFT : 16 + RIGHT + 1] = window * (1.0 + 0.4 * u)
    ink, cell = scored(layers, templates, 13, 16)
    score, _ = tilted(cell, ink, 2, 5.0)
    assert score == pytest.approx(1.0, abs=FLOAT32)
    assert cell.best[2] < 0.999
