"""RapidOCR's recogniser behind the interface of a sight engine (extra `vision`).

Only the model that its wheel carries is taken, and run by onnxruntime: the frames' probabilities are needed, not
the text that the package would make of them. Nothing is downloaded.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from glyphs.camera.photo import Photo
from recognition.box import Box
from recognition.lattice import Lattice
from recognition.ocr_ctc import count_belief, place_belief
from recognition.ocr_views import VIEWS, View, view_of
from recognition.vision_engine import EngineMissingError

ROWS, LEAST_COLS = 48, 320
"""What the network is fed: rows, and columns it is padded to at least, as in its training."""
FLOOR = 1e-6
"""Probability that a frame leaves to everything: no character is ruled out by one network."""
VIEW_FLOOR = 1e-4
"""Belief that one view leaves to every character allowed."""
ALPHANUMERIC = "ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789"
MISSING = (
    'the vision engine RapidOCR is not installed; install it with: pip install "tactile-marks[vision]", '
    "or choose the engine of templates"
)


@dataclass(frozen=True, eq=False)
class Frames:
    """What the network says of a line, frame by frame.

    Attributes:
        log_blank: (frames,) log probability of no character.
        log_chars: (frames, C) of each character; what is missing goes to characters that were not asked for.
        readable: (frames,) probability of any letter or figure.
    """

    log_blank: NDArray[np.float64]
    log_chars: NDArray[np.float64]
    readable: NDArray[np.float64]


class RapidEngine:
    """Reads lines by RapidOCR's network; loads it on construction."""

    name = "rapidocr"

    def __init__(self, *, views: tuple[View, ...] = VIEWS, threads: int = 1) -> None:
        """Load the network.

        Args:
            views: in which the line is shown to it.
            threads: of onnxruntime.

        Raises:
            EngineMissingError: the extra is not installed.
        """
        self.views = views
        self._session, self._classes = _load(threads)

    @classmethod
    def sharing(cls, other: RapidEngine, views: tuple[View, ...]) -> RapidEngine:
        """An engine of other views with the same network."""
        made = cls.__new__(cls)
        made.views, made._session, made._classes = views, other._session, other._classes
        return made

    def frames(self, crop: Photo, view: View, *, chars: str) -> Frames:
        """What the network says of one view of a line."""
        picture = view_of(crop, view, rows=ROWS)
        fed = np.zeros((1, 3, ROWS, max(LEAST_COLS, picture.shape[1])), dtype=np.float32)
        fed[0, :, :, : picture.shape[1]] = picture[..., ::-1].transpose(2, 0, 1) / np.float32(127.5) - 1.0
        said = np.asarray(self._session.run(None, {self._session.get_inputs()[0].name: fed})[0][0])
        share = self._shares(said, chars)
        every = self._shares(said, ALPHANUMERIC)
        # a word gap is land to us: its class counts as blank
        blank = said[:, 0] + said[:, self._classes[" "]]
        return Frames(
            log_blank=np.log(blank + FLOOR).astype(np.float64),
            log_chars=np.log(share + FLOOR),
            readable=every.sum(axis=1),
        )

    def _shares(self, said: NDArray[np.float32], chars: str) -> NDArray[np.float64]:
        """(frames, C) probability of each character, small letters counted as capitals unless asked for."""
        first, second = self._columns_of(chars)
        # what the network does not know has no probability
        large, small = (np.where(at >= 0, said[:, at], 0.0).astype(np.float64) for at in (first, second))
        return np.asarray(large + small)

    def _columns_of(self, chars: str) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """(C,) class of each character, and of its small letter; -1 for none."""
        small = [c.lower() if c.isupper() and c.lower() not in chars else "" for c in chars]
        none = -1
        return (
            np.array([self._classes.get(c, none) for c in chars], dtype=np.int64),
            np.array([self._classes.get(c, none) if c else none for c in small], dtype=np.int64),
        )

    def read_line(
        self,
        crop: Photo,
        *,
        chars: str,
        places: Sequence[str] | None,
        known: Mapping[View, Frames] | None = None,
    ) -> Lattice | None:
        """See `VisionEngine`; the mean of what the views say, each exact under the format.

        Args:
            crop, chars, places: as there.
            known: what the network has said of views of this crop already, for the same characters.
        """
        by_view = known or {}
        seen = [by_view.get(view) or self.frames(crop, view, chars=chars) for view in self.views]
        if places is None:
            most = [count_belief(f.log_blank, f.log_chars) for f in seen]
            size = min(m.size for m in most)
            count = np.mean([np.exp(m[:size]) for m in most], axis=0)
            n = int(np.argmax(count))
            if n == 0:
                return None
            held, sure = (chars,) * n, float(count[n]) ** (1.0 / n)
        else:
            held, sure = tuple(places), 1.0
        allowed = np.array([[c in place for c in chars] for place in held], dtype=np.bool_)
        beliefs, middles, trust = [], [], []
        for frames, view in zip(seen, self.views, strict=True):
            found = place_belief(frames.log_blank, frames.log_chars, allowed)
            if found is None:
                continue
            beliefs.append(_floored(np.exp(found.log_belief), allowed))
            trust.append(_trust(frames.readable, found.frame, found.spread))
            middles.append(_columns(crop, view, found.frame, frames.log_blank.size))
        if not beliefs:
            return None
        belief = np.mean(beliefs, axis=0) * np.mean(trust, axis=0)[:, None] * sure
        with np.errstate(divide="ignore"):
            log = np.log(belief)
        return Lattice(tuple(chars), log, boxes=_boxes(crop, np.mean(middles, axis=0)))


def _columns(crop: Photo, view: View, frame: NDArray[np.float64], frames: int) -> NDArray[np.float64]:
    """Columns of the crop at frames of the network, which run over the padded width."""
    rows, cols = crop.shape
    shown = max(8.0, ROWS * view.stretch * cols / ((1.0 - 2.0 * view.trim) * rows))
    return np.asarray((frame + 0.5) / frames * max(LEAST_COLS, shown) / shown * cols)


def _boxes(crop: Photo, middle: NDArray[np.float64]) -> tuple[Box, ...]:
    """Boxes about the middles of characters: half way to their neighbours, the crop's height."""
    rows, cols = crop.shape
    pitch = crop.pitch_mm or 1.0
    middle = np.maximum.accumulate(np.clip(middle, 0.0, cols))
    ends = np.concatenate([[0.0], 0.5 * (middle[1:] + middle[:-1]), [float(cols)]])
    reach = 0.45 * rows
    return tuple(
        Box(max(ends[k], m - reach) * pitch, 0.0, min(ends[k + 1], m + reach) * pitch, rows * pitch)
        for k, m in enumerate(middle)
    )


def _floored(belief: NDArray[np.float64], allowed: NDArray[np.bool_]) -> NDArray[np.float64]:
    floored = np.where(allowed, np.maximum(belief, VIEW_FLOOR), 0.0)
    return np.asarray(floored / floored.sum(axis=1, keepdims=True))


def _trust(
    readable: NDArray[np.float64], frame: NDArray[np.float64], spread: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Most that any frame at each place gives to letters and figures: little where the network sees none."""
    t = np.arange(readable.size)
    near = np.abs(t[None, :] - frame[:, None]) <= np.maximum(1.0, spread)[:, None]
    return np.asarray(np.where(near, readable[None, :], 0.0).max(axis=1).clip(0.0, 1.0))


def _load(threads: int) -> tuple[Any, dict[str, int]]:
    """The session and the class of every character, and of the blank of a word gap."""
    spec = find_spec("rapidocr")
    if spec is None or not spec.origin:
        raise EngineMissingError(MISSING)
    try:
        import onnxruntime
    except ImportError:
        raise EngineMissingError(MISSING) from None
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    options.log_severity_level = 4
    for path in sorted((Path(spec.origin).parent / "models").glob("*rec*.onnx")):
        session = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
        listed = session.get_modelmeta().custom_metadata_map.get("character")
        if listed:
            names = listed.splitlines()
            classes = {name: i + 1 for i, name in enumerate(names)}
            classes.setdefault(" ", len(names) + 1)
            return session, classes
    raise EngineMissingError(
        "the installed RapidOCR carries no recognition model with its characters; install rapidocr 3.4 or "
        'later: pip install "tactile-marks[vision]"'
    )
