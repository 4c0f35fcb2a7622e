"""Robust evidence: what every template, at every place, explains of a dirty line.

    line image, at 24 pixels to the height --pixel model, covered--> sum over a template's ink = evidence
    evidence --best chain under the format--> places --small shifts and turns--> evidence of every character

The evidence of a place is a log likelihood ratio against "nothing stands here", summed over pixels that go
together: `calibrate` turns it into belief.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from glyphs.surface.maps import TraceDirection
from recognition.experts.templates.decode import best_chain
from recognition.experts.templates.frames import LineImage, is_edge_channel, padded, resampled
from recognition.experts.templates.occlusion import covered, robust_spread
from recognition.experts.templates.pixel_model import pixel_model
from recognition.experts.templates.place_evidence import LineFelt, PlaceEvidence, place_evidence
from recognition.experts.templates.placed_line import PlacedLine
from recognition.experts.templates.refine import Cell
from recognition.experts.templates.segmentation import MARGIN_PIXELS, place_bounds, usual_spacing
from recognition.experts.templates.sparse_templates import (
    EVIDENCE_PIXELS,
    coarse_patches,
    dense_evidence,
    ideal_evidence,
    ink_reach,
    predicted_columns,
    reach_of,
    turned_templates,
)

LEAST_NOISE = 0.03
"""Of the largest prediction: a smoother land is not believed."""
ROW_REACH = 4
TURNS_DEG = (-2.5, 2.5)
GAP_HEIGHTS = 1.5
BLOWS = (1.0, 0.6)
AMPLITUDE_SCORE = 0.6
AMPLITUDE_RANGE = (0.25, 2.5)
FLOOR_SHARE = 0.75


def amplitude_of(line: PlacedLine, cells: Sequence[Cell], directions: tuple[TraceDirection, ...]) -> float:
    """Depth of the marks against the templates', from the characters that fit; 1 without any.

    The upper quartile over the floors of their strokes: grime only takes away.
    """
    patches = coarse_patches(line.templates, directions)
    fine = resampled_to(line)
    profile = ~is_edge_channel(directions)
    if not profile.any():
        profile = np.ones_like(profile)
    ratios = []
    for cell in cells:
        best = int(np.argmax(cell.scores))
        if cell.scores[best] < AMPLITUDE_SCORE:
            continue
        t = patches[best][profile]
        seen = _window(fine, cell.u_mm, cell.v_mm, t.shape[1], t.shape[2])[profile]
        floor = np.abs(t) > FLOOR_SHARE * np.abs(t).max()
        ratios.append((seen / np.where(floor, t, 1.0))[floor])
    if not ratios:
        return 1.0
    return float(np.clip(np.percentile(np.concatenate(ratios), 75), *AMPLITUDE_RANGE))


def resampled_to(line: PlacedLine) -> LineImage:
    """The image at EVIDENCE_PIXELS to the height of a line."""
    pixel = line.height_mm / EVIDENCE_PIXELS
    return resampled(line.image, pitch_u_mm=pixel, pitch_v_mm=pixel)


def _window(image: LineImage, u_mm: float, v_mm: float, rows: int, cols: int) -> NDArray[np.float32]:
    r = round((v_mm - image.origin_mm[1]) / image.pitch_v_mm) - rows // 2
    c = round((u_mm - image.origin_mm[0]) / image.pitch_u_mm) - cols // 2
    out = np.zeros((image.channels.shape[0], rows, cols), dtype=np.float32)
    _, height, width = image.channels.shape
    rr, cc = slice(max(0, r), min(height, r + rows)), slice(max(0, c), min(width, c + cols))
    if rr.stop > rr.start and cc.stop > cc.start:
        out[:, rr.start - r : rr.stop - r, cc.start - c : cc.stop - c] = image.channels[:, rr, cc]
    return out


def line_evidence(
    line: PlacedLine,
    cells: Sequence[Cell],
    directions: tuple[TraceDirection, ...],
    *,
    places: Sequence[str],
    gaps: frozenset[int] = frozenset(),
) -> tuple[PlaceEvidence, ...]:
    """Look again at a line for what the dirt has left of it: its places, left to right; none if nothing is left.

    Args:
        line: height, rotation, row, and about where characters stand.
        cells: correlations there.
        directions: of the edge map.
        places: characters allowed at each place.
        gaps: places before a word gap.
    """
    templates = line.templates
    middle = float(np.median(line.v_mm))
    reach = reach_of(templates, directions)
    amplitude = amplitude_of(line, cells, directions)
    bare = resampled_to(line)
    felt = np.asarray(bare.channels / np.float32(amplitude), dtype=np.float32)
    profile = ~is_edge_channel(directions)
    noise = np.maximum(robust_spread(felt), LEAST_NOISE * reach)
    # before the rim is padded: zeros would pass for the cleanest of the land
    cover = covered(felt, profile=profile, reach=reach, raised=line.raised, pixels_per_height=EVIDENCE_PIXELS)
    seen, rim = padded(bare, MARGIN_PIXELS), MARGIN_PIXELS
    felt = np.pad(felt, ((0, 0), (rim, rim), (rim, rim)))
    cover = np.pad(cover, rim, mode="edge")
    model = pixel_model(noise=noise, reach=reach, profile=profile, raised=line.raised)
    index = model.felt_index(felt, cover)
    straight = turned_templates(templates, directions, 0.0, reach)
    rows = _rows(middle, seen)
    cols = np.arange(felt.shape[2], dtype=np.int64)
    dense = dense_evidence(model, index, straight, reach, rows, cols)
    allowed = np.array([[c in place for c in templates.chars] for place in places], dtype=np.bool_)
    ideal = ideal_evidence(model, straight, reach)
    # what a template of full evidence earns is the length of line that it explains
    scale = float(np.median(ideal))
    reward = (dense.max(axis=1) / scale).astype(np.float32)
    _, placed = best_chain(
        reward, straight.half_cols, allowed=allowed, overlap=2, reach=int(GAP_HEIGHTS * EVIDENCE_PIXELS),
        gap_free=EVIDENCE_PIXELS // 2, gap_cost=0.01,
    )  # fmt: skip
    if not placed:
        return ()
    spacing = usual_spacing(placed, templates.chars, line.font, full=ideal / scale, gaps=gaps)
    if spacing is not None:
        # what is lost may lie anywhere: then the others' regular distance says where
        _, placed = best_chain(
            reward, straight.half_cols, allowed=allowed, overlap=2, reach=int(GAP_HEIGHTS * EVIDENCE_PIXELS),
            gap_free=EVIDENCE_PIXELS // 2, gap_cost=0.01, spacing=spacing,
        )  # fmt: skip
    bounds = place_bounds(placed, straight.half_cols, felt.shape[2])
    turned = {turn: turned_templates(templates, directions, turn, reach) for turn in TURNS_DEG}
    about = LineFelt(
        model=model,
        felt={share: model.felt_index(felt / np.float32(share), cover) for share in BLOWS},
        land=model.felt_index(np.zeros_like(felt), cover),
        rows=rows,
        straight=(straight, predicted_columns(model, straight)),
        turned={turn: (sparse, predicted_columns(model, sparse)) for turn, sparse in turned.items()},
        reach_px=ink_reach(straight, *turned.values()),
    )
    return tuple(
        place_evidence(p, low, high, about, templates, ideal, seen)
        for p, (low, high) in zip(placed, bounds, strict=True)
    )


def _rows(v_mm: float, seen: LineImage) -> NDArray[np.int64]:
    """Rows about the median of the search's characters."""
    row = round((v_mm - seen.origin_mm[1]) / seen.pitch_v_mm)
    return np.arange(row - ROW_REACH, row + ROW_REACH + 1, dtype=np.int64)
