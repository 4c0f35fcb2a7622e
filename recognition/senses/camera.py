"""The reader of photographs: how a picture becomes a reading.

photograph --pixels enough--> view --LineReader--> line and beliefs --format--> Reading
"""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType

from glyphs.camera.photo import Photo
from glyphs.errors import MarksError
from recognition.belief.line_reader import LineReader
from recognition.decision.flags import ReadingFlag
from recognition.decision.reading import Reading
from recognition.decision.reading_of_line import reading_of_line
from recognition.senses.photo_sizes import read_at_sizes
from recognition.senses.settings import ReaderSettings, Repertoire
from recognition.senses.step_timer import StepTimer
from recognition.views.text_line import TextLine
from recognition.views.view import photo_view

PHOTO_EXPERTS = frozenset({"own", "print"})
"""Those that read photographs."""


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
        if self.settings.experts and not PHOTO_EXPERTS & {*self.settings.experts}:
            raise MarksError(
                f"no photograph is read by {', '.join(self.settings.experts)}",
                hint=f"add one of the experts {', '.join(sorted(PHOTO_EXPERTS))}, or read by touch: --mode tactile",
            )
        repertoire = Repertoire(self.settings)
        self.chars, self.grammar = repertoire.chars, repertoire.grammar
        self.places, self.gaps = repertoire.places, repertoire.gaps
        self._readers = {
            scaled: LineReader(
                self.grammar,
                self.chars,
                height_mm=self.settings.height_mm if scaled else None,
                experts=self.settings.experts,
                region=self.settings.region,
                lines=self.settings.asked,
            )
            for scaled in (True, False)
        }

    def read_photo(self, photo: Photo, *, about: TextLine | None = None) -> Reading:
        """Read a photograph, at no more pixels than its characters need.

        Args:
            photo: of a part.
            about: where the line lies, if it is known (felt by touch, or by the stage).
        """
        return read_at_sizes(photo, lambda small: self._read(small, about))

    def _read(self, photo: Photo, about: TextLine | None) -> Reading:
        timer = StepTimer()
        scaled = photo.pitch_mm is not None
        with timer.step("read"):
            part = self._readers[scaled].read(photo_view(photo), about=about)
        made = reading_of_line(
            part,
            self.settings,
            grammar=self.grammar,
            gaps=self.gaps,
            flags=ReadingFlag.NONE,
            source="vision",
            asked=self.settings.asked,
        )
        return replace(
            made, unit="mm" if scaled else "px", seconds=MappingProxyType(dict(timer.seconds))
        ).traced(photo=photo)
