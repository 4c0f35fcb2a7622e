"""The library of faces: prototypes of many faces, so that the shapes of characters count although no font is named.
`python -m recognition.learning.face_library FONTS` chooses and predicts them; `face_library.fit.json` lists them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Literal

import numpy as np

from recognition.glyph_match.prototypes import FeatureMap, Prototypes

LIBRARY = Path(__file__).with_name("face_library.npz")
Sense = Literal["tactile", "vision"]


@dataclass(frozen=True, eq=False)
class FaceLibrary:
    """Prototypes of the library by one sense, and the map that they share with all others of that sense."""

    map: FeatureMap
    faces: Prototypes


@cache
def face_library(sense: Sense) -> FaceLibrary:
    """Load the library for a sense."""
    with np.load(LIBRARY) as file:
        names, chars, half = (file[name] for name in ("names", "chars", "half"))
        arrays = {
            name: file[f"{sense}_{name}"].astype(np.float32)
            for name in ("numbers", "mean", "spread", "of_step", "of_window")
        }
    faces = Prototypes(
        tuple(names.tolist()), tuple(chars.tolist()), arrays.pop("numbers"), half.astype(np.float32)
    )
    return FaceLibrary(FeatureMap(**arrays), faces)
