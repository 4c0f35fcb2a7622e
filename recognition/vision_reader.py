"""The camera-only reader: how a photograph becomes a reading.

photo --line_places--> places --+--> templates: SightSearch --> lattice --+
                                |        | (its line is a place, too)     +--> together --> Reading
                                +--> crops --> RapidOCR ------> lattice --+
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Literal

import numpy as np

from glyphs.camera.photo import Photo
from glyphs.errors import MarksError
from glyphs.fonts.glyph import Font
from recognition.box import Box
from recognition.lattice import Lattice
from recognition.ocr_rapid import Frames, RapidEngine
from recognition.ocr_views import FIRST_VIEW, View
from recognition.photo_sizes import read_at_sizes
from recognition.reader_settings import ALPHABET, ReaderSettings, Repertoire
from recognition.reading import Decision, Reading, ReadingFlag, ReadingTrace, Unit
from recognition.vision_combine import as_reading, certainty, joined
from recognition.vision_edges import vision_edges
from recognition.vision_engine import EngineMissingError
from recognition.vision_fit import Supposed, VisionFit
from recognition.vision_frame import LineCrop, LinePlace, boxes_in_frame, line_crop
from recognition.vision_lines import distinct_turns_deg, line_places, supposed_heights_mm
from recognition.vision_search import VisionSearch
from recognition.vision_templates import CLOSE_LOOK, GLANCE, Look, VisionBasis, predict_basis

Engine = Literal["rapidocr", "templates", "best"]
NAMED_WEIGHT, FOREIGN_WEIGHT = 0.6, 0.3
"""Weight of templates beside the network, by likelihood on dirty parts; the less where nobody named the font."""
_log = logging.getLogger(__name__)
LEADING_FITS = 2
"""Suppositions looked at closely, of all that were tried."""
PLAIN_VALUE = 16.0
"""Log Bayes factor a character from which a line stands out plainly: no other rotation is looked for."""
SWEEP_DEG = (-10.0, -8.0, -6.0, -4.0, -2.0, 2.0, 4.0, 6.0, 8.0, 10.0)
USUAL_TURN_DEG = 5.0
"""Standard deviation of rotations, as parts lie."""
RIVAL_SHARE = 0.7
"""Of what the best supposition explains, which another must reach to be looked at closely."""
CLOSE_SPANS = (0.025,)
"""Relative changes of height tried in the close look."""


class VisionReader:
    """Reads photographs one after the other; keeps the network, fonts and templates between them."""

    def __init__(
        self,
        settings: ReaderSettings | None = None,
        *,
        engine: Engine = "best",
        calibrated: Callable[[Lattice], Lattice] | None = None,
    ) -> None:
        """Load engine and fonts.

        Args:
            settings: as of the reader by touch; `fidelity` and `depth_rules` are of no account here.
            engine: the network, the templates, or the two together where the network is installed.
            calibrated: turns beliefs into probabilities; as they are unless given.

        Raises:
            EngineMissingError: "rapidocr" asked for and not installed.
            FontError: as of the reader by touch.
        """
        self.settings = settings if settings is not None else ReaderSettings()
        self.named = bool(self.settings.fonts)
        repertoire = Repertoire(replace(self.settings, fonts=_whole(self.settings.fonts)))
        self.fonts, self.chars, self.grammar = repertoire.fonts, repertoire.chars, repertoire.grammar
        self.places, self.gaps = repertoire.places, repertoire.gaps
        self.calibrated = calibrated
        self.notes: tuple[str, ...] = ()
        self.rapid: RapidEngine | None = None
        if engine != "templates":
            try:
                self.rapid = RapidEngine()
            except EngineMissingError as error:
                if engine == "rapidocr":
                    raise
                self.notes = (f"read by templates alone: {error}",)
        self.by_templates = engine != "rapidocr"
        self._bases: dict[tuple[str, Look], VisionBasis] = {}

    def read_photo(self, photo: Photo, *, about: LinePlace | None = None) -> Reading:
        """Read a photograph, at no more pixels than its characters need.

        Args:
            photo: of one line of characters.
            about: where the line lies about, if it is known (felt by touch, or by the stage).
        """
        return read_at_sizes(photo, lambda small: self._read(small, about))

    def _read(self, photo: Photo, about: LinePlace | None) -> Reading:
        seconds: dict[str, float] = {}
        start = time.perf_counter()
        n = None if self.places is None else len(self.places)
        height = self.settings.height_mm if photo.pitch_mm is not None else None
        places = (about,) if about is not None else line_places(photo, height_mm=height, n_places=n)
        seconds["localise"] = time.perf_counter() - start
        lattices: dict[str, Lattice] = {}
        place: LinePlace | None = about
        # of an unknown font the templates are asked only where the network is in doubt
        second = self.rapid is not None and not self.named
        if second:
            place = self._by_network(photo, places, lattices, seconds)
        if self.by_templates and not (second and self._sure(lattices)):
            start = time.perf_counter()
            fit = self._fit(photo, places, about)
            if fit is not None:
                lattices["templates"] = self._of_fit(fit)
                places = (fit.place(), *places)
                place = place or fit.place()
            seconds["templates"] = time.perf_counter() - start
        if self.rapid is not None and not second:
            where = self._by_network(photo, places, lattices, seconds)
            place = place or where
        return self._answer(photo, lattices, place, seconds)

    def _by_network(
        self,
        photo: Photo,
        places: Sequence[LinePlace],
        lattices: dict[str, Lattice],
        seconds: dict[str, float],
    ) -> LinePlace | None:
        start = time.perf_counter()
        read, where = self._read_crops(photo, places)
        if read is not None:
            lattices["rapidocr"] = read
        seconds["rapidocr"] = time.perf_counter() - start
        return where

    def _sure(self, lattices: dict[str, Lattice]) -> bool:
        return any(
            as_reading(lattice, self.settings, grammar=self.grammar).decision is Decision.ACCEPT
            for lattice in lattices.values()
        )

    def _answer(
        self, photo: Photo, lattices: dict[str, Lattice], place: LinePlace | None, seconds: dict[str, float]
    ) -> Reading:
        trace = ReadingTrace(photo=photo, by_engine=MappingProxyType(lattices))
        unit: Unit = "mm" if photo.pitch_mm is not None else "px"
        if not lattices:
            nothing = Reading(
                (), Decision.REJECT, 0.0, ReadingFlag.NO_CHARACTERS, source="vision", notes=self.notes, unit=unit,
                seconds=MappingProxyType(seconds), trace=trace,
            )  # fmt: skip
            return nothing
        weights = {"templates": NAMED_WEIGHT if self.named else FOREIGN_WEIGHT, "rapidocr": 1.0}
        lattice = joined(lattices, weights)
        if self.calibrated is not None:
            lattice = self.calibrated(lattice)
        lattice = replace(lattice, spaces_after=self.gaps)
        foreign = self.by_templates and not self.named and "rapidocr" not in lattices
        reading = as_reading(
            lattice,
            self.settings,
            grammar=self.grammar,
            flags=ReadingFlag.FOREIGN_SHAPES if foreign else ReadingFlag.NONE,
        )
        edges = None
        if place is not None:
            edges = vision_edges(photo, height_mm=place.height_mm)
            reading = replace(reading, height_mm=place.height_mm, rotation_deg=place.rotation_deg)
        engine = "+".join(sorted(lattices))
        trace = replace(trace, edge_map=edges, lattice=lattice, engine=engine, place=place)
        notes = (*reading.notes, *self.notes)
        return replace(reading, notes=notes, unit=unit, seconds=MappingProxyType(seconds), trace=trace)

    def _basis(self, font: Font, look: Look) -> VisionBasis:
        key = (font.name, look)
        if key not in self._bases:
            chars = "".join(c for c in self.chars if c in font.glyphs)
            self._bases[key] = predict_basis(font, chars, look=look)
        return self._bases[key]

    def _fit(self, photo: Photo, places: Sequence[LinePlace], about: LinePlace | None) -> VisionFit | None:
        """The line that the templates of any font explain best: found at a glance, then looked at closely."""
        search = VisionSearch(photo, places=self.places, gaps=self.gaps, about=about)
        if about is not None:
            tried = [Supposed(about.height_mm, about.rotation_deg)]
        else:
            known = self.settings.height_mm if photo.pitch_mm is not None else None
            heights = (known,) if known is not None else supposed_heights_mm(photo, tuple(places))
            turns = distinct_turns_deg(places)
            tried = [Supposed(h, turn) for h in heights for turn in turns]
        fits = self._glances(search, [(font, t) for font in self.fonts for t in tried])
        if about is None and (not fits or fits[0][0].value < PLAIN_VALUE * fits[0][0].trust.size):
            # dirt hides the rotation from a first look: turn by turn, then
            led = {(font.name, f.supposed.height_mm): font for f, font in fits[:LEADING_FITS]}
            swept = [(font, Supposed(h, turn)) for (_, h), font in led.items() for turn in SWEEP_DEG]
            fits = sorted((*fits, *self._glances(search, swept)), key=_promise, reverse=True)
        close: list[VisionFit] = []
        for glance, font in fits[:LEADING_FITS]:
            if _promise((glance, font)) < RIVAL_SHARE * _promise(fits[0]):
                continue
            held = search.refined(glance)
            near = VisionSearch(photo, places=self.places, gaps=self.gaps, about=held.place())
            seen = near.fit(self._basis(font, CLOSE_LOOK), held.supposed, light=held.light)
            if seen is not None:
                close.append(near.refined(seen, spans=CLOSE_SPANS))
        return max(close, key=lambda f: f.value, default=None)

    def _glances(
        self, search: VisionSearch, tried: list[tuple[Font, Supposed]]
    ) -> list[tuple[VisionFit, Font]]:
        """What each supposition explains at a glance, most first."""
        names = list(dict.fromkeys(font.name for font, _ in tried))
        seen = []
        for font, supposed in tried:
            _log.debug("trying font %d of %d", names.index(font.name) + 1, len(names))
            seen.append((search.fit(self._basis(font, GLANCE), supposed), font))
        return sorted(((fit, font) for fit, font in seen if fit is not None), key=_promise, reverse=True)

    def _of_fit(self, fit: VisionFit) -> Lattice:
        """The fit's posteriors over the reader's characters."""
        log = np.full((fit.trust.size, len(self.chars)), -np.inf)
        at = [self.chars.index(c) for c in fit.basis.chars]
        log[:, at] = fit.settled.log_belief + np.log(np.maximum(fit.trust, 1e-12))[:, None]
        boxes = []
        for k in range(fit.trust.size):
            place = fit.character(k)
            corners = place.corners()
            (x0, y0), (x1, y1) = corners.min(axis=0), corners.max(axis=0)
            boxes.append(Box(float(x0), float(y0), float(x1), float(y1)))
        return Lattice(tuple(self.chars), np.minimum(log, 0.0), boxes=tuple(boxes))

    def _read_crops(
        self, photo: Photo, places: Sequence[LinePlace]
    ) -> tuple[Lattice | None, LinePlace | None]:
        """What the network reads at the place where it is surest of a line."""
        assert self.rapid is not None
        crops: list[tuple[LineCrop, LinePlace]] = []
        for place in places:
            try:
                crop = line_crop(photo, place)
            except MarksError:
                continue
            # of equal crops the first one would be chosen
            if not any(np.array_equal(crop.photo.pixels, c.photo.pixels) for c, _ in crops):
                crops.append((crop, place))
        if not crops:
            return None, None
        known: dict[View, Frames] = {}
        best = 0
        if len(crops) > 1:
            first = RapidEngine.sharing(self.rapid, (FIRST_VIEW,))
            seen = [{FIRST_VIEW: first.frames(c.photo, FIRST_VIEW, chars=self.chars)} for c, _ in crops]
            looks = [
                first.read_line(c.photo, chars=self.chars, places=self.places, known=frames)
                for (c, _), frames in zip(crops, seen, strict=True)
            ]
            best = int(np.argmax([-np.inf if look is None else certainty(look) for look in looks]))
            known = seen[best]
        crop, place = crops[best]
        read = self.rapid.read_line(crop.photo, chars=self.chars, places=self.places, known=known)
        if read is None:
            return None, None
        return replace(read, boxes=boxes_in_frame(crop, read.boxes)), place


def _whole(fonts: Sequence[str | Font]) -> tuple[str | Font, ...]:
    """The fonts without those learned in part, unless there are no others.

    Touch doubts what may be a character that it has no shape of (`recognition.unseen_glyphs`); vision cannot.
    """
    partial = {
        f
        for f in fonts
        if isinstance(f, Font) and any(f.glyphs[c].guessed for c in ALPHABET if c in f.glyphs)
    }
    if all(f in partial for f in fonts if isinstance(f, Font)):
        return tuple(fonts)
    return tuple(f for f in fonts if f not in partial)


def _promise(seen: tuple[VisionFit, Font]) -> float:
    """What a fit explains, less what its rotation costs."""
    fit = seen[0]
    return fit.value - 0.5 * (fit.supposed.rotation_deg / USUAL_TURN_DEG) ** 2
