"""Compare the places of a line with many faces.

features of a line, library and named fonts --cosines, unmoved--> the nearest faces --cosines, moved--> FaceCosines
FaceCosines, recogniser, depths --`recognition.glyph_match.combine`--> the line with the posteriors of all
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from glyphs.fonts.glyph import Font
from recognition.glyph_match.combine import (
    NO_FACE,
    LineExperts,
    believe_faces,
    combine_experts,
    fitted_weights,
)
from recognition.glyph_match.face_library import Sense
from recognition.glyph_match.felt_line import FeltLine
from recognition.glyph_match.laid_line import depth_likelihoods
from recognition.glyph_match.prototypes import (
    FeatureMap,
    Floats,
    PlaceWindows,
    Prototypes,
    cosines,
    place_windows,
)
from recognition.language.lattice import Lattice
from recognition.recogniser.read_line import ReadLine, with_slip
from recognition.recogniser.recogniser import Features


@dataclass(frozen=True, eq=False)
class FaceCosines:
    """Cosines of the faces that are nearest to a line's."""

    names: tuple[str, ...]
    named: int
    # (F, places, C) greatest cosine of each character of the line's lattice; NaN of one that the face lacks
    # or the format forbids
    values: Floats

    def experts(self, network: Lattice) -> LineExperts:
        return LineExperts(network.log_belief, self.values, np.arange(len(self.names)) < self.named)

    @property
    def best_named(self) -> int:
        return int(self.fits[: self.named].argmax())

    @property
    def fits(self) -> Floats:
        """(F,) fit of each face: the mean over places of its greatest cosine."""
        return _fits(self.values)


def read_faces(
    line: ReadLine,
    cosines: FaceCosines,
    sense: Sense,
    *,
    felt: FeltLine | None = None,
    fonts: Sequence[Font] = (),
) -> ReadLine:
    """Read a line by recogniser and faces, and by the depths felt along the named font that fits best."""
    network, weights = line.by_expert["network"], fitted_weights(sense)
    experts = cosines.experts(network)
    belief = believe_faces(experts, weights)

    def together(experts: LineExperts) -> Lattice:
        return with_slip(replace(network, log_belief=combine_experts(experts, belief, weights)))

    lattice = together(experts)
    if felt is not None and cosines.named:
        best = cosines.best_named
        depths = depth_likelihoods(lattice, felt, fonts[best])
        lattice = together(replace(experts, depths=depths, depth_face=np.arange(len(cosines.names)) == best))
    probabilities = dict(zip((*cosines.names, NO_FACE), belief.faces.tolist(), strict=True))
    return line.with_faces(probabilities, replace(network, log_belief=np.minimum(belief.log, 0.0)), lattice)


def compare_faces(
    looks: Sequence[Features],
    columns: Floats,
    named: Sequence[Prototypes],
    library: Prototypes,
    map: FeatureMap,
    lattice: Lattice,
    *,
    nearest: int = 8,
) -> FaceCosines:
    """Compare a line with all faces, and with the nearest ones of the library once more, at moved places."""
    places = [place_windows(features, columns, map) for features in looks]
    coarse = _fits(_under_best_light(places, library, lattice, moved=False))
    chosen = [*named, library.of(np.argsort(-coarse)[:nearest])]
    values = np.concatenate([_under_best_light(places, faces, lattice) for faces in chosen])
    return FaceCosines(tuple(name for faces in chosen for name in faces.names), len(named), values)


def _fits(values: Floats) -> Floats:
    return np.asarray(np.fmax.reduce(values, axis=-1, initial=-1.0).mean(axis=-1))


def _under_best_light(
    places: Sequence[PlaceWindows], faces: Prototypes, lattice: Lattice, *, moved: bool = True
) -> Floats:
    """(F, places, C) cosines of faces (`FaceCosines`), each place in the view and light that show it best."""
    allowed = np.isfinite(lattice.log_belief)
    shared = [k for k, char in enumerate(faces.chars) if char in lattice.chars]
    to = [lattice.chars.index(faces.chars[k]) for k in shared]
    views = []
    for windows in places:
        aligned = np.full((*faces.numbers.shape[:2], *allowed.shape), np.nan)
        has = (faces.half[:, shared] > 0.0)[:, None, None]
        aligned[..., to] = np.where(has, cosines(windows, faces, moved=moved)[..., shared], np.nan)
        aligned[:, :, ~allowed] = np.nan
        best = _fits(aligned).argmax(axis=1)
        views.append(aligned[np.arange(len(best)), best])
    shown = np.fmax.reduce(views, axis=(1, 3), initial=-1.0).argmax(axis=0)
    return np.stack([views[view][:, place] for place, view in enumerate(shown)], axis=1)
