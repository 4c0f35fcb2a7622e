"""Types of flags that several commands have; the enums themselves are too heavy for help."""

from __future__ import annotations

from typing import Annotated, Literal

from cyclopts import Parameter
from cyclopts.validators import Number

FidelityName = Literal["pointwise", "contact"]
Flag = Annotated[bool, Parameter(negative="")]
"""A flag without a negative form (default: off)."""
Positive = Annotated[int | None, Parameter(validator=Number(gte=1))]
Jobs = Annotated[int, Parameter(validator=Number(gte=1))]
