"""Warn where a whisker bends so far that linear beam theory misses the exact force or moment."""

from __future__ import annotations

from whisker_array.whisker.elastica import ElasticaError, linear_error
from whisker_array.whisker.shapes import Whisker
from whisker_array.whisker.validity import DEFLECTION_LIMIT, LINEAR_ERROR_LIMIT, deflection_ratio


def linear_beam_warning(whisker: Whisker, *, lift_mm: float, mu: float) -> str:
    """Compare the linear beam (Assumption 1) with the exact bent shape on level surface.

    Solves a boundary value problem, some 10 ms.

    Args:
        whisker: a whisker that lies in the plane of tracing.
        lift_mm: how far the surface lifts the tip, mm: preload and height of marks above the land.
        mu: friction coefficient.

    Returns:
        A sentence; empty where force and moment are right within `LINEAR_ERROR_LIMIT` and the tip bends by no more
        than `DEFLECTION_LIMIT` of l1.

    Raises:
        WhiskerError: friction negative or not finite.
    """
    try:
        found = linear_error(whisker, lift_mm=lift_mm, mu=mu)
    except ElasticaError as error:
        return f"linear beam theory (Assumption 1) cannot be checked at a lift of {lift_mm:.3g} mm: {error}"
    ratio = deflection_ratio(whisker, preload_mm=lift_mm, mu=mu)
    if found.worst <= LINEAR_ERROR_LIMIT and ratio <= DEFLECTION_LIMIT:
        return ""
    return (
        f"at the largest lift, {lift_mm:.3g} mm, the tip bends by {100 * ratio:.1f} % of l1, and linear beam "
        f"theory (Assumption 1) is wrong by {100 * found.force:+.1f} % in force and "
        f"{100 * found.moment:+.1f} % in moment: lower the preload, or take a longer whisker or a smaller k"
    )
