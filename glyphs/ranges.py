"""Check that numbers are finite and within their range: one message for all."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import fields, is_dataclass

from glyphs.errors import MarksError

_LEAST_POSITIVE = math.nextafter(0.0, 1.0)
_MOST = sys.float_info.max


def require_range(
    error: Callable[..., MarksError],
    least: float,
    most: float,
    values: object = None,
    *names: str,
    hint: str = "",
    **numbers: float | tuple[float, ...] | None,
) -> None:
    """Check numbers; None and what is no number pass, and of a tuple every member is checked.

    Args:
        error: class of the error that is raised.
        least: smallest number allowed.
        most: largest number allowed.
        values: object whose attributes are checked.
        names: of these attributes; default: all fields of a dataclass.
        hint: what to do; default: the range in words.
        numbers: further numbers by name.

    Raises:
        MarksError: (as `error`) a number is not finite or out of range.
    """
    if is_dataclass(values) and not names:
        names = tuple(field.name for field in fields(values))
    for name, value in {**{name: getattr(values, name) for name in names}, **numbers}.items():
        for number in value if isinstance(value, tuple) else (value,):
            if isinstance(number, (int, float)) and not (math.isfinite(number) and least <= number <= most):
                raise error(f"{name} is {value}", hint=hint or f"it must lie between {least:g} and {most:g}")


def require_positive(
    error: Callable[..., MarksError], values: object = None, *names: str, **numbers: float | None
) -> None:
    """Check that numbers are finite and above 0; see `require_range`."""
    require_range(
        error, _LEAST_POSITIVE, _MOST, values, *names, hint="it must be positive and finite", **numbers
    )


def require_not_negative(
    error: Callable[..., MarksError], values: object = None, *names: str, **numbers: float | None
) -> None:
    """Check that numbers are finite and at least 0; see `require_range`."""
    require_range(error, 0.0, _MOST, values, *names, hint="it must be zero or positive", **numbers)


def require_finite(
    error: Callable[..., MarksError], values: object = None, *names: str, **numbers: float | None
) -> None:
    """Check that numbers are finite; see `require_range`."""
    require_range(error, -_MOST, _MOST, values, *names, hint="it must be finite", **numbers)
