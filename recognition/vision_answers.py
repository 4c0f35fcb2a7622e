"""Products of the edges with every picture of a font, at the rows where they are wanted.

Along the columns by their spectra, along the rows by matrix products, one for each frequency f::

    answer[f, (b, t), r] = sum over layers d and rows i of spectrum[f, (b, t), (d, i)] * edges[f, (d, r + i)]

One light asks for one picture a character instead of three, and a line for a few rows instead of all.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from recognition.vision_templates import VisionBasis

MOST_KEPT_BYTES = 64_000_000
"""Of one font's spectra, kept from photograph to photograph: one set for every length of line that is met."""

FEW = 16
"""Rows that are asked of all pictures at once."""

Floats = NDArray[np.float64]
Answers = NDArray[np.float32]


class VisionAnswers:
    """The pictures of a basis asked about one map of edges."""

    def __init__(self, edges: NDArray[np.float32], basis: VisionBasis) -> None:
        """Take the spectra.

        Args:
            edges: (2, rows, cols), float32; nothing is seen beyond.
            basis: of the font.
        """
        from scipy import fft

        self.basis = basis
        layers, self.rows, self.cols = edges.shape
        tall, wide = basis.patches.shape[3:]
        # what comes round from the other end stays beyond the columns
        self._length = fft.next_fast_len(-(-(self.cols + wide // 2) // 32) * 32, real=True)
        self._tall = tall
        self._spectra = spectra_of(basis, self._length)
        rows = np.zeros((layers, self.rows + tall - 1, self.cols), dtype=np.float32)
        rows[:, tall // 2 : tall // 2 + self.rows] = edges
        # (frequencies, layers, rows)
        self._seen = np.ascontiguousarray(fft.rfft(rows, self._length, axis=2).transpose(2, 0, 1))

    def lit(self, light: Floats) -> Answers:
        """(cols, T, rows) products of the edges with every character in one light."""
        # complex numbers as pairs of real ones: the light's weights are real
        f, b, count, n = self._spectra.shape
        flat = self._spectra.view(np.float32).reshape(f, b, -1)
        pictures = (light.astype(np.float32) @ flat).view(np.complex64).reshape(f, count, n)
        return self._asked(pictures, self._windows(0, self.rows))

    def pictures(self, first: int, last: int) -> Answers:
        """(3, cols, T, rows) products with each picture at rows from `first` and before `last`."""
        windows = self._windows(first, last)
        f, b, count, n = self._spectra.shape
        if last - first <= FEW:
            made = self._asked(self._spectra.reshape(f, b * count, n), windows)
            return np.ascontiguousarray(made.reshape(self.cols, b, count, -1).swapaxes(0, 1))
        # picture by picture: each fits into the processor's memory
        out = np.empty((b, self.cols, count, last - first), dtype=np.float32)
        for k in range(b):
            out[k] = self._asked(self._spectra[:, k], windows)
        return out

    def _windows(self, first: int, last: int) -> NDArray[np.complex64]:
        """(frequencies, layers x tall, rows) what each row's pictures lie over."""
        size = last - first
        over = self._seen[:, :, first : last + self._tall - 1]
        windows = np.lib.stride_tricks.sliding_window_view(over, size, axis=2)
        return np.ascontiguousarray(windows).reshape(over.shape[0], -1, size)

    def _asked(self, pictures: NDArray[np.complex64], windows: NDArray[np.complex64]) -> Answers:
        from scipy import fft

        return np.asarray(fft.irfft(pictures @ windows, self._length, axis=0)[: self.cols], dtype=np.float32)


def spectra_of(basis: VisionBasis, length: int) -> NDArray[np.complex64]:
    """(frequencies, pictures, T, layers x tall) spectra of the templates' rows; kept in the work space."""
    from scipy import fft

    key = ("spectra", length)
    kept = basis.work.get(key)
    if isinstance(kept, np.ndarray):
        return kept
    count, pictures, layers, tall, wide = basis.patches.shape
    flat = np.zeros((count, pictures, layers, tall, length), dtype=np.float32)
    flat[..., :wide] = basis.patches
    flat = np.roll(flat, -(wide // 2), 4)
    spectra = np.conj(fft.rfft(flat)).transpose(4, 1, 0, 2, 3)
    made = np.ascontiguousarray(spectra.reshape(-1, pictures, count, layers * tall))
    kept_all = {k: v for k, v in [*basis.work.items()] if isinstance(v, np.ndarray)}
    size = made.nbytes + sum(v.nbytes for v in kept_all.values())
    for old, spectrum in kept_all.items():
        if size <= MOST_KEPT_BYTES:
            break
        basis.work.pop(old, None)
        size -= spectrum.nbytes
    basis.work[key] = made
    return made


def row_promise(answers: Answers, scale: NDArray[np.float32]) -> Floats:
    """(lights, rows) mean over columns of what the best character would earn there, squared.

    Args:
        answers: (pictures, cols, T, rows).
        scale: (lights, T, pictures) weight of each picture in each light, over the size of the character so lit.
    """
    return np.asarray(_promise(answers, np.ascontiguousarray(scale, dtype=np.float32)))


@njit(cache=True)  # type: ignore[untyped-decorator,unused-ignore]
def _promise(answers, scale):  # type: ignore[no-untyped-def]
    pictures, cols, count, rows = answers.shape
    total = np.zeros((scale.shape[0], rows))
    best, lit = np.empty(rows, dtype=np.float32), np.empty(rows, dtype=np.float32)
    for x in range(cols):
        for n in range(scale.shape[0]):
            best[:] = np.float32(0.0)
            for t in range(count):
                lit[:] = np.float32(0.0)
                for b in range(pictures):
                    weight, row = scale[n, t, b], answers[b, x, t]
                    if weight != np.float32(0.0):
                        for r in range(rows):
                            lit[r] += weight * row[r]
                for r in range(rows):
                    best[r] = max(best[r], lit[r])
            for r in range(rows):
                total[n, r] += best[r] * best[r]
    return total / cols


def column_evidence(
    near: Answers, weights: Floats, power: Floats, independence: float, *, squared: bool
) -> tuple[Floats, Floats]:
    """(T, cols) log mean over rows of the Bayes factors of every character in one light; (T, cols, rows) their logs.

    Args:
        near: (3, cols, T, rows) products with the pictures.
        weights: (3,) of the light.
        power: (T,) square of each character so lit.
        independence: independent values a pixel.
        squared: the strength is not known: the best one for every character by itself.
    """
    score, top, over = _scores(near, weights, power, independence, squared)
    np.exp(over, out=over)
    return top + np.log(_means(over)), score


@njit(cache=True)  # type: ignore[untyped-decorator,unused-ignore]
def _scores(near, weights, power, independence, squared):  # type: ignore[no-untyped-def]
    """Logs of the factors, the largest over rows, and the logs over that."""
    _, cols, count, rows = near.shape
    score, over = np.empty((count, cols, rows)), np.empty((count, cols, rows))
    high = np.empty((count, cols))
    a, b, c = weights
    for t in range(count):
        half = 0.5 * power[t]
        for x in range(cols):
            line, top = score[t, x], -np.inf
            for r in range(rows):
                lit = a * near[0, x, t, r] + b * near[1, x, t, r] + c * near[2, x, t, r]
                if squared:
                    lit = max(lit, 0.0)
                    line[r] = 0.5 * independence * lit * lit / power[t]
                else:
                    line[r] = independence * (lit - half)
                top = max(top, line[r])
            high[t, x] = top
            for r in range(rows):
                over[t, x, r] = line[r] - top
    return score, high, over


@njit(cache=True)  # type: ignore[untyped-decorator,unused-ignore]
def _means(values):  # type: ignore[no-untyped-def]
    """(T, cols) means over rows."""
    out = np.empty(values.shape[:2])
    for t in range(out.shape[0]):
        for x in range(out.shape[1]):
            total = 0.0
            for r in range(values.shape[2]):
                total += values[t, x, r]
            out[t, x] = total / values.shape[2]
    return out
