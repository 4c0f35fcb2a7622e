"""What the predicted depths of a named font say at the doubtful places of a line that the recogniser has read.

    text as read --size of all, then a pose each--> smooth poses along the line
    doubtful place: each character that is likely, laid about its pose --likelihoods--> lattice

The recogniser and its prototypes see a line through the same layers, and err alike. Depths compared sample by sample
make other errors: a scratch is not the tail of a Q if the font has its tail elsewhere. They help only where the font,
the height and the places are known well, so the line is settled first, by the characters that are sure.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from recognition.glyph_match.pose import (
    DEEP,
    DOWN,
    NUMBERS,
    PIXELS,
    RIGHT,
    TALL,
    TURN,
    WIDE,
    Floats,
    Glyph,
    PlaceSamples,
    pose,
    spread_of_poses,
)
from recognition.glyph_match.predicted import TemplateSet
from recognition.language.lattice import Lattice
from recognition.views.text_line import HEIGHT_ROWS, MARGIN, TextLine
from recognition.views.view import HEIGHTS, KNOWN, View

BESIDE_HEIGHTS = 1.2
"""Land of a strip before and after its line, character heights."""
FOUND = spread_of_poses(right=0.12, down=0.10, turn_deg=4.5, deep=0.6)
"""Expected spread of poses around the places of a line as it was found."""
LEAST_SAMPLES = 100
"""Number of samples that a place needs before a character is laid over it."""
SETTLED = spread_of_poses(right=0.06, down=0.05, turn_deg=3.5, deep=0.45)
"""Expected spread of poses around the smooth ones along the line: blows move and turn characters this much."""


def glyph_depths(templates: TemplateSet, *, raised: bool = False) -> Mapping[str, Glyph]:
    """The predicted depths of a font's characters; kept with the set.

    Args:
        templates: of the font.
        raised: whether they are of raised marks: then heights are meant.
    """
    made: Mapping[str, Glyph] = templates.derive("depths", lambda: _glyph_depths(templates, raised))
    return made


def _glyph_depths(
    templates: TemplateSet, raised: bool, *, beside_heights: float = 0.14, half_wide_heights: float = 1.1
) -> dict[str, Glyph]:
    depth, _ = _depths_along(templates.view, templates.line, rows_heights=2.0, raised=raised)
    far = np.linalg.norm(templates.middles_mm - templates.line.centre_mm[0], axis=1) / templates.height_mm
    wide = int(half_wide_heights * PIXELS)
    x, y = np.arange(-wide, wide + 1), np.arange(-PIXELS, PIXELS + 1) + (depth.shape[0] - 1) / 2
    images = []
    for at, half in zip((far + BESIDE_HEIGHTS) * PIXELS - 0.5, templates.half_width, strict=True):
        cell = ndimage.map_coordinates(depth, np.meshgrid(y, x + at, indexing="ij"), order=1, mode="nearest")
        images.append(np.maximum(cell, 0.0) * (np.abs(x) <= (half + beside_heights) * PIXELS))
    usual = np.percentile(np.concatenate([image[image > 0.3 * image.max()] for image in images]), 75)
    return {
        char: _with_slopes(np.float32(1.0 / usual) * image)
        for char, image in zip(templates.chars, images, strict=True)
    }


def _with_slopes(depth: NDArray[np.float32]) -> Glyph:
    down, right = np.gradient(depth, 1.0 / PIXELS)
    return np.stack([depth, right, down], axis=-1).astype(np.float32)


def _depths_along(
    view: View, line: TextLine, *, rows_heights: float, raised: bool
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """(rows, columns) depth along a line in character heights, and whether it is known."""
    zoom = PIXELS / HEIGHT_ROWS
    strip = view.strip(line, rows=rows_heights * HEIGHT_ROWS, margin=BESIDE_HEIGHTS, zoom=zoom)
    return strip[HEIGHTS] if raised else -strip[HEIGHTS], strip[KNOWN] > 0.5


@dataclass(frozen=True, eq=False)
class DepthStrip:
    """The depths felt along a line.

    Attributes:
        depth: (rows, columns) below the land about, in units of noise.
        known: (rows, columns) where it was felt.
        usual: depth of the line's strokes, in units of noise.
        columns: (places,) of the middles of the places.
    """

    depth: Floats
    known: NDArray[np.bool_]
    usual: float
    columns: Floats

    def samples(self, place: int, *, shift_heights: float = 0.0, tall_heights: float = 0.72) -> PlaceSamples:
        """The samples about a place, up to its neighbours.

        Args:
            place: from 0.
            shift_heights: by which its middle lies further right.
            tall_heights: above and below its middle, character heights.
        """
        at = self.columns[place] + shift_heights * PIXELS
        gaps = np.diff(self.columns, prepend=-np.inf, append=np.inf) / PIXELS
        left, right = np.minimum(0.5 * gaps[place : place + 2] + 0.05, 0.6)
        rows, columns = np.indices(self.depth.shape)
        across, down = (columns - at) / PIXELS, (rows - (self.depth.shape[0] - 1) / 2) / PIXELS
        own = self.known & (across >= -left) & (across <= right) & (np.abs(down) <= tall_heights)
        return PlaceSamples(across[own], down[own], self.depth[own], self.usual)


def depth_strip(
    view: View,
    line: TextLine,
    columns: Floats,
    *,
    raised: bool,
    land_heights: float = 1.6,
    deep_percent: float = 93.0,
    noise: tuple[float, float] = (0.12, 0.35),
) -> DepthStrip | None:
    """The depths along a line of a felt view; None where hardly anything was felt.

    Args:
        view: as felt.
        line: where the text stands.
        columns: (places,) of the line's usual strip.
        raised: whether the marks stand out.
        land_heights: width over which the land is the median of what was felt, character heights.
        deep_percent: percentile of the line's samples that is the depth of its strokes.
        noise: least and greatest, shares of that depth; between them the samples' median distance from their median.
    """
    depth, known = _depths_along(view, line, rows_heights=2.4, raised=raised)
    at = ((columns + 0.5) / HEIGHT_ROWS - MARGIN + BESIDE_HEIGHTS) * PIXELS - 0.5
    middle, tall = (depth.shape[0] - 1) / 2, 0.55 * PIXELS
    first, end = int(at[0] - 0.4 * PIXELS), int(at[-1] + 0.4 * PIXELS)
    own = np.s_[int(middle - tall) : int(middle + tall) + 1, max(first, 0) : end]
    if known[own].sum() < PIXELS**2:
        return None
    filled = np.where(known, depth, np.median(depth[known])).astype(np.float64)
    land = ndimage.median_filter(filled[::2, ::2], size=int(0.5 * land_heights * PIXELS) | 1)
    land = np.repeat(np.repeat(land, 2, axis=0), 2, axis=1)[: depth.shape[0], : depth.shape[1]]
    below = filled - ndimage.gaussian_filter(land, 1.0)
    inside = below[own][known[own]]
    deep = max(float(np.percentile(inside, deep_percent)), 1e-4)
    scatter = 1.4826 * float(np.median(np.abs(inside - np.median(inside))))
    unit = float(np.clip(scatter, noise[0] * deep, noise[1] * deep))
    return DepthStrip(below / unit, known, deep / unit, at)


def with_depths(
    lattice: Lattice,
    together: Lattice,
    view: View,
    line: TextLine,
    columns: Floats,
    templates: TemplateSet,
    *,
    raised: bool,
    doubtful: float = 0.98,
    likely: float = 1e-3,
    least_suits: float = 0.4,
    most_nats: float = 2.0,
) -> Lattice:
    """A font's lattice with what its depths say at doubtful places; as it is where there are none.

    Args:
        lattice: of the font.
        together: of all experts.
        view: as felt.
        line: where the text stands.
        columns: (places,) of the line's usual strip.
        templates: of the font.
        raised: whether the marks stand out.
        doubtful: probability of the surest character below which a place is doubtful.
        likely: probability from which a character is laid over a doubtful place. Of 178 lines with the font named, at
            dirt 0.3 to 0.9, depths raise the serials right from 135 to 140 and those surer than 0.97 from 110 (1 wrong)
            to 113 (1). One half set the numbers of this module, but for the next two; the other half gained as much.
        least_suits: correlation of the text as read with the line, from which the font's depths count: of 23 dotted
            lines, which undotted templates fit badly, the best has 0.35.
        most_nats: by which depths can favour a character over another: a stroke that dirt fills is one event, however
            many samples it has. Without a limit 4 of 73 accepted parts of two more fonts were wrong, with 3 nats 1 of
            68.
    """
    belief = np.exp(together.log_belief)
    places = np.flatnonzero((belief.max(axis=1) < doubtful) & (belief.sum(axis=1) > 0.0))
    strip = depth_strip(view, line, columns, raised=raised) if places.size else None
    if strip is None or not set(together.text) & set(templates.chars):
        return lattice
    glyphs = glyph_depths(templates, raised=raised)
    suits, about = settled_poses(strip, together, glyphs)
    if suits < least_suits:
        return lattice
    log = lattice.log_belief.copy()
    moves = [
        pose(right=right, down=down)
        for right, down in product((-0.1, -0.05, 0.0, 0.05, 0.1), (-0.05, 0.0, 0.05))
    ]
    for k in places:
        laid = [i for i, char in enumerate(together.chars) if belief[k, i] >= likely and char in glyphs]
        samples = strip.samples(int(k), shift_heights=about[k, RIGHT])
        if len(laid) < 2 or samples.felt.size < LEAST_SAMPLES:
            continue
        expected = np.where(np.arange(NUMBERS) == RIGHT, 0.0, about[k])
        starts = [expected + move for move in moves]
        fits = np.array([samples.fit(glyphs[together.chars[i]], expected, SETTLED, starts)[0] for i in laid])
        moved = log[k, laid] + np.maximum(fits - fits.max(), -most_nats)
        log[k, laid] = moved - np.logaddexp.reduce(moved) + np.logaddexp.reduce(log[k, laid])
    return replace(lattice, log_belief=np.minimum(log, 0.0))


def settled_poses(
    strip: DepthStrip,
    together: Lattice,
    glyphs: Mapping[str, Glyph],
    *,
    sizes: Sequence[float] = tuple(np.arange(-0.24, 0.13, 0.06)),
    usual_size: float = -0.04,
    size_cost: float = 2.5,
    shift_cost: float = 5.0,
) -> tuple[float, Floats]:
    """How well the font suits the line, and (places, NUMBERS) the pose that is expected at each place.

    What suits is the mean correlation of the characters that were read, less what size and shifts cost.

    Args:
        strip: the line as felt.
        together: what is read.
        glyphs: the font's characters.
        sizes: logarithms of the factors of the line's height that are tried.
        usual_size: the likeliest of them: lines are found a little too high.
        size_cost: correlation that a size costs, of the square of its distance from that.
        shift_cost: correlation that a shift costs, of its square.
    """
    n = together.n_places
    sure = np.exp(2.0 * together.log_belief.max(axis=1))
    places = {k: strip.samples(k) for k in range(n) if together.text[k] in glyphs}
    samples = {k: one for k, one in places.items() if one.felt.size >= LEAST_SAMPLES}
    if not samples:
        return 0.0, np.zeros((n, NUMBERS))
    read = list(samples)
    shifts = list(product((-0.14, -0.07, 0.0, 0.07, 0.14), (-0.1, 0.0, 0.1)))

    def suits(k: int, size: float) -> float:
        glyph = glyphs[together.text[k]]
        return max(
            samples[k].correlation(glyph, pose(right=right, down=down, size=size))
            - shift_cost * (right**2 + down**2)
            for right, down in shifts
        )

    def suits_all(size: float) -> float:
        return float(np.average([suits(k, size) for k in read], weights=sure[read] + 1e-3))

    suit, size = max((suits_all(size) - size_cost * (size - usual_size) ** 2, size) for size in sizes)
    middle = pose(size=size)
    fitted = np.tile(middle, (n, 1))
    for k in read:
        starts = [pose(right=right, down=down, size=size) for right, down in shifts]
        fitted[k] = samples[k].fit(glyphs[together.text[k]], middle, FOUND, starts)[1]
    along = (strip.columns - strip.columns.mean()) / max(float(np.ptp(strip.columns)), 1.0)
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
    return suit, about


def _smooth(values: Floats, along: Floats, weights: Floats, *, order: int, scatter: float) -> Floats:
    """A polynomial along the line through values, of which some are wrong."""
    from scipy.optimize import least_squares

    powers = along[:, None] ** np.arange(order + 1)
    usual = np.diag(np.r_[1e-3, np.full(order, 0.2)])

    def residuals(terms: Floats) -> Floats:
        return np.concatenate([np.sqrt(weights + 1e-3) * (powers @ terms - values) / scatter, usual @ terms])

    start = np.r_[np.median(values), np.zeros(order)]
    return np.asarray(powers @ least_squares(residuals, start, loss="cauchy").x)
