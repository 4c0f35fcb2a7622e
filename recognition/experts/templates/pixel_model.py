r"""What a pixel of a dirty mark says: log likelihood ratios that no single pixel can overrule.

A template predicts t at a pixel and e is felt. Three things may have happened there::

    clean    e = t, within the noise and a tenth or so of t        (1 - filled - debris)
    filled   grime fills the groove: e = 0 (to the brim) or anywhere between 0 and t      (filled)
    debris   a chip, a scratch, a burr: e anywhere, on the profile more often above the land (debris)

where nothing is predicted, t = 0, only the first and the last. The pixel's say is log p(e|t) - log p(e|0), which is
bounded on both sides: missing ink costs little, most of all where dirt is seen (`covered`), and what stands
where nothing should stand cannot outweigh a stroke that fits. It is 0 for t = 0, so only ink is summed over.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

N_FELT, N_PREDICTED, N_LEVELS = 97, 33, 5
"""Steps of e, of t, and of how surely a pixel is covered by dirt."""
DEBRIS = 0.1
FILLED_CLEAN, FILLED_COVERED = 0.06, 0.5
"""Prior of filled ink where the surface around looks clean, and where it is seen to be covered."""
BRIM_CLEAN, BRIM_COVERED = 0.6, 0.9
"""Of filled ink, the share filled to the brim; the rest is filled to any level."""
RELATIVE_SPREAD = 0.2
"""Standard deviation of clean ink about its prediction, as a share of it: uneven blows, slight misfit."""
WALL_SPREAD = 0.25
EDGE_SPREAD, EDGE_FLOOR = 0.45, 0.1
"""Standard deviation where a slight misfit in place tells most: walls on the profile, and all that edges show."""
FELT_REACH = 2.5
"""Range of e in the table, in largest predictions."""
DEBRIS_SPREAD = 0.5
DEBRIS_UP = 0.8
"""Share of debris whose profile is against the mark's own sign: chips stand out of a plate with sunk marks."""


@dataclass(frozen=True, eq=False)
class PixelModel:
    """Tables of the ratio, one a channel and level of cover.

    Attributes:
        table: (channels, N_LEVELS, N_FELT, N_PREDICTED) float32.
        felt_reach: (channels,) e runs from -reach to +reach.
        predicted_reach: (channels,) t runs likewise.
    """

    table: NDArray[np.float32]
    felt_reach: NDArray[np.float64]
    predicted_reach: NDArray[np.float64]

    def felt_index(self, felt: NDArray[np.float32], covered: NDArray[np.float32]) -> NDArray[np.int32]:
        """(channels, rows, cols): where in the flat table the row of a pixel begins."""
        level = np.clip(np.rint(covered * (N_LEVELS - 1)), 0, N_LEVELS - 1).astype(np.int32)
        out = np.empty(felt.shape, dtype=np.int32)
        for k, channel in enumerate(felt):
            at = (channel / self.felt_reach[k] + 1.0) * (0.5 * (N_FELT - 1))
            e = np.clip(np.rint(at), 0, N_FELT - 1).astype(np.int32)
            out[k] = ((k * N_LEVELS + level) * N_FELT + e) * N_PREDICTED
        return out


def pixel_model(
    *, noise: NDArray[np.float64], reach: NDArray[np.float64], profile: NDArray[np.bool_], raised: bool
) -> PixelModel:
    """The model for given noise.

    Args:
        noise: (channels,) standard deviation of the land.
        reach: (channels,) largest prediction of the templates.
        profile: (channels,) which channels are the profile, whose sign tells chips from marks.
        raised: raised marks.
    """
    table = np.empty((noise.size, N_LEVELS, N_FELT, N_PREDICTED), dtype=np.float32)
    for k in range(noise.size):
        likely = _likelihoods(
            noise=float(noise[k]), reach=float(reach[k]), profile=bool(profile[k]), raised=raised
        )
        for level, cover in enumerate(np.linspace(0.0, 1.0, N_LEVELS)):
            table[k, level] = _ratio(
                likely,
                filled=FILLED_CLEAN + cover * (FILLED_COVERED - FILLED_CLEAN),
                brim=BRIM_CLEAN + cover * (BRIM_COVERED - BRIM_CLEAN),
            )
    return PixelModel(table=table, felt_reach=FELT_REACH * reach, predicted_reach=reach)


class _Likelihoods(NamedTuple):
    """p(e|t) of what may have happened, (N_FELT, N_PREDICTED) or (N_FELT, 1), whatever covers the pixel."""

    land: NDArray[np.float64]
    partly: NDArray[np.float64]
    debris: NDArray[np.float64]
    clean: NDArray[np.float64]


def _likelihoods(*, noise: float, reach: float, profile: bool, raised: bool) -> _Likelihoods:
    from scipy.special import ndtr

    e = np.linspace(-FELT_REACH * reach, FELT_REACH * reach, N_FELT)[:, None]
    t = np.linspace(-reach, reach, N_PREDICTED)[None, :]

    def normal(x: NDArray[np.float64], spread: NDArray[np.float64] | float) -> NDArray[np.float64]:
        return np.asarray(np.exp(-0.5 * (x / spread) ** 2) / (spread * np.sqrt(2.0 * np.pi)))

    land = normal(e, noise)
    low, high = np.minimum(t, 0.0), np.maximum(t, 0.0)
    between = (ndtr((e - low) / noise) - ndtr((e - high) / noise)) / np.maximum(np.abs(t), 1e-9)
    debris = normal(e, DEBRIS_SPREAD * reach)
    if profile:
        up = -e if raised else e
        debris = debris * (1.0 + (2.0 * DEBRIS_UP - 1.0) * np.sign(up))
        # on a wall, half way down, a slight shift changes much; on the floor nothing
        deep = np.abs(t) / reach
        misfit = np.hypot(RELATIVE_SPREAD * t, WALL_SPREAD * reach * 4.0 * deep * (1.0 - deep))
    else:
        misfit = np.hypot(EDGE_SPREAD * t, EDGE_FLOOR * reach)
    partly = np.where(np.abs(t) < noise, land, between)
    return _Likelihoods(land, partly, debris, clean=normal(e - t, np.hypot(noise, misfit)))


def _ratio(likely: _Likelihoods, *, filled: float, brim: float) -> NDArray[np.float64]:
    """log p(e|t) - log p(e|0), (N_FELT, N_PREDICTED)."""
    land, partly, debris, clean = likely
    part_filled = brim * land + (1.0 - brim) * partly
    inked = (1.0 - filled - DEBRIS * (1.0 - filled)) * clean + filled * part_filled
    inked = inked + DEBRIS * (1.0 - filled) * debris
    ratio = np.log(inked / ((1.0 - DEBRIS) * land + DEBRIS * debris))
    return np.asarray(ratio - ratio[:, [N_PREDICTED // 2]])
