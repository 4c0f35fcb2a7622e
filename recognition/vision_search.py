"""A line of known letters in a photograph, whatever the light: the templates' engine.

For a supposed height and rotation the log brightness is brought to a line frame of a few pixels to the height (`Look`);
correlations with the three pictures of every character are taken once, and every light is a weighted sum of them.
The weights that explain the line best, by least squares over its characters, hold for the whole line.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from glyphs.camera.photo import Photo
from recognition.vision_answers import VisionAnswers, column_evidence, row_promise
from recognition.vision_chain import Metrics, Settled, count_evidence, settle
from recognition.vision_edges import clipped, derivatives, limited, log_brightness
from recognition.vision_fit import Supposed, VisionFit
from recognition.vision_frame import LinePlace, photo_origin_mm, photo_pitch_mm
from recognition.vision_templates import Look, VisionBasis

AZIMUTHS = 8
ROW_REACH_HEIGHTS = 0.1
"""By which characters may leave the common line, character heights."""
STARTS, ROUNDS = 3, 2
"""Lights and rows followed up, and rounds of fitting the light."""
MOST_CHARACTERS = 20
PAD = 8

Floats = NDArray[np.float64]


class VisionSearch:
    """Fits suppositions to one photograph, or to a part of it."""

    def __init__(
        self,
        photo: Photo,
        *,
        places: Sequence[str] | None,
        gaps: frozenset[int] = frozenset(),
        about: LinePlace | None = None,
        contrast: bool = False,
    ) -> None:
        """Prepare.

        Args:
            photo: to be searched.
            places: characters allowed at each place of a known format, or None.
            gaps: places after which a word gap lies.
            about: where the line lies about; the search keeps to a height around it.
            contrast: as `log_brightness`.
        """
        self.places, self.gaps, self.about = places, gaps, about
        self.log = log_brightness(photo, contrast=contrast)
        self.blind = clipped(photo).astype(np.float32)
        self.any_blind = bool(self.blind.any())
        self._fits: dict[tuple[int, Supposed, bytes], VisionFit | None] = {}
        self.pitch_mm, self.origin = photo_pitch_mm(photo), photo_origin_mm(photo)
        rows, cols = photo.shape
        if about is None:
            self.middle_mm = (
                self.origin[0] + 0.5 * (cols - 1) * self.pitch_mm,
                self.origin[1] + 0.5 * (rows - 1) * self.pitch_mm,
            )
            self.extent_mm = (cols * self.pitch_mm, rows * self.pitch_mm)
        else:
            self.middle_mm = about.middle_mm
            self.extent_mm = (about.width_mm + 1.6 * about.height_mm, 2.0 * about.height_mm)

    def edges(self, supposed: Supposed, look: Look) -> NDArray[np.float32]:
        """(2, rows, cols) limited edges in the line frame, with land around them."""
        from glyphs.opencv import cv2

        size = supposed.height_mm / look.pixels
        angle = math.radians(supposed.rotation_deg)
        cos, sin = math.cos(angle), math.sin(angle)
        wide, tall = self.extent_mm
        if self.about is None:
            wide, tall = wide * abs(cos) + tall * abs(sin), tall * abs(cos) + wide * abs(sin)
        cols, rows = max(8, math.ceil(wide / size)), max(8, math.ceil(tall / size))
        zoom = size / self.pitch_mm
        mid = (
            (self.middle_mm[0] - self.origin[0]) / self.pitch_mm,
            (self.middle_mm[1] - self.origin[1]) / self.pitch_mm,
        )
        u0, v0 = 0.5 * (cols - 1), 0.5 * (rows - 1)
        to_photo = np.array(
            [
                [zoom * cos, -zoom * sin, mid[0] - zoom * (cos * u0 - sin * v0)],
                [zoom * sin, zoom * cos, mid[1] - zoom * (sin * u0 + cos * v0)],
            ]
        )
        blur = 0.35 * zoom
        layers = []
        # beyond the photograph nothing is seen
        shown = np.ones(self.log.shape, dtype=np.float32)
        for image, rim in (
            (self.log, cv2.BORDER_REPLICATE),
            (self.blind, cv2.BORDER_REPLICATE),
            (shown, cv2.BORDER_CONSTANT),
        ):
            if image is self.blind and not self.any_blind:
                layers.append(np.zeros((rows, cols), dtype=np.float32))
                continue
            seen = cv2.GaussianBlur(image, (0, 0), blur) if zoom > 1.2 else image
            layers.append(
                np.asarray(
                    cv2.warpAffine(
                        seen,
                        to_photo,
                        (cols, rows),
                        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
                        borderMode=rim,
                    ),
                    dtype=np.float32,
                )
            )
        made = derivatives(layers[0], scale_px=look.scale_heights * look.pixels)
        # the rim of the photograph is an edge of no mark
        reach = 2 * math.ceil(2.0 * look.scale_heights * look.pixels) + 1
        inside = np.asarray(cv2.erode(layers[2], np.ones((reach, reach), dtype=np.uint8)))
        made = limited(made, valid=(layers[1] < 0.5) & (inside > 0.5))
        return np.pad(made, ((0, 0), (PAD, PAD), (PAD, PAD))).astype(np.float32)

    def fit(self, basis: VisionBasis, supposed: Supposed, *, light: Floats | None = None) -> VisionFit | None:
        """The line that a supposition explains; None where it has no room.

        Args:
            basis: of a font.
            supposed: height and rotation.
            light: weights of the pictures, if known about; else all lights are tried.
        """
        edges = self.edges(supposed, basis.look)
        answers = VisionAnswers(edges, basis)
        reach = _reach(basis.look)
        best: VisionFit | None = None
        starts, pictures = self._starts(answers, basis, light)
        for start, row in starts:
            low, high = max(0, row - reach), min(row + reach + 1, answers.rows)
            near = answers.pictures(low, high) if pictures is None else pictures[..., low:high]
            found = self._followed(near, basis, start, low, supposed, edges.shape[1:])
            if found is not None and (best is None or found.value > best.value):
                best = found
        return best

    def _starts(
        self, answers: VisionAnswers, basis: VisionBasis, light: Floats | None
    ) -> tuple[list[tuple[Floats, int]], NDArray[np.float32] | None]:
        """Lights and rows that promise most; the products with all pictures, if they were needed for it."""
        usable = np.ones(len(basis.chars), dtype=np.bool_)
        if self.places is not None:
            usable = np.array([any(c in p for p in self.places) for c in basis.chars])
        tried = np.array(lights() if light is None else [light])
        size = np.sqrt(np.einsum("tbe,nb,ne->nt", basis.gram, tried, tried, optimize=True))
        if light is None:
            pictures = answers.pictures(0, answers.rows)
            scale = tried[:, None, :] / size[:, :, None]
        else:
            pictures = None
            scale = 1.0 / size[:, :, None]
        asked = answers.lit(light)[None] if light is not None else pictures
        assert asked is not None
        promise = row_promise(asked, np.where(usable[:, None], scale, 0.0))
        box = np.ones(2 * _reach(basis.look) + 1)
        pooled = [np.convolve(p, box, mode="same") for p in promise]
        found = [(float(p.max()), start, int(p.argmax())) for p, start in zip(pooled, tried, strict=True)]
        found.sort(key=lambda f: -f[0])
        return [(start, row) for _, start, row in found[:STARTS]], pictures

    def _followed(
        self,
        near: NDArray[np.float32],
        basis: VisionBasis,
        light: Floats,
        low: int,
        supposed: Supposed,
        shape: tuple[int, ...],
    ) -> VisionFit | None:
        """The line about one row, its light and spacing fitted to it in turns.

        `near` are (3, cols, T, rows) products with the pictures about that row, from row `low` on.
        """
        p, independence = basis.look.pixels, basis.look.independence
        metrics = Metrics(
            np.round(basis.middle * p).astype(np.int64), np.round(basis.advance * p).astype(np.int64), p
        )
        near = np.ascontiguousarray(near)
        allowed: NDArray[np.bool_] | None = None
        if self.places is not None:
            allowed = np.array([[c in place for c in basis.chars] for place in self.places])
        gap: float | None = None
        weights = light
        found: tuple[Settled, Floats, NDArray[np.int64], NDArray[np.int64]] | None = None
        for turn in range(ROUNDS + 1):
            power = _power(basis, weights)
            evidence, score = column_evidence(near, weights, power, independence, squared=turn == 0)
            table = allowed
            if table is None:
                most = min(MOST_CHARACTERS, max(1, evidence.shape[1] // (p // 3)))
                n = int(count_evidence(evidence, metrics, most=most, gap_heights=gap).argmax())
                table = np.ones((max(n, 1), len(basis.chars)), dtype=np.bool_)
            settled = settle(evidence, metrics, table, gap_heights=gap, word_gaps=self.gaps)
            if settled is None:
                return None
            which = settled.log_belief.argmax(axis=1)
            column = settled.column[np.arange(which.size), which]
            rows = score[which, column].argmax(axis=1)
            found = (settled, weights, column, rows)
            seen = near[:, column, which, rows].sum(axis=1, dtype=np.float64)
            weights = np.linalg.solve(basis.gram[which].sum(axis=0) + np.eye(3), seen)
            gap = _spacing(basis, which, column, self.gaps)
        assert found is not None
        settled, weights, column, rows = found
        which = settled.log_belief.argmax(axis=1)
        odds = np.clip(evidence[which, column] - math.log(len(basis.chars)), -50.0, 50.0)
        trust = 1.0 / (1.0 + np.exp(-odds))
        return VisionFit(
            supposed=supposed,
            basis=basis,
            settled=settled,
            light=weights,
            trust=trust,
            column=column,
            row=low + rows,
            origin_mm=self.middle_mm,
            middle_px=(0.5 * (shape[1] - 1), 0.5 * (shape[0] - 1)),
        )

    def refined(self, fit: VisionFit, *, spans: Sequence[float] = (0.05, 0.025)) -> VisionFit:
        """Take up the rotation that is left and vary the height while the fit improves."""
        best = fit
        for span in spans:
            slope = best.slope_deg()
            if abs(slope) > 0.2:
                best = self._better(best, rotation_deg=best.supposed.rotation_deg + slope)
            for factor in (1.0 + span, 1.0 / (1.0 + span)):
                tried = self._better(best, height_mm=best.supposed.height_mm * factor)
                if tried is not best:
                    best = tried
                    break
        return best

    def _better(self, held: VisionFit, **changes: float) -> VisionFit:
        supposed = replace(held.supposed, **changes)
        # the same is asked again where nothing was better
        key = (id(held.basis), supposed, held.light.tobytes())
        if key not in self._fits:
            self._fits[key] = self.fit(held.basis, supposed, light=held.light)
        fit = self._fits[key]
        return fit if fit is not None and fit.value > held.value else held


def _reach(look: Look) -> int:
    return max(1, round(ROW_REACH_HEIGHTS * look.pixels))


def lights() -> list[Floats]:
    """Lamps all round, and strokes darker or brighter than the land."""
    around = np.arange(AZIMUTHS) * 2.0 * math.pi / AZIMUTHS
    made = [np.array([math.cos(a), math.sin(a), 0.0]) for a in around]
    return [*made, np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, -1.0])]


def _spacing(
    basis: VisionBasis, which: NDArray[np.int64], column: NDArray[np.int64], gaps: frozenset[int]
) -> float | None:
    """Median spacing beyond the font's advance, character heights."""
    if which.size < 3:
        return None
    origin = column / basis.look.pixels - basis.middle[which]
    gap = origin[1:] - (origin[:-1] + basis.advance[which[:-1]])
    usual = [g for k, g in enumerate(gap) if k not in gaps]
    return float(np.median(usual)) if usual else None


def _power(basis: VisionBasis, weights: Floats) -> Floats:
    """(T,) square of each character in one light."""
    return np.asarray((basis.gram @ weights) @ weights)
