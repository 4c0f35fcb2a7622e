"""Check that numbers are finite and in range, with one wording for all messages."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

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
    """Check that numbers are finite and in range. Every member of a tuple is checked; other types pass.

    Args:
        error: class of the error that is raised.
        least: smallest number allowed.
        most: largest number allowed.
        values: object whose attributes are checked.
        names: names of these attributes; default: all fields of a dataclass.
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


def freeze_arrays(
    error: Callable[..., MarksError],
    values: object,
    shapes: Mapping[str, tuple[int | str, ...]],
    *,
    least: float = -math.inf,
    most: float = math.inf,
    dtype: type[np.floating[Any]] = np.float64,
) -> None:
    """Replace attributes of a frozen dataclass by read-only copies, checked for shape and range.

    Args:
        error: class of the error that is raised.
        values: the dataclass.
        shapes: attributes and their shapes; the same letter stands for the same length.
        least: smallest number allowed.
        most: largest number allowed.
        dtype: type of the copies.

    Raises:
        MarksError: (as `error`) a shape is wrong, or a number is not finite or out of range.
    """
    lengths: dict[str, int] = {}
    for name, shape in shapes.items():
        array: NDArray[Any] = np.array(getattr(values, name), dtype=dtype)
        pairs = zip(shape, array.shape, strict=False)
        wanted = [lengths.setdefault(n, have) if isinstance(n, str) else n for n, have in pairs]
        if array.shape != tuple(wanted) or array.ndim != len(shape):
            raise error(
                f"{name} has shape {array.shape}", hint=f"it must be {shape} {lengths or ''}".rstrip()
            )
        if not (np.isfinite(array).all() and (array >= least).all() and (array <= most).all()):
            span = f" and between {least:g} and {most:g}" if math.isfinite(least) else ""
            raise error(f"{name} has values out of range", hint=f"they must be finite{span}")
        array.flags.writeable = False
        object.__setattr__(values, name, array)
