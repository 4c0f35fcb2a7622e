"""The reader of photographs: how a picture becomes a reading.

photograph --codes filled, pixels enough--> view --LineReader--> line and beliefs --format--> Reading --codes--> Reading
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from types import MappingProxyType

import numpy as np

from glyphs.camera.photo import Photo
from glyphs.errors import MarksError
from recognition.belief.line_belief import LineBelief, over_views
from recognition.belief.line_reader import LineReader, agreed
from recognition.belief.weights import EXPERTS
from recognition.decision.code_check import checked_by_codes
from recognition.decision.flags import ReadingFlag
from recognition.decision.known_ground import on_known_ground
from recognition.decision.reading import Reading
from recognition.decision.reading_of_line import reading_of_line
from recognition.decision.which_way_up import ways_possible, weighed
from recognition.experts.templates.photo_judge import SCALES, allowed_of, judged_photo, placed
from recognition.experts.templates.photo_shapes import PhotoShapes, photo_shapes
from recognition.language.lattice import Lattice
from recognition.senses.photo_sizes import SIZES, read_at_sizes, shrunk
from recognition.senses.settings import ReaderSettings, Repertoire
from recognition.senses.step_timer import StepTimer
from recognition.views.codes import Code, codes_of, without_codes
from recognition.views.registered import photo_views
from recognition.views.text_line import TextLine
from recognition.views.view import View

LEFT_OUT = "photograph {} does not show what the first one shows; it was left out"


class VisionReader:
    """Reads photographs, one after the other."""

    def __init__(self, settings: ReaderSettings | None = None) -> None:
        """Prepare.

        Args:
            settings: as of the reader by touch; fonts, `fidelity` and `depth_rules` are of no account here.

        Raises:
            FontError: as of the reader by touch.
            MarksError: experts of touch alone.
        """
        self.settings = settings if settings is not None else ReaderSettings()
        if self.settings.experts and "network" not in self.settings.experts:
            raise MarksError(
                f"no photograph is read by {', '.join(self.settings.experts)}",
                hint="add the expert network, or read by touch: --mode tactile",
            )
        repertoire = Repertoire(self.settings)
        self.chars, self.grammar = repertoire.chars, repertoire.grammar
        self.places, self.gaps = repertoire.places, repertoire.gaps
        self.fonts = repertoire.fonts
        self._readers = {
            scaled: LineReader(
                self.grammar,
                self.chars,
                height_mm=self.settings.height_mm if scaled else None,
                experts=self.settings.experts,
                region=self.settings.region,
                lines=self.settings.asked,
                orientation=self.settings.orientation,
            )
            for scaled in (True, False)
        }

    def read_photo(self, photo: Photo, *, about: TextLine | None = None) -> Reading:
        """Read a photograph, at no more pixels than its characters need.

        Args:
            photo: of a part.
            about: where the line lies, if it is known (felt by touch, or by the stage).
        """
        codes = codes_of(shrunk(photo, SIZES[-1]))
        made = read_at_sizes(photo, lambda small: self._read(small, about, codes))
        return checked_by_codes(made, codes)

    def _read(self, photo: Photo, about: TextLine | None, codes: Sequence[Code]) -> Reading:
        timer = StepTimer()
        scaled = photo.pitch_mm is not None
        with timer.step("read"):
            views, left_out = photo_views(without_codes(photo, codes))
            pictures = _Pictures(self, views, scaled=scaled) if self.shapes else None
            part = self._readers[scaled].read(
                *views, about=about, judge=pictures, place=None if pictures is None else pictures.place
            )
        made = reading_of_line(
            part,
            self.settings,
            grammar=self.grammar,
            flags=ReadingFlag.NONE,
            source="vision",
            asked=self.settings.asked,
        )
        places = () if made.characters else part.candidates
        notes = (
            *made.notes,
            *_file_notes(photo),
            *_candidate_notes(places, views[0]),
            *(LEFT_OUT.format(number) for number in left_out),
        )
        made = replace(
            made,
            unit="mm" if scaled else "px",
            seconds=MappingProxyType(dict(timer.seconds)),
            photos=1 + len(photo.others) - len(left_out),
            notes=notes,
        ).traced(photo=photo)
        made = on_known_ground(made, self.settings)
        ways = ways_possible(self.settings.orientation, turned_deg=made.rotation_deg)
        accept = self.settings.accept_confidence
        return weighed(made, views[0], self._readers[scaled], ways, accept_confidence=accept)

    @cached_property
    def shapes(self) -> tuple[tuple[PhotoShapes, ...], ...]:
        """Pictures of the fonts that are named, at the scales at which they are compared."""
        if not self.settings.fonts or "templates" not in (self.settings.experts or EXPERTS):
            return ()
        has = [(font, "".join(c for c in self.chars if c in font.glyphs)) for font in self.fonts]
        return tuple(tuple(photo_shapes(font, chars, pixels=n) for n in SCALES) for font, chars in has)


class _Pictures:
    """Places and judges a line by the pictures of the named fonts, where the networks are not sure of it."""

    def __init__(self, reader: VisionReader, views: Sequence[View], *, scaled: bool) -> None:
        self.reader, self.views = reader, views
        self.height_mm = reader.settings.height_mm if scaled else None

    def place(self, view: View, lines: Sequence[TextLine], belief: LineBelief) -> TextLine | None:
        """The line as the font has it that suits it best."""
        fits = [
            placed(view, scales[0], lines, allowed, self.reader.gaps, height_mm=self.height_mm)
            for scales in self.reader.shapes
            if (allowed := allowed_of(scales[0], belief.lattice)) is not None
        ]
        best = max((fit for fit in fits if fit is not None), key=lambda fit: fit.value, default=None)
        return None if best is None else best.placed

    def __call__(self, line: TextLine, belief: LineBelief) -> dict[str, Lattice]:
        """What the pictures of the font believe that suits the line best in all views."""
        if agreed(belief):
            return {}
        best: tuple[float, list[Lattice]] = (-math.inf, [])
        for scales in self.reader.shapes:
            told = [judged_photo(v, scales, line, belief.lattice, self.reader.gaps) for v in self.views]
            found = [one for one in told if one is not None]
            if found:
                best = max(best, (sum(value for value, _ in found), [own for _, own in found]), key=_first)
        if not best[1]:
            return {}
        log = over_views([np.maximum(own.log_belief, -1e9) for own in best[1]])
        log = np.where(np.isfinite(best[1][0].log_belief), log, -np.inf)
        log -= np.maximum(np.logaddexp.reduce(log, axis=1), 0.0)[:, None]
        return {"templates": replace(best[1][0], log_belief=np.minimum(log, 0.0))}


def _file_notes(photo: Photo) -> tuple[str, ...]:
    """Remarks on the files of a photograph and its others, each once."""
    return tuple(dict.fromkeys(note for one in (photo, *photo.others) for note in one.notes))


def _candidate_notes(lines: Sequence[TextLine], view: View) -> tuple[str, ...]:
    """Where to look in a photograph in which no text was read, if more than one place may be its line."""
    if len(lines) < 2:
        return ()
    shares = [(line.centre_mm.mean(axis=0) - view.origin_mm) / view.size_mm for line in lines]
    places = ", ".join(f"{x:.2f} {y:.2f}" for x, y in shares)
    return (
        f"several candidates: {len(lines)} places look like a line of text, with their middles at {places} (shares of "
        "the photograph's width and height); give the right one with --region",
    )


def _first(one: tuple[float, list[Lattice]]) -> float:
    return one[0]
