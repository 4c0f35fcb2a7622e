"""What every template explains of one place of a dirty line: struck deep or less so, shifted and turned a little."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recognition.experts.templates.decode import Placed
from recognition.experts.templates.frames import LineImage
from recognition.experts.templates.pixel_model import PixelModel
from recognition.experts.templates.predicted import TemplateSet
from recognition.experts.templates.sparse_templates import EVIDENCE_PIXELS, EvidenceField, SparseTemplates

TURNED_LEADERS = 6
SHIFT = 2


@dataclass(frozen=True, eq=False)
class PlaceEvidence:
    """One place of the line.

    Attributes:
        evidence: (T,) of every template, its best shift and turn.
        ideal: (T,) what each would have if it stood there clean.
        u_mm, v_mm: where the best template's reference point lies, line frame.
        turn_deg: its turn against the line.
        half_width_mm: half its ink.
    """

    evidence: NDArray[np.float64]
    ideal: NDArray[np.float64]
    u_mm: float
    v_mm: float
    turn_deg: float
    half_width_mm: float


@dataclass(frozen=True, eq=False)
class LineFelt:
    """What is the same at all places of a line.

    Attributes:
        model: of pixels.
        felt: where its rows begin in the model's table, by how deep the blow was.
        land: the same of bare land.
        rows: of the line.
        straight, turned: templates, by turn, and what they predict.
        reach_px: rows and columns that their ink lies from the reference point.
    """

    model: PixelModel
    felt: dict[float, NDArray[np.int32]]
    land: NDArray[np.int32]
    rows: NDArray[np.int64]
    straight: tuple[SparseTemplates, NDArray[np.int32]]
    turned: dict[float, tuple[SparseTemplates, NDArray[np.int32]]]
    reach_px: tuple[int, int]


def place_evidence(
    placed: Placed,
    low: int,
    high: int,
    about: LineFelt,
    templates: TemplateSet,
    ideal: NDArray[np.float64],
    seen: LineImage,
) -> PlaceEvidence:
    """Every template about the place of the chain's, struck as deep as others or less, the leaders turned as well.

    What lies beyond the place is its neighbours' and counts as bare land.
    """
    rows, (straight, level) = about.rows, about.straight
    # a wrong template may have been placed, whose ink lies elsewhere about its middle than the right one's
    middles = 0.5 * (low + high - 1)
    wide = EVIDENCE_PIXELS // 5
    cols = np.arange(min(placed.column, round(middles)) - wide, max(placed.column, round(middles)) + wide + 1)
    count = straight.start.size - 1
    evidence = np.full(count, -np.inf)
    turns, deep = np.zeros(count), np.ones(count)
    place_row, place_col = np.zeros(count, dtype=np.int64), np.zeros(count, dtype=np.int64)
    fields = {}
    for share in about.felt:
        own = about.land.copy()
        own[:, :, low:high] = about.felt[share][:, :, low:high]
        reach_px = (about.reach_px[0] + SHIFT, about.reach_px[1] + SHIFT)
        fields[share] = EvidenceField(about.model, own, rows, cols, reach_px=reach_px)
        flat = fields[share].sums(straight, level, rows, cols).reshape(count, -1)
        best, top = flat.argmax(axis=1), flat.max(axis=1)
        better = top > evidence
        evidence[better], deep[better] = top[better], share
        place_row[better], place_col[better] = rows[best[better] // cols.size], cols[best[better] % cols.size]
    near = np.arange(-SHIFT, SHIFT + 1)
    for turn, (sparse, turned_level) in about.turned.items():
        for t in np.argsort(-evidence)[:TURNED_LEADERS]:
            field = fields[float(deep[t])]
            most = float(
                field.sums(sparse, turned_level, place_row[t] + near, place_col[t] + near, only=t).max()
            )
            if most > evidence[t]:
                evidence[t], turns[t] = most, turn
    winner = int(np.argmax(evidence))
    half = float(templates.half_width[winner])
    r, c = int(place_row[winner]), int(place_col[winner])
    return PlaceEvidence(
        evidence=evidence,
        ideal=ideal,
        u_mm=seen.origin_mm[0] + c * seen.pitch_u_mm,
        v_mm=seen.origin_mm[1] + r * seen.pitch_v_mm,
        turn_deg=float(turns[winner]),
        half_width_mm=half * EVIDENCE_PIXELS * seen.pitch_u_mm,
    )
