"""Representations of values: a short line at the prompt; in a notebook also a small picture."""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
from enum import Enum, StrEnum
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

LONGEST = 160
"""Longest line in characters; further fields are left out."""
_LONGEST_VALUE = 60
_FEW = 6
_PICTURE_ROWS, _PICTURE_COLS = 160, 640


def one_line(value: Any) -> str:
    """Show a dataclass on one line: fields that differ from their defaults, arrays as shape and range."""
    parts: list[str] = []
    for item in fields(value):
        held = getattr(value, item.name)
        default = item.default if item.default_factory is MISSING else item.default_factory()
        if _same(held, default):
            continue
        parts.append(f"{item.name}={_brief(held)}")
        if sum(map(len, parts)) > LONGEST - 2 * len(parts):
            parts[-1] = "..."
            break
    return f"{type(value).__name__}({', '.join(parts)})"


class WordedEnum(StrEnum):
    """Base of enumerations whose members have a value for programs and a message for people."""

    message: str

    def __new__(cls, value: str, message: str = "") -> Self:
        member = str.__new__(cls, value)
        member._value_, member.message = value, message
        return member


class OneLine:
    """Base of dataclasses (with `repr=False`) that are shown on one line; see `one_line`."""

    __repr__ = one_line


def _same(held: object, default: object) -> bool:
    if isinstance(held, Mapping) and isinstance(default, Mapping):
        return not held and not default
    plain = isinstance(held, (str, int, float, Enum, tuple, type(None))) or is_dataclass(held)
    return plain and type(held) is type(default) and bool(held == default)


def _brief(value: object) -> str:
    if isinstance(value, np.ndarray):
        return _array(value)
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, (float, np.floating)):
        return f"{value:.4g}"
    if isinstance(value, Mapping):
        return f"{{{len(value)} entries}}"
    if isinstance(value, (tuple, list)):
        inside = ", ".join(_brief(each) for each in value) if len(value) <= _FEW else ""
        if len(value) <= _FEW and len(inside) <= _LONGEST_VALUE:
            return f"({inside},)" if len(value) == 1 else f"({inside})"
        return f"({len(value)} x {type(value[0]).__name__})"
    text = repr(value)
    if len(text) <= _LONGEST_VALUE and "\n" not in text:
        return text
    return (
        f"{text[: _LONGEST_VALUE // 2]!s}...'" if isinstance(value, str) else f"{type(value).__name__}(...)"
    )


def _array(values: NDArray[Any]) -> str:
    if values.ndim == 1 and values.size <= _FEW:
        return f"[{', '.join(f'{v:.4g}' for v in values)}]"
    shape = " x ".join(str(n) for n in values.shape)
    if values.dtype.kind not in "fiu" or not np.isfinite(values).any():
        return f"[{shape} {values.dtype}]"
    known = values[np.isfinite(values)]
    return f"[{shape}, {known.min():.3g}..{known.max():.3g}]"


def picture_html(value: object, grey: NDArray[Any]) -> str:
    """HTML for notebooks: `value`'s line below a picture whose greys span the middle 98 % of the numbers."""
    from PIL import Image

    low, high = np.nanquantile(grey, (0.01, 0.99)) if np.isfinite(grey).any() else (0.0, 1.0)
    shown = np.clip((np.nan_to_num(grey, nan=low) - low) / max(high - low, 1e-12), 0.0, 1.0)
    image = Image.fromarray(np.rint(255.0 * shown).astype(np.uint8))
    buffer = io.BytesIO()
    image.reduce(max(1, -(-image.height // _PICTURE_ROWS), -(-image.width // _PICTURE_COLS))).save(
        buffer, "PNG"
    )
    data = base64.b64encode(buffer.getvalue()).decode("ascii")
    return (
        f"<figure style='margin:0'><img src='data:image/png;base64,{data}' alt='' "
        f"style='image-rendering:pixelated;max-width:100%'>"
        f"<figcaption><code>{html.escape(repr(value))}</code></figcaption></figure>"
    )
