"""Evidence from felt strokes, for the character that was read and against its rivals.

    R read, P its rival                             felt    missing
      .--.       P       .--.     R has, P has not     \\     against P, for P
      |__|               |__|     P has, R has not     -     nothing
      |  \\              |

Both characters are laid over the surface where each lies deepest. Nobody needs to name the font, because the strokes
that distinguish two characters hardly depend on it. A felt piece of a stroke supports the characters that contain it.
A missing piece counts against them, but never fully: it may be filled with dirt. That is the likelier, the more of the
line's other strokes is missing. Where the surface rises above the land, or was not scanned, there is no evidence.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from pydantic import PositiveFloat
from pydantic.dataclasses import dataclass as checked

from glyphs.fonts.glyph import Font
from recognition.language.confusions import SWAP_SETS
from recognition.language.lattice import Lattice
from recognition.lines.places import boxes_of, places_mm
from recognition.marks.depth_sampling import DepthField
from recognition.marks.laid_strokes import (
    POSE_SEARCH,
    STROKE_LIMITS,
    LaidCharacter,
    PlacesFelt,
    PoseSearch,
    StrokeLimits,
)
from recognition.ranges import Chance
from recognition.views.text_line import HEIGHT_ROWS, MARGIN, TextLine
from whisker_array.estimation.relief import Relief

LIVE = 0.004
"""Probability of a rival from which strokes must exclude it."""
Floats = NDArray[np.float64]


@checked(frozen=True)
class StrokeEvidence:
    """Evidence from felt and missing pieces of strokes.

    Attributes:
        piece_heights: length of the pieces of a stroke that are felt or filled independently, character heights.
        falsely_felt: probability that a piece seems to be felt where there is none: a scratch, or other strokes in the
            part's font.
        filled: probability that a piece is filled if no stroke of the line is missing.
        filled_of_missing: increase of that probability with the missing share of the line's strokes.
        most_filled: greatest such probability.
        most_absent: most evidence of all missing pieces against a character, nats: absence never excludes it fully.

    Raises:
        ValueError: a number out of its range.
    """

    piece_heights: PositiveFloat = 0.25
    falsely_felt: Chance = 0.05
    filled: Chance = 0.03
    filled_of_missing: float = 0.8
    most_filled: Chance = 0.7
    most_absent: float = 6.0


STROKE_EVIDENCE = StrokeEvidence()


@dataclass(frozen=True)
class RivalStrokes:
    """Evidence from strokes against a rival at a place.

    Attributes:
        char: the rival character.
        belief: probability of the rival without the evidence of strokes.
        margin: evidence of the strokes for the character that was read, nats; negative if it supports the rival.
        apart_heights: length of the strokes that only one of the two has, character heights.
        more_heights: length of the strokes that only the rival has, character heights.
        hidden: share of `more_heights` where nothing could be felt.
    """

    char: str
    belief: float
    margin: float
    apart_heights: float
    more_heights: float
    hidden: float

    @property
    def excluded_nats(self) -> float:
        """Evidence from posterior and strokes together for the character that was read, nats."""
        return self.margin - math.log(max(self.belief, 1e-12))


@dataclass(frozen=True)
class PlaceStrokes:
    """Felt strokes of the character that was read at a place.

    Attributes:
        felt: share of its strokes that was felt, in the best-fitting font; None if no font has the character.
        score: how well its strokes match the deepest parts of the place, at most 1.
        font: name of the best-fitting font.
        rivals: characters that the format allows and that are probable, or listed as easily confused with this one.
        whole: whether the surface was felt from edge to edge of the character.
        too_few_lines: why the scan lines cannot distinguish the character from its rivals; empty if they can.
    """

    felt: float | None
    score: float = 0.0
    font: str = ""
    rivals: tuple[RivalStrokes, ...] = ()
    whole: bool = True
    too_few_lines: str = ""


@dataclass(frozen=True, eq=False)
class FeltLine:
    """A felt line in which the strokes of characters are compared with the surface.

    Attributes:
        relief: the felt surface.
        line: position of the text.
        columns: columns of the places in the line's strip.
        raised: whether the marks are raised.
        fonts: fonts whose strokes are compared.
        poses: poses in which their characters are tried.
        limits: limits from which a stroke counts as felt.
        edge_heights: strip on each side of a place's box that may be land, character heights. Boxes at a line's ends
            are 0.84 heights wide, characters 0.5 to 0.7.
        least_fit: mean score of the places that another height of the line, or ridges for grooves, must reach. The
            exam's lines score at most 0.61 if made half too high.
    """

    relief: Relief
    line: TextLine
    columns: Floats
    raised: bool
    fonts: tuple[Font, ...]
    poses: PoseSearch = POSE_SEARCH
    limits: StrokeLimits = STROKE_LIMITS
    edge_heights: float = 0.15
    least_fit: float = 0.45

    def strokes(
        self,
        text: Sequence[str],
        lattice: Lattice,
        *,
        slope: float = 1.0,
        evidence: StrokeEvidence = STROKE_EVIDENCE,
    ) -> tuple[PlaceStrokes, ...]:
        """Compute the felt strokes of the characters that were read and of their rivals.

        Args:
            text: one character for each place.
            lattice: probabilities of all characters that may stand at each place.
            slope: calibration slope of the probabilities, in log odds (`recognition.decision.score`).
            evidence: evidence from pieces of strokes.
        """
        if len(text) != self.columns.size or lattice.n_places != len(text):
            return ()
        places = self.places
        best = [places.best_font(k, char, self.fonts) for k, char in enumerate(text)]
        missing = [1.0 - one[1].share_felt() for one in best if one is not None]
        share_missing = float(np.mean(missing or [0.0]))
        filled = min(evidence.filled + evidence.filled_of_missing * share_missing, evidence.most_filled)
        made = []
        for k, (char, one) in enumerate(zip(text, best, strict=True)):
            if one is None:
                made.append(PlaceStrokes(None, whole=self.whole[k]))
                continue
            font, laid = one
            rivals = tuple(
                _compare_strokes(places, laid, places.lay(k, rival, font), rival, filled, belief, evidence)
                for rival, belief in _rivals(char, lattice.chars, _calibrated(lattice.log_belief[k], slope))
                if rival in font.glyphs
            )
            made.append(PlaceStrokes(laid.share_felt(), laid.score, font.name, rivals, self.whole[k]))
        return tuple(made)

    def by_font(self, text: Sequence[str]) -> dict[str, float]:
        """Return the mean score of a text over its places, for each font that has all its characters."""
        return dict(self._mean_scores(text))

    def _mean_scores(self, text: Sequence[str]) -> Iterator[tuple[str, float]]:
        for font in self.fonts if len(text) == self.columns.size else ():
            if all(c in font.glyphs for c in text):
                scores = [self.places.lay(k, char, font).score for k, char in enumerate(text)]
                yield font.name, float(np.mean(scores))

    def stands_out(self, text: Sequence[str]) -> bool | None:
        """Whether the strokes of a text are ridges rather than grooves; None if no font has all its characters.

        Strokes are laid over the relief and over its negative. Ridges must reach the score of felt strokes: under dirt
        a badly read text fits neither way, and dies normally strike grooves.
        """
        ridges, grooves = (replace(self, raised=raised)._mean_score(text) for raised in (True, False))
        return ridges > max(grooves, self.least_fit) if math.isfinite(ridges + grooves) else None

    def fit_size(
        self,
        text: Sequence[str],
        *,
        good_fit: float = 0.6,
        least_gain: float = 0.08,
        factors: Sequence[float] = (0.66, 0.57, 0.76, 0.87),
    ) -> FeltLine:
        """Return the line at the height at which the strokes of its text fit best; its places stay where they are.

        A recogniser reads a line that was found half too high as well as any other, but its strokes miss the grooves.

        Args:
            text: one character for each place.
            good_fit: mean score of the places from which the line keeps the height at which it was found.
            least_gain: least gain in score over the height found.
            factors: factors of the height found that are tried instead; if the first brings no gain, the others are
                skipped.
        """
        best, most = self, self._mean_score(text)
        if most >= good_fit:
            return self
        least = most + least_gain
        for factor in factors:
            tried = self._at_height(factor * self.line.height_mm)
            score = tried._mean_score(text)
            if score > max(most, least):
                best, most = tried, score
            elif best is self:
                break
        return best if most >= self.least_fit else self

    def _mean_score(self, text: Sequence[str]) -> float:
        """Compute the mean score of a text in the first font with all its characters, to compare heights."""
        return next(self._mean_scores(text), ("", math.inf))[1]

    def _at_height(self, height_mm: float) -> FeltLine:
        along = self.line.height_mm * ((self.columns + 0.5) / HEIGHT_ROWS - MARGIN)
        columns = (along / height_mm + MARGIN) * HEIGHT_ROWS - 0.5
        return replace(self, line=TextLine(self.line.centre_mm, height_mm), columns=columns)

    @cached_property
    def whole(self) -> tuple[bool, ...]:
        """Whether the scan covers each place's character from edge to edge, in x and in y.

        Only the ends of the scan lines matter here, not covered or missing samples within them.
        """
        known, pitch = np.isfinite(self.relief.height_mm), self.relief.pitch_mm
        spans = [np.flatnonzero(known.any(axis=axis)) for axis in (0, 1)]
        if not spans[0].size:
            return (False,) * self.columns.size
        ends = [
            (o + pitch * s[0], o + pitch * s[-1]) for o, s in zip(self.relief.origin_mm, spans, strict=True)
        ]
        spare = self.edge_heights * self.line.height_mm
        return tuple(
            ends[0][0] <= box.x0_mm + spare
            and box.x1_mm - spare <= ends[0][1]
            and ends[1][0] <= box.y0_mm + spare
            and box.y1_mm - spare <= ends[1][1]
            for box in boxes_of(self.line, self.columns)
        )

    @cached_property
    def places(self) -> PlacesFelt:
        """The surface around the places of the line."""
        field = DepthField(self.relief, raised=self.raised)
        at = places_mm(self.line, self.columns)
        ahead = places_mm(self.line, self.columns + 1.0) - at
        middles = (at[:, ::-1] - np.array(field.origin_mm)[::-1]) / field.pitch_mm
        turns_deg = np.degrees(np.arctan2(ahead[:, 1], ahead[:, 0]))
        return PlacesFelt(
            field,
            middles,
            turns_deg,
            height_mm=self.line.height_mm,
            poses=self.poses,
            limits=self.limits,
        )


def _calibrated(log_belief: Floats, slope: float) -> Floats:
    """Calibrate the probabilities of a place's characters by the slope, keeping their sum."""
    total = np.logaddexp.reduce(log_belief)
    power = slope * (log_belief - total)
    return np.asarray(np.exp(power - np.logaddexp.reduce(power) + total))


def _rivals(char: str, chars: Sequence[str], beliefs: Floats) -> list[tuple[str, float]]:
    """List the probable rivals, and the declared ones that the format allows."""
    declared = {c for chars in SWAP_SETS if char in chars for c in chars}
    return [
        (c, float(b))
        for c, b in zip(chars, beliefs, strict=True)
        if c != char and (b >= LIVE or (c in declared and b > 0.0))
    ]


def _compare_strokes(
    places: PlacesFelt,
    read: LaidCharacter,
    rival: LaidCharacter,
    char: str,
    filled: float,
    belief: float,
    evidence: StrokeEvidence,
) -> RivalStrokes:
    own, theirs = places.apart(read, rival), places.apart(rival, read)
    felt, absent = -math.log(evidence.falsely_felt), -math.log(filled)
    step = places.limits.step_heights
    pieces = step / evidence.piece_heights

    def count_pieces(laid: LaidCharacter, only: NDArray[np.bool_], felt: bool) -> float:
        return pieces * float((only & laid.open & (laid.felt == felt)).sum())

    margin = felt * (count_pieces(read, own, True) - count_pieces(rival, theirs, True))
    margin += min(absent * count_pieces(rival, theirs, False), evidence.most_absent)
    margin -= min(absent * count_pieces(read, own, False), evidence.most_absent)
    return RivalStrokes(
        char=char,
        belief=belief,
        margin=float(margin),
        apart_heights=float(own.sum() + theirs.sum()) * step,
        more_heights=float(theirs.sum()) * step,
        hidden=float((theirs & ~rival.open).sum() / max(theirs.sum(), 1)),
    )
