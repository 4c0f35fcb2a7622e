"""The recogniser: a small network for any font that gives posteriors step by step along a line. Its weights are beside
this file, with a card; `python -m recognition.learning.train` trains them again."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from glyphs.opencv import cv2
from recognition.recogniser.networks import open_network
from recognition.recogniser.steps import Steps
from recognition.see.view import Layers

CHARACTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789abcdefghijklmnopqrstuvwxyz-./#()& "
"""Characters that it distinguishes; the blank comes before them."""
WIDER = 1.4
"""Factor by which a strip is widened before it is read: it raises correctly read felt characters of held-out fonts
from 85.0 to 85.9 %, and the number of sure lines; 1.2 and 1.6 are no better. See `wider_for`."""
CHEAP = 1.0
"""The same for a look that only ranks lines: it takes two thirds of the time."""
STEP_COLUMNS = 20 / 3 / WIDER
FEATURE_COLUMNS = STEP_COLUMNS / 2
"""Columns of a strip, before it is widened by `WIDER`, per step of the posteriors, and per step of the features."""
LAG_COLUMNS = 0.4
"""Distance of characters to the right of the middle of the step at which they appear: the median of 1,031 characters of
held-out fonts, felt and measured, whose places are known."""
_MULTIPLE = 20
"""Columns of a strip are padded to a multiple of this."""
WEIGHTS = Path(__file__).with_name("recogniser.onnx")
_CODES = {char: 1 + k for k, char in enumerate(CHARACTERS)}
Features: TypeAlias = NDArray[np.float32]


def posteriors(strip: Layers, *, wider: float = WIDER) -> NDArray[np.float32]:
    """(steps, 1 + CHARACTERS) logarithms of a strip's posteriors, the blank first."""
    steps = math.ceil(strip.shape[2] / _step_columns(wider))
    return _outputs(strip.tobytes(), strip.shape, wider)["posteriors"][:steps]


def wider_for(advance: float, *, usual: float = 1.05, least: float = 0.8, most: float = 3.2) -> float:
    """Factor by which to widen a strip whose characters follow each other at `advance` character heights.

    Narrow and wide characters are read best at the width of usual ones. Of lines in fonts made 0.4 to 1.7 times as
    wide, with dirt up to 0.6, so many characters of a known format are read (with `WIDER` alone) if this factor counts
    where it is more promising by a nat:

        advance (lines)     heights            photographs
        below 0.45 (87)     95.5 % (94.0)      78.3 % (74.9)
        above 1.2 (61)      99.2   (98.0)      83.0   (79.9)
    """
    return min(max(usual / advance, least), most)


def features_of(strip: Layers) -> Features:
    """(features, rows, steps) of a strip: the network's values before its last layers."""
    steps = math.ceil(strip.shape[2] / FEATURE_COLUMNS)
    return _outputs(strip.tobytes(), strip.shape, WIDER)["features"][..., :steps]


def widen(strip: Layers, wider: float = WIDER, *, multiple: int = 1) -> Layers:
    """Widen a strip for the network, and pad it to a multiple of columns."""
    rows, columns = strip.shape[1], math.ceil(wider * strip.shape[2])
    wide = np.zeros((len(strip), rows, columns + -columns % multiple), dtype=np.float32)
    for layer, values in zip(wide, strip, strict=True):
        # most layers are empty
        if values.any():
            layer[:, :columns] = cv2.resize(values, (columns, rows), interpolation=cv2.INTER_LINEAR)
    return wide


@lru_cache(maxsize=24)
def _outputs(strip: bytes, shape: tuple[int, ...], wider: float) -> Mapping[str, NDArray[np.float32]]:
    layers, names = np.frombuffer(strip, dtype=np.float32).reshape(shape), ("posteriors", "features")
    # one strip at a time: in a batch it would be padded to the longest, and padding costs as much as content
    values = _session().run(names, {"strip": widen(layers, wider, multiple=_MULTIPLE)[None]})
    return {name: value[0] for name, value in zip(names, values, strict=True)}


def steps_of(
    log_posteriors: NDArray[np.float32],
    *,
    chars: str,
    rare: str = "",
    skip_columns: int = 0,
    wider: float = WIDER,
) -> Steps:
    """Posteriors of the characters that are looked for, along a strip as `View.strip` cuts it. Small letters that are
    not in `chars` count as their capitals; other characters that are not are left out; a space counts as blank."""
    power = np.exp(log_posteriors.astype(np.float64))
    cases, small = _cases_of(chars)
    gap = power[:, _CODES[" "]]
    blank = power[:, 0] + (gap if " " not in chars else 0.0)
    columns = (np.arange(len(power), dtype=np.float64) + 0.5) * _step_columns(wider) - 0.5 + LAG_COLUMNS
    columns += skip_columns
    return Steps.of(blank, power @ cases, chars, columns, gap=gap, small=power @ small, rare=rare)


@cache
def _cases_of(chars: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(1 + CHARACTERS, chars) 1 where an output counts as a character, and (1 + CHARACTERS,) where as its capital."""
    outputs = ("", *CHARACTERS)
    cases = [[case == (char if case in chars else char.lower()) for char in chars] for case in outputs]
    small = [case not in chars and any(counts) for case, counts in zip(outputs, cases, strict=True)]
    return np.array(cases, dtype=np.float64), np.array(small, dtype=np.float64)


def wider_of(steps: Steps) -> float:
    """Factor by which the strip of these steps was widened."""
    between = np.diff(steps.columns[:2])
    return float(WIDER * STEP_COLUMNS / between[0]) if between.size else WIDER


def _step_columns(wider: float) -> float:
    return STEP_COLUMNS * WIDER / wider


@cache
def _session() -> Any:
    return open_network(WEIGHTS)
