"""Signatures that help and Jupyter show."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Collection
from typing import Annotated, Any, TypeVar, get_args, get_origin

F = TypeVar("F", bound=Callable[..., Any])


def lists_options(source: Callable[..., Any], names: Collection[str]) -> Callable[[F], F]:
    """Let a function that takes `**options` show each of them, with its type and default, where one types."""

    def decorate(function: F) -> F:
        signature = inspect.signature(function)
        *parameters, _ = signature.parameters.values()
        options = [
            option.replace(kind=inspect.Parameter.KEYWORD_ONLY, annotation=_plain(option.annotation))
            for name, option in inspect.signature(source).parameters.items()
            if name in names
        ]
        function.__signature__ = signature.replace(parameters=[*parameters, *options])  # type: ignore[attr-defined]
        return function

    return decorate


def _plain(annotation: Any) -> Any:
    return get_args(annotation)[0] if get_origin(annotation) is Annotated else annotation
