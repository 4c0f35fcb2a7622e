"""Read parts by camera: from a photograph to a reading.

photograph --codes removed, shrunk--> view --find--> posteriors --format--> Reading --codes--> Reading
                                      \\-> the same without stains, used if clearly surer -^
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from types import MappingProxyType

from glyphs.camera.photo import Photo
from glyphs.errors import MarksError
from recognition.decision.contracts import checked_by_codes
from recognition.decision.layouts import with_layout
from recognition.decision.reading import Reading
from recognition.decision.reading_of_line import reading_of_line
from recognition.decision.score import log_odds, with_score
from recognition.decision.which_way_up import weigh_orientation
from recognition.find.find import find
from recognition.glyph_match.prototypes import Prototypes, lit_prototypes, match_fonts
from recognition.language.lattice import Lattice
from recognition.recogniser.read_line import ReadLine
from recognition.senses.photo_sizes import SIZES, read_at_sizes, shrunk
from recognition.senses.settings import ReaderSettings, Repertoire
from recognition.senses.step_timer import StepTimer
from recognition.views.codes import Code, codes_of, without_codes
from recognition.views.registered import photo_views, stainless_view
from recognition.views.text_line import TextLine
from recognition.views.view import View

CLEARLY_NATS = 0.5
"""Log odds by which a reading without stains must exceed that of the photograph itself, nats."""
DARK = "the photograph has hardly any contrast (uncover the lens, light the part, expose longer)"
LEFT_OUT = "photograph {} does not show what the first one shows; it was left out"


class VisionReader:
    """Reads photographs, one after the other."""

    def __init__(self, settings: ReaderSettings | None = None) -> None:
        """Prepare the reader.

        Args:
            settings: as in the reader by touch; `fidelity` and `depth_rules` are ignored.

        Raises:
            FontError: as in the reader by touch.
            MarksError: `experts` lacks the network; only it reads photographs.
        """
        self.settings = (settings if settings is not None else ReaderSettings()).of("vision")
        if "network" not in self.settings.experts:
            raise MarksError(
                f"{', '.join(self.settings.experts)} cannot read photographs",
                hint="add the expert network, or read by touch: --mode tactile",
            )
        repertoire = Repertoire(self.settings)
        self.fonts, self._scaled = repertoire.fonts, repertoire.request
        # a height in mm cannot be used on a photograph of unknown scale
        self._unscaled = replace(self._scaled, height_mm=None)

    def read_photo(self, photo: Photo) -> Reading:
        """Read a photograph, with no more pixels than its characters need."""
        codes = codes_of(shrunk(photo, SIZES[-1]))
        made = read_at_sizes(photo, lambda small: self._read(small, codes))
        return checked_by_codes(made, codes)

    def _read(self, photo: Photo, codes: Sequence[Code]) -> Reading:
        """Read the photograph; if it is not sure, read it without stains too, which must be clearly surer to count."""
        bare = without_codes(photo, codes)
        views, left_out = photo_views(bare)
        timer = StepTimer()
        made = self._of_views(photo, views, timer, left_out=left_out)
        # a sure reading may be in review for a contract: another text must not bypass it
        if made.confidence < self.settings.accept_confidence and not photo.others:
            clean = stainless_view(bare)
            if clean is not None:
                other = self._of_views(photo, [clean], timer)
                surer = log_odds(other.confidence) > log_odds(made.confidence) + CLEARLY_NATS
                # the same text again is no further evidence: it is the same photograph
                if surer and other.text != made.text:
                    made = other
        return replace(made, seconds=MappingProxyType(dict(timer.seconds)))

    def _of_views(
        self,
        photo: Photo,
        views: Sequence[View],
        timer: StepTimer,
        *,
        left_out: tuple[int, ...] = (),
    ) -> Reading:
        scaled = photo.pitch_mm is not None
        request = self._scaled if scaled else self._unscaled
        with timer.step("read"):
            part = find(views, request, twice=self.settings.templates_judge)
            if part.main is not None:
                part = replace(part, main=part.main.with_experts(self._templates(views, part.main)))
        reading = reading_of_line(part, self.settings, source="vision")
        notes = (
            *reading.notes,
            *_file_notes(photo),
            *(() if reading.characters else _unread_notes(photo, part.candidates, views[0])),
            *(LEFT_OUT.format(number) for number in left_out),
        )
        reading = replace(
            reading,
            unit="mm" if scaled else "px",
            photos=1 + len(photo.others) - len(left_out),
            notes=notes,
        ).with_trace(photo=photo)
        return with_layout(weigh_orientation(with_score(reading), part, request), part, request.grammar)

    @cached_property
    def prototypes(self) -> tuple[tuple[Prototypes, ...], ...]:
        """Prototypes of each named font, under several lights; made when a line first needs them."""
        chars_of = self._scaled.chars_of
        return tuple(lit_prototypes(font, chars) for font in self.fonts if (chars := chars_of(font)))

    def _templates(self, views: Sequence[View], main: ReadLine) -> dict[str, Lattice]:
        """Match the named fonts to a line that the recogniser is not sure of."""
        if not self.settings.templates_judge or main.is_agreed or not self.prototypes:
            return {}
        return {"templates": match_fonts(views, main.line, main.columns, self.prototypes, main.lattice)[0]}


def _file_notes(photo: Photo) -> tuple[str, ...]:
    """Notes on the files of all photographs, each once."""
    return tuple(dict.fromkeys(note for one in (photo, *photo.others) for note in one.notes))


def _unread_notes(
    photo: Photo, lines: Sequence[TextLine], view: View, *, pixels: int = 4_000, least_contrast: float = 0.01
) -> tuple[str, ...]:
    """Note why no text was read: a photograph that shows nothing, or several places that may be the line.

    Args:
        photo: the photograph.
        lines: places that may be the line.
        view: view in which they were found.
        pixels: number of pixels to which the photograph is shrunk first, which averages noise out.
        least_contrast: standard deviation of brightness, 0 to 1, below which it shows nothing.
    """
    if shrunk(photo, pixels).grey().std() < least_contrast:
        return (DARK,)
    if len(lines) < 2:
        return ()
    shares = [(line.centre_mm.mean(axis=0) - view.origin_mm) / view.size_mm for line in lines]
    places = ", ".join(f"{x:.2f} {y:.2f}" for x, y in shares)
    return (
        f"several candidates: {len(lines)} places look like a line of text, centred at {places} (shares of "
        "the photograph's width and height); give the right one as the region (--region)",
    )
