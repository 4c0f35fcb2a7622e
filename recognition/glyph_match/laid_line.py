"""Likelihoods of the depths along a named font's characters, where several are likely at a place.

    text as read --fit a pose to each character--> smooth poses along the line
    doubtful place --fit each likely character about the smooth pose--> likelihoods

Depths compared sample by sample make other errors than the recogniser: a scratch is not the tail of a Q if the font has
its tail elsewhere. They help only if the font, the height and the places are known well.
"""

from __future__ import annotations

import numpy as np

from glyphs.fonts.glyph import Font
from recognition.glyph_match.felt_line import LEAST_SAMPLES, POSE_SD_REFINED, ZERO_POSE, FeltLine
from recognition.glyph_match.pose import DEEP, DOWN, RIGHT, TALL, TURN, WIDE, Floats
from recognition.language.lattice import Lattice


def depth_likelihoods(
    together: Lattice, felt: FeltLine, font: Font, *, least_probability: float = 1e-3
) -> Floats | None:
    """(places, C) log likelihoods of the depths along likely characters, else NaN; None if nothing is doubtful."""
    belief = np.exp(together.log_belief)
    has = np.array([char in font.glyphs for char in together.chars])
    likely_chars = (belief >= least_probability) & has
    doubtful = np.flatnonzero(likely_chars.sum(axis=1) > 1).tolist()
    places = [k for k in doubtful if felt.strip.samples(k).felt.size >= LEAST_SAMPLES]
    if not places:
        return None
    about, log = _smooth_poses(felt, together, font), np.full(belief.shape, np.nan)
    for k in places:
        for i in np.flatnonzero(likely_chars[k]):
            laid = felt.lay(k, together.chars[i], font, about=about[k], spread=POSE_SD_REFINED)
            log[k, i] = laid.log_likelihood
    return log


def _smooth_poses(felt: FeltLine, together: Lattice, font: Font) -> Floats:
    has = np.array([char in font.glyphs for char in together.text])
    sure = has * np.exp(2.0 * together.log_belief.max(axis=1))
    laid = [felt.lay(k, c, font).pose if has[k] else ZERO_POSE for k, c in enumerate(together.text)]
    fitted = np.stack(laid)
    along = (felt.columns - felt.columns.mean()) / max(float(np.ptp(felt.columns)), 1.0)
    about = np.zeros_like(fitted)
    smooth = (
        (RIGHT, 1, 0.06),
        (DOWN, 2, 0.04),
        (TURN, 1, 0.04),
        (WIDE, 0, 0.04),
        (TALL, 0, 0.04),
        (DEEP, 1, 0.3),
    )
    for number, order, scatter in smooth:
        about[:, number] = _smooth(fitted[:, number], along, sure, order=order, scatter=scatter)
    return about


def _smooth(values: Floats, along: Floats, weights: Floats, *, order: int, scatter: float) -> Floats:
    from scipy.optimize import least_squares

    powers = along[:, None] ** np.arange(order + 1)
    usual = np.diag(np.r_[1e-3, np.full(order, 0.2)])

    def residuals(terms: Floats) -> Floats:
        return np.concatenate([np.sqrt(weights + 1e-3) * (powers @ terms - values) / scatter, usual @ terms])

    start = np.r_[np.median(values), np.zeros(order)]
    return np.asarray(powers @ least_squares(residuals, start, loss="cauchy").x)
