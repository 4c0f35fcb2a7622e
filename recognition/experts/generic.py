"""A recogniser of print that others made, RapidOCR's (extra `vision`): it knows every font, and no dirt.

Only the model that its wheel carries is taken, and run by onnxruntime: the steps' probabilities are needed, not the
text that the package would make of them. Nothing is downloaded.

    strip --looks: heights cut flat, or brightness evened out--> pictures of 48 rows --> Steps, one a look
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from glyphs.errors import MarksError
from recognition.experts.steps import Steps
from recognition.lines.networks import opened
from recognition.views.text_line import HEIGHT_ROWS, TextLine
from recognition.views.view import EDGES, GREY, HEIGHTS, KNOWN, View, ViewKind

Picture = NDArray[np.uint8]
ROWS, LEAST_COLUMNS = 48, 320
"""What the network is fed: rows, and columns it is padded to at least, as in its training."""
BAND = 1.3
"""Of a line, character heights: what the rows show."""
ZOOM = ROWS / (BAND * HEIGHT_ROWS)
BROAD, CLIP = 0.4, 0.06
"""Sigma of what is the plate, not the mark, and what a mark's depth is cut to; character heights."""
_CLAHE_CLIP, _CLAHE_TILES = 8.0, (8, 4)
MISSING = 'the recogniser RapidOCR is not installed; install it with: pip install "tactile-marks[vision]"'


class EngineMissingError(MarksError):
    """An engine that is not installed."""


def is_installed() -> bool:
    """Whether the extra `vision` is there."""
    return find_spec("rapidocr") is not None and find_spec("onnxruntime") is not None


def check_installed() -> None:
    """Refuse to go on without the extra `vision`.

    Raises:
        EngineMissingError: it is not there.
    """
    if not is_installed():
        raise EngineMissingError(MISSING)


def looks_at(view: View, line: TextLine) -> list[Picture]:
    """Pictures of a line, (ROWS, columns) each, the one that serves best first."""
    strip = view.strip(line, rows=BAND * HEIGHT_ROWS, zoom=ZOOM)
    known = strip[KNOWN]
    if view.kind is ViewKind.PHOTO:
        return _of_brightness(strip[GREY], known)
    cut = np.clip(_flat(strip[HEIGHTS], known) / CLIP, -1.0, 1.0)
    looks = [_painted(cut), _painted(-cut)]
    edges = [layer for layer in strip[EDGES:KNOWN] if layer.any()]
    if edges:
        # opposite directions together give the profile, free of the plate's tilt
        looks.append(_painted(np.clip(np.mean(edges, axis=0) * -0.5, -1.0, 1.0)))
    return looks if strip[HEIGHTS].any() else looks[2:]


def _of_brightness(grey: NDArray[np.float32], known: NDArray[np.float32]) -> list[Picture]:
    from glyphs.opencv import cv2

    picture = np.asarray(255.0 * np.where(known > 0.0, grey, np.median(grey)), dtype=np.uint8)
    even = cv2.createCLAHE(_CLAHE_CLIP, _CLAHE_TILES).apply(picture)
    flat = _flat(grey, known)
    spread = float(np.sqrt((flat**2).mean())) or 1.0
    return [
        np.asarray(even, dtype=np.uint8),
        picture,
        _painted(np.clip(flat / (3.0 * spread), -1.0, 1.0)),
        np.asarray(255 - even, dtype=np.uint8),
    ]


def _flat(layer: NDArray[np.float32], known: NDArray[np.float32]) -> NDArray[np.float32]:
    from glyphs.opencv import cv2

    sigma = BROAD * HEIGHT_ROWS * ZOOM
    weight = cv2.GaussianBlur(known, (0, 0), sigma)
    broad = cv2.GaussianBlur(layer * known, (0, 0), sigma) / np.maximum(weight, 1e-3)
    return np.asarray((layer - broad) * known, dtype=np.float32)


def _painted(values: NDArray[np.float32]) -> Picture:
    """-1 to 1 from black to white."""
    return np.asarray(127.5 * (values + 1.0), dtype=np.uint8)


def steps_of(looks: Sequence[Picture], *, chars: str, rare: str = "") -> list[Steps]:
    """What is believed along pictures of one line, (ROWS, columns) each, cut by `looks_at`.

    Raises:
        EngineMissingError: the extra `vision` is not installed.
    """
    session, classes = engine()
    columns = looks[0].shape[1]
    fed = np.zeros((len(looks), 3, ROWS, max(LEAST_COLUMNS, columns)), dtype=np.float32)
    for n, look in enumerate(looks):
        fed[n, :, :, :columns] = look / np.float32(127.5) - 1.0
    made = []
    for said in session.run(None, {session.get_inputs()[0].name: fed})[0]:
        at = (np.arange(len(said)) + 0.5) / len(said) * fed.shape[3]
        within = at < columns + 8
        shares, small = np.zeros((len(said), len(chars))), np.zeros(len(said))
        for k, char in enumerate(chars):
            for own in {char, *([char.lower()] if char.lower() not in chars else [])}:
                if own in classes:
                    shares[:, k] += said[:, classes[own]]
                    small += said[:, classes[own]] * (own != char)
        # a word gap is land to us: its class counts as blank
        gap = said[within, classes[" "]].astype(np.float64)
        blank = said[within, 0] + gap
        made.append(
            Steps.of(
                blank, shares[within], chars, at[within] / ZOOM - 0.5, gap=gap, small=small[within], rare=rare
            )
        )
    return made


@cache
def engine() -> tuple[Any, dict[str, int]]:
    """The session and the class of every character, and of the blank of a word gap.

    Raises:
        EngineMissingError: the extra `vision` is not installed.
    """
    spec = find_spec("rapidocr")
    if spec is None or not spec.origin:
        raise EngineMissingError(MISSING)
    for path in sorted((Path(spec.origin).parent / "models").glob("*rec*.onnx")):
        session = opened(path)
        listed = session.get_modelmeta().custom_metadata_map.get("character")
        if listed:
            names = listed.splitlines()
            classes = {name: i + 1 for i, name in enumerate(names)}
            classes.setdefault(" ", len(names) + 1)
            return session, classes
    raise EngineMissingError(
        "the installed RapidOCR carries no recognition model with its characters",
        hint='install rapidocr 3.4 or later: pip install "tactile-marks[vision]"',
    )
