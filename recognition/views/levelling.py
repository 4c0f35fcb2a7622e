"""Level a height map, as mounting on a stage would."""

from __future__ import annotations

import numpy as np

from glyphs.surface.maps import HeightMap
from recognition.views.levelling_fit import (
    BRACKET,
    Terms,
    median_near,
    tukey,
)


def level(height_map: HeightMap, *, degree: int = 2) -> HeightMap:
    """Remove tilt and slight dome: a robust polynomial through the land; dropouts stay NaN.

    Iteratively reweighted least squares with Tukey's biweight at three robust standard deviations, on a thinned
    grid. This mounts the part; it is no edge filter.
    """
    z = height_map.z_mm
    rows, cols = z.shape
    step = max(1, int(np.sqrt(z.size / 40_000)))
    thin = np.ascontiguousarray(z[::step, ::step], dtype=np.float64)
    row_terms, col_terms = np.linspace(-1.0, 1.0, rows), np.linspace(-1.0, 1.0, cols)
    terms = Terms(col_terms[::step], row_terms[::step], degree)
    known = np.isfinite(thin)
    all_known = bool(known.all())
    weight = known.astype(np.float64)
    weighted = np.where(known, thin, 0.0)
    middle = spread = 0.0
    for _ in range(12):
        normal = terms.normal(weight)
        normal[np.diag_indices_from(normal)] += 1e-10 * np.count_nonzero(known)
        coefficients = np.asarray(np.linalg.solve(normal, terms.right(weighted)))
        over = thin - terms.surface(coefficients)
        residual = over.ravel() if all_known else over[known]
        middle = median_near(residual, middle, BRACKET * spread)
        spread = 1.4826 * median_near(residual, spread / 1.4826, BRACKET * spread, about=middle)
        if spread <= 0.0:
            break
        weight, weighted = tukey(thin, over, middle, 3.0 * spread)
    out = z.copy()
    out -= terms.form(coefficients, col_terms, row_terms)
    out.flags.writeable = False  # so that it is not copied
    return HeightMap(out, height_map.pitch_mm)
