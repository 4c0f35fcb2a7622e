"""Check that numbers are finite and in range, with one wording for all messages.

class Camera(Validated, error=MapError):        a dataclass with a range beside each number
    pitch_mm: Positive = 0.06
    bloom: Share = 0.04
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields
from functools import cache
from typing import Annotated, Any, ClassVar, NamedTuple, get_args, get_type_hints

import numpy as np
from numpy.typing import NDArray

from glyphs.errors import MarksError


class Range(NamedTuple):
    """Range of a number, ends included; `hint` is shown with an error (default: the range in words)."""

    least: float
    most: float
    hint: str = ""


_MOST = sys.float_info.max
_POSITIVE = Range(math.nextafter(0.0, 1.0), _MOST, "it must be positive and finite")
_NOT_NEGATIVE = Range(0.0, _MOST, "it must be zero or positive")
Positive = Annotated[float, _POSITIVE]
NotNegative = Annotated[float, _NOT_NEGATIVE]
Count = Annotated[int, _NOT_NEGATIVE]
Finite = Annotated[float, Range(-_MOST, _MOST, "it must be finite")]
Share = Annotated[float, Range(0.0, 1.0)]
ShareBelowOne = Annotated[float, Range(0.0, math.nextafter(1.0, 0.0))]


def require_range(error: Callable[..., MarksError], limits: Range, **numbers: object) -> None:
    """Check numbers, also in tuples. Raises `error`: one is not finite or out of range."""
    least, most, hint = limits
    for name, value in numbers.items():
        for number in value if isinstance(value, tuple) else (value,):
            if isinstance(number, (int, float)) and not (math.isfinite(number) and least <= number <= most):
                raise error(f"{name} is {value}", hint=hint or f"it must lie between {least:g} and {most:g}")


def require_positive(error: Callable[..., MarksError], **numbers: float | None) -> None:
    """Check that numbers are finite and above 0; see `require_range`."""
    require_range(error, _POSITIVE, **numbers)


def require_not_negative(error: Callable[..., MarksError], **numbers: float | None) -> None:
    """Check that numbers are finite and at least 0; see `require_range`."""
    require_range(error, _NOT_NEGATIVE, **numbers)


class Validated:
    """Base of dataclasses that check numbers by their annotations: `class Camera(Validated, error=MapError)`."""

    _error: ClassVar[type[MarksError]] = MarksError

    def __init_subclass__(cls, *, error: type[MarksError] | None = None) -> None:
        cls._error = error or cls._error

    def __post_init__(self) -> None:
        for name, limits in _ranges(type(self)):  # type: ignore[arg-type]  # a class is a hashable argument
            require_range(self._error, limits, **{name: getattr(self, name)})


@cache
def _ranges(cls: type[Any]) -> tuple[tuple[str, Range], ...]:
    hints = get_type_hints(cls, include_extras=True)
    return tuple(
        (field.name, limits) for field in fields(cls) for limits in _ranges_within(hints[field.name])
    )


def _ranges_within(hint: object) -> Iterator[Range]:
    for part in get_args(hint):
        yield from (part,) if isinstance(part, Range) else _ranges_within(part)


def freeze_arrays(
    error: Callable[..., MarksError],
    values: object,
    shapes: Mapping[str, tuple[int | str, ...]],
    *,
    least: float = -math.inf,
    most: float = math.inf,
    dtype: type[np.floating[Any]] = np.float64,
) -> None:
    """Replace attributes of a frozen dataclass by read-only copies; raises `error` for a wrong shape or range."""
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
