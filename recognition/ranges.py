"""Ranges of the numbers that searches and limits may be given; pydantic refuses others with a `ValueError`."""

from __future__ import annotations

from typing import Annotated, TypeAlias

from pydantic import Field, PositiveFloat

Share: TypeAlias = Annotated[float, Field(ge=0.0, le=1.0, allow_inf_nan=False)]
"""From 0 to 1."""
Chance: TypeAlias = Annotated[float, Field(gt=0.0, le=1.0, allow_inf_nan=False)]
"""Above 0 and at most 1."""
Percent: TypeAlias = Annotated[float, Field(ge=0.0, le=100.0, allow_inf_nan=False)]
"""From 0 to 100."""
Ratio: TypeAlias = Annotated[float, Field(gt=1.0)]
"""Above 1."""
Angles: TypeAlias = Annotated[tuple[float, ...], Field(min_length=1)]
"""One at least."""
Factors: TypeAlias = Annotated[tuple[PositiveFloat, ...], Field(min_length=1)]
"""One at least, all above 0."""
ThreeOrMore: TypeAlias = Annotated[int, Field(ge=3)]
"""As many points as a plane needs."""
GradeValue: TypeAlias = Annotated[int, Field(ge=0, le=4)]
"""From 0, the worst, to 4."""
