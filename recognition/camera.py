"""Evidence by camera: from a photograph to the text in it.

photograph --area of the regions, codes removed, shrunk--> view --find--> lines
                                      \\-> the same without stains, if a line promises more there: used if clearly surer
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain

from glyphs.camera.photo import Photo
from glyphs.errors import MarksError
from recognition.decide.decide import score_text
from recognition.decide.decision import Finding, ReadingFlag
from recognition.decide.evidence import EVEN, Evidence, Log, SenseEvidence
from recognition.decide.score import log_odds
from recognition.find.deadline import Deadline
from recognition.find.find import FoundLines, apart, is_clear_text, read_lines, search_of
from recognition.find.looks import Looks
from recognition.find.promise import is_convincing, promise_of
from recognition.find.request import LineRequest
from recognition.find.wide import read_wide
from recognition.glyph_match.face_library import face_library
from recognition.glyph_match.faces import compare_faces, read_faces
from recognition.glyph_match.prototypes import Prototypes, lit_prototypes
from recognition.recogniser.read_line import ReadLine
from recognition.recogniser.recogniser import features_of
from recognition.see.codes import Code, codes_of, without_codes
from recognition.see.edges_seen import picture_fault
from recognition.see.photo_frame import area_about, cut
from recognition.see.photo_sizes import LARGE, SIZES, is_large_enough, shrunk, shrunk_versions
from recognition.see.registered import photo_views, stainless_view
from recognition.see.text_line import TextLine
from recognition.see.view import View, photo_view
from recognition.settings import ReaderSettings, Repertoire
from recognition.step_times import StepTimes

CLEARLY_NATS = 0.5
"""Log odds by which a reading without stains must exceed that of the photograph itself, nats."""
LEFT_OUT = "photograph {} does not show what the first one shows; it was left out"


class VisionReader:
    """Makes evidence of photographs; keeps prototypes of fonts between them. Raises FontError or MarksError."""

    def __init__(self, settings: ReaderSettings | None = None) -> None:
        self.settings = settings if settings is not None else ReaderSettings()
        if "network" not in self.settings.experts:
            raise MarksError(
                f"{', '.join(self.settings.experts)} cannot read photographs",
                hint="add the expert network, or read by touch: --mode tactile",
            )
        repertoire = Repertoire(self.settings)
        self.fonts, self._scaled = repertoire.named, repertoire.request
        # a height in mm cannot be used on a photograph of unknown scale
        self._unscaled = replace(self._scaled, height_mm=None)

    def of_photo(self, photo: Photo) -> SenseEvidence:
        """Evidence of a photograph, with no more pixels than its characters need."""
        whole, deadline = photo, Deadline(self.settings.limit_s)
        request = replace(self._scaled if photo.pitch_mm is not None else self._unscaled, deadline=deadline)
        if (area := request.area) is not None:
            photo, request = cut(photo, area), request.inside(area)
        sizes = shrunk_versions(photo)
        smallest = next(sizes)
        if (fault := picture_fault(smallest)) is not None:
            findings = (Finding.of(ReadingFlag[fault.name]),)
            log = Log(
                findings, _file_notes(photo), photo=smallest, whole_photo=whole, photos=1 + len(photo.others)
            )
            return SenseEvidence("vision", log=log)
        codes = codes_of(shrunk(photo, SIZES[-1]))
        large = photo.shape[0] * photo.shape[1] > LARGE and not request.lines
        seen = self._of_part(photo, request, codes) if large else None
        if seen is None:
            seen = self._of_sizes(chain((smallest,), sizes), request, codes, only_known=large)
        evidence = seen.with_layout()
        layout, shown = evidence.layout, evidence.log.photo
        if not large and shown is not None and layout is not None and layout.line is not None:
            evidence = self._of_size(shown, request, codes, (layout.line,)).with_layout()
        cropped = evidence.log.photo is None or evidence.log.whole_photo is not None or area is not None
        return evidence.logged(stopped=deadline.stopped, whole_photo=whole if cropped else None)

    def _of_part(self, photo: Photo, request: LineRequest, codes: Sequence[Code]) -> _Seen | None:
        looks = Looks(deadline=request.deadline)
        search = search_of(photo_view(without_codes(shrunk(photo, LARGE), codes)), request, looks)
        lines = read_wide(search)
        for line in lines[:2]:
            area = area_about(line.line, photo)
            sizes = shrunk_versions(cut(photo, area))
            seen = self._of_sizes(sizes, request.inside(area), codes)
            main, part = seen.evidence.main, seen.evidence.lines
            if part is not None and main is not None and is_convincing([main], request.limits.sure):
                others = tuple(other for other in lines if is_clear_text(other) and apart(other, main))
                part = replace(part, others=(*part.others, *others), looks=part.looks + looks.count)
                evidence = replace(seen.evidence.logged(whole_photo=photo), lines=part)
                return replace(seen, evidence=evidence)
        return None

    def _of_sizes(
        self, sizes: Iterator[Photo], request: LineRequest, codes: Sequence[Code], *, only_known: bool = False
    ) -> _Seen:
        about: tuple[TextLine, ...] = ()
        seen: _Seen | None = None
        for photo in sizes:
            if seen is not None and ((only_known and not about) or request.deadline.is_over()):
                break
            larger = self._of_size(photo, request, codes, about)
            main = larger.evidence.main
            if seen is None or main is not None or not request.deadline.stopped:
                seen = larger
            if main is not None and is_large_enough(photo, main.line.height_mm):
                break
            # lines keep their places in a larger picture
            about = larger.found.lines.places if main and main.is_text else ()
        assert seen is not None
        return seen

    def _of_size(
        self, photo: Photo, request: LineRequest, codes: Sequence[Code], about: Sequence[TextLine]
    ) -> _Seen:
        times, bare = StepTimes(), without_codes(photo, codes)
        with times.step("see"):
            views, left_out = photo_views(bare)
        log = Log(
            notes=(*_file_notes(photo), *(LEFT_OUT.format(number) for number in left_out)),
            photo=photo,
            photos=1 + len(photo.others) - len(left_out),
            codes=tuple(codes),
        )
        seen = self._of_views(views, request, log, times, about)
        if photo.others:
            return seen
        choice = score_text(Evidence.of(seen.evidence), self.settings)
        # a sure reading may be in review for a contract: another text must not bypass it
        if choice.score >= self.settings.least_score("vision") or request.deadline.is_over():
            return seen
        clean_view = stainless_view(bare)
        if clean_view is None:
            return seen
        with times.step("find"):
            line = _better_line(clean_view, request, seen.evidence.main)
        if line is None:
            return seen
        again = replace(request, limits=replace(request.limits, most_looks=request.limits.again_looks))
        clean = self._of_views([clean_view], again, log, times, (line, *seen.found.lines.places[1:]))
        other = score_text(Evidence.of(clean.evidence), self.settings)
        surer = log_odds(other.score) > log_odds(choice.score) + CLEARLY_NATS
        # the same text again is no further evidence: it is the same photograph
        if not surer or other.text == choice.text:
            return seen
        texts = frozenset({choice.text} if choice.score > EVEN else ())
        return replace(clean, evidence=clean.evidence.logged(other_texts=texts))

    def _of_views(
        self,
        views: Sequence[View],
        request: LineRequest,
        log: Log,
        times: StepTimes,
        about: Sequence[TextLine],
    ) -> _Seen:
        with times.step("find"):
            found = read_lines(views, request, about=about, twice=bool(self.fonts))
            part = found.lines
            if part.main is not None:
                part = replace(part, main=self._with_faces(views, part.main))
        return _Seen(SenseEvidence("vision", tuple(views), part, None, log), found, times)

    @cached_property
    def prototypes(self) -> tuple[Prototypes, ...]:
        """Prototypes of each named font, under several lights; made when a line first needs them."""
        chars_of, map = self._scaled.chars_of, face_library("vision").map
        return tuple(lit_prototypes(font, chars, map) for font in self.fonts if (chars := chars_of(font)))

    def _with_faces(self, views: Sequence[View], main: ReadLine) -> ReadLine:
        if not self.settings.faces_judge or not main.columns.size:
            return main
        library, looks = face_library("vision"), [features_of(view.strip(main.line)) for view in views]
        network = main.by_expert["network"]
        cosines = compare_faces(looks, main.columns, self.prototypes, library.faces, library.map, network)
        return read_faces(main, cosines, "vision")


@dataclass(frozen=True, eq=False)
class _Seen:
    """Evidence of a photograph at one size, without another layout yet: of several sizes and views only one counts."""

    evidence: SenseEvidence
    found: FoundLines
    times: StepTimes

    def with_layout(self) -> SenseEvidence:
        with self.times.step("find"):
            lines = self.found.with_layout(self.evidence.lines)
        return replace(self.evidence, lines=lines).logged(seconds=self.times.seconds)


def _better_line(
    view: View, request: LineRequest, main: ReadLine | None, *, slack_nats: float = 1.0
) -> TextLine | None:
    """The line of another view that promises more than the photograph's at a cheap look, or hardly less."""
    search, known = search_of(view, request), [] if main is None else [main]
    least = max((promise_of(line) - slack_nats for line in known), default=-math.inf)
    lines = search.read([*search.candidates()[:1], *(line.line for line in known)], cheap=True)
    return next((read.line for read in search.in_region(lines) if promise_of(read) >= least), None)


def _file_notes(photo: Photo) -> tuple[str, ...]:
    return tuple(dict.fromkeys(note for picture in (photo, *photo.others) for note in picture.notes))
