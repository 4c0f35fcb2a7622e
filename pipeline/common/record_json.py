"""Records as JSON and back, by their types alone: one form for the store, the interface and what is published."""

from __future__ import annotations

from typing import Any, TypeVar

from pydantic import TypeAdapter

T = TypeVar("T")


_ADAPTERS: dict[type[Any], TypeAdapter[Any]] = {}


def _adapter(kind: type[Any]) -> TypeAdapter[Any]:
    # kept, for to make one takes milliseconds
    if kind not in _ADAPTERS:
        _ADAPTERS[kind] = TypeAdapter(kind)
    return _ADAPTERS[kind]


def to_json(record: Any) -> dict[str, Any]:
    """The record as values that JSON has: enums and times as text, tuples as lists."""
    made: dict[str, Any] = _adapter(type(record)).dump_python(record, mode="json")
    return made


def from_json(kind: type[T], data: Any) -> T:
    """The record out of what `to_json` made of it.

    Raises:
        ValueError: data that are no such record.
    """
    made: T = _adapter(kind).validate_python(data)
    return made
