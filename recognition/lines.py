"""From an edge map to the lines that may stand on it: hypotheses, the search over them, and how far to go.

Marks of a known font and a crisp die are found at once. Each further step is taken only where the one before
fits badly: dots, other strokes, then softer hands and other widths, for marks of a font we have not got.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from glyphs.fonts.glyph import Font
from glyphs.stamping.die import Face
from recognition.evidence_cache import EvidenceCache
from recognition.frames import is_edge_channel
from recognition.localise import MIN_RELIEF_SHARE, activity_of, bands, line_rotation_deg, percentile
from recognition.search import Hypothesis, LineFit, LineSearch, refine_geometry, refine_shape, refine_stroke

_log = logging.getLogger(__name__)
RIVAL_SHARE = 0.8
"""Of what the best font explains, which another must reach to be looked at closely."""
DOTTED_SCORE = 0.8
"""Mean correlation in the search below which marks made of dots are tried as well."""
SETTLED_SCORE = 0.78
"""Mean correlation in the search from which a rotation is taken as found."""
HOPELESS_SCORE, FOREIGN_SCORE, GOOD_SCORE = 0.52, 0.8, 0.87
"""Mean correlation in the search: below the last other strokes are tried, below the middle other hands and widths,
below the first nothing more."""


def hypotheses(search: LineSearch, fonts: Sequence[Font], *, height_mm: float | None) -> list[Hypothesis]:
    """Heights and rotation to try, from where edges are felt."""
    edges = search.edges
    upright = search.image(0.0)
    keep = is_edge_channel(edges.directions)
    activity = activity_of(upright.channels[keep])
    # a profile of h is felt as h / d0
    relief = percentile(np.abs(edges.enhancement), 99.8) * search.touch.preload_mm
    rotation = line_rotation_deg(activity)
    made: list[Hypothesis] = []
    for turn in (rotation, 0.0) if rotation else (0.0,):
        if height_mm:
            heights = [height_mm]
        else:
            heights = []
            turned = activity_of(search.image(turn).channels[keep]) if turn else activity
            for band in bands(turned, pitch_mm=edges.pitch_mm, most=3):
                heights.extend(band.height_mm * factor for factor in (1.0, 0.88))
        heights = [h for h in _distinct(heights) if relief > MIN_RELIEF_SHARE * h]
        made += [Hypothesis(font, h, 1.0, turn) for font in fonts for h in heights]
    return made


def find_lines(
    search: LineSearch,
    tried: list[Hypothesis],
    *,
    height_known: bool,
    look: EvidenceCache | None = None,
) -> list[LineFit]:
    """The lines of the best fonts, best first.

    Args:
        search: fits hypotheses to the map.
        tried: hypotheses.
        height_known: the character height was given.
        look: for what dirt has left of lines that fit badly: where they are of their font's own shapes all the same,
            no other hand, dots or widths are tried.
    """
    by_font = _best_by_font(search, tried)
    best = max(by_font.values(), key=lambda f: f.value_mm, default=None)
    if _score(by_font) < DOTTED_SCORE and not (
        look is not None and best is not None and look.own_shapes(best)
    ):
        # dots answer only templates of nearly their own height
        dotted = [
            replace(h, face=Face.DOTTED, height_mm=h.height_mm * factor)
            for h in tried
            for factor in (1.0, 0.94)
            if h.font.stroke_ratio > 0.0
        ]
        for name, fit in _best_by_font(search, dotted).items():
            if fit.value_mm > by_font[name].value_mm:
                by_font[name] = fit
    leaders = sorted(by_font.values(), key=lambda f: -f.value_mm)[:3]
    spans = (0.04,) if height_known else (0.06,)
    refined: list[LineFit] = []
    for leader in leaders:
        rival = leader is leaders[0] or leader.value_mm >= RIVAL_SHARE * leaders[0].value_mm
        if not leader.placed or not rival:
            continue
        line = refine_geometry(search, leader, spans=spans)
        if refined and refined[0].mean_score >= GOOD_SCORE and refined[0].hypothesis.font.learned:
            # the die's own shapes leave nothing to be explained by other hands of other fonts
            refined.append(line)
            continue
        if look is not None and line.mean_score < GOOD_SCORE:
            kept = look.better(leader, line)
            if look.own_shapes(kept):
                refined.append(kept)
                continue
        if HOPELESS_SCORE < line.mean_score < GOOD_SCORE:
            line = refine_geometry(search, refine_stroke(search, line), spans=(0.04,))
        if HOPELESS_SCORE < line.mean_score < FOREIGN_SCORE and len(refined) < 2:
            line = refine_shape(search, line, x_scales=(0.8, 0.9, 1.12, 1.25))
            line = refine_geometry(search, line, spans=(0.05,))
        refined.append(line)
    return refined


def _best_by_font(search: LineSearch, hypotheses: list[Hypothesis]) -> dict[str, LineFit]:
    """The best fit of every font; other rotations are not tried once one explains the line."""
    best: dict[str, LineFit] = {}
    turn: float | None = None
    names = list(dict.fromkeys(h.font.name for h in hypotheses))
    for hypothesis in hypotheses:
        if turn is not None and hypothesis.rotation_deg != turn and _score(best) > SETTLED_SCORE:
            break
        turn = hypothesis.rotation_deg
        _log.debug("trying font %d of %d", names.index(hypothesis.font.name) + 1, len(names))
        fit = search.fit(hypothesis)
        held = best.get(hypothesis.font.name)
        if held is None or fit.value_mm > held.value_mm:
            best[hypothesis.font.name] = fit
    return best


def _score(fits: dict[str, LineFit]) -> float:
    """Best mean correlation of a line of three or more characters."""
    return max((f.mean_score for f in fits.values() if len(f.placed) > 2), default=0.0)


def _distinct(heights: list[float]) -> list[float]:
    kept: list[float] = []
    for height in heights:
        if all(abs(np.log(height / other)) > 0.05 for other in kept):
            kept.append(height)
    return kept
