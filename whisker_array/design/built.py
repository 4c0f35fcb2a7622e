"""Figures of a whisker that is built for a request: those by which one is designed."""

from __future__ import annotations

import math

from whisker_array.design.design import worst_edge
from whisker_array.design.limits import DesignError, Request
from whisker_array.identification.predictions import Quantity
from whisker_array.whisker.shapes import LShaped
from whisker_array.whisker.touch import Touch


def fitness(request: Request) -> dict[str, Quantity]:
    """Figures by what they are called; NaN where the whisker jams on a wall of the request."""

    def contrast(whisker: LShaped, touch: Touch) -> float:
        return worst_edge(whisker, request, preload_mm=touch.preload_mm)[0].contrast

    def factor(end: int) -> Quantity:
        return lambda whisker, touch: worst_edge(whisker, request, preload_mm=touch.preload_mm)[1][end]

    def or_jams(quantity: Quantity) -> Quantity:
        def of(whisker: LShaped, touch: Touch) -> float:
            try:
                return quantity(whisker, touch)
            except DesignError:
                return math.nan

        return of

    return {
        "worst edge contrast": or_jams(contrast),
        "F over all walls, least": or_jams(factor(0)),
        "F over all walls, greatest": or_jams(factor(1)),
    }
