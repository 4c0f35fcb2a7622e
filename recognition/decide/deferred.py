"""Fields of dataclasses that are computed when they are first read.

Depths, grades and strokes take longer than the reading, and few callers need them. They depend on the evidence alone.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TypeVar, cast

T = TypeVar("T")


class _Deferred(partial[T]):
    def __reduce__(self) -> tuple[Callable[[T], T], tuple[T]]:
        return _same, (self(),)


def _same(value: T) -> T:
    return value


def deferred(compute: Callable[[], T]) -> T:
    """A value for a `deferrable` field: it is computed when the field is first read."""
    return cast(T, _Deferred(compute))


class _DeferrableField:
    def __init__(self, name: str, default: object) -> None:
        self._name, self._default = name, default

    def __get__(self, instance: object | None, owner: type) -> object:
        if instance is None:
            return self._default
        value = vars(instance)[self._name]
        if isinstance(value, _Deferred):
            value = vars(instance)[self._name] = value()
        return value

    def __set__(self, instance: object, value: object) -> None:
        vars(instance)[self._name] = value


def deferrable(*names: str) -> Callable[[type[T]], type[T]]:
    """Let fields of a dataclass take `deferred` values; they have defaults."""

    def prepare(kind: type[T]) -> type[T]:
        for name in names:
            setattr(kind, name, _DeferrableField(name, getattr(kind, name)))
        return kind

    return prepare
