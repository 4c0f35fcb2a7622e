"""The part reader: from files to a reading, for command line, service, cluster and `pipeline.read`.

mode       height map or scan   photograph only   both
tactile    touch                -                 touch
vision     -                    vision            vision
fused      -                    -                 touch and vision, fused
auto       touch                vision            touch and vision, fused

A photograph alone is read in its own frame: x, y in mm from its first pixel, if its scale is known; so is a recording
of a plan made by it. The middle of a photograph is assumed to lie over the middle of a height map.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from glyphs.errors import FileError, MarksError
from glyphs.surface.maps import MAX_PIXELS
from pipeline.common.settings import Limits, ReadSettings
from pipeline.common.texts import without_blanks
from pipeline.errors import naming, problem_of
from pipeline.formats.part_files import PartFiles
from pipeline.formats.touch_file import read_part_map, read_scan

if TYPE_CHECKING:
    from glyphs.camera.photo import Photo
    from glyphs.soiling.soil import Soil
    from glyphs.surface.maps import HeightMap
    from pipeline.reading.perturbation import Retake
    from recognition.active.active_reading import ActiveReading
    from recognition.active.moves import Region
    from recognition.decide.evidence import Evidence, SenseEvidence
    from recognition.decide.reading import Reading
    from recognition.reader import Reader
    from recognition.see.virtual_array import VirtualArray
    from recognition.surface import OpenStage, Surface
    from whisker_array.scan.session import StageSession


def senses_of(part: PartFiles, mode: str) -> tuple[bool, bool]:
    """Whether touch reads a part, and whether vision does. Raises FileError: a file that the mode needs is missing."""
    tactile, visual = part.felt, bool(part.photo)
    named = part.scan or part.height_map or part.photo or part.name
    if mode in ("tactile", "fused") and not tactile:
        raise problem_of(named, "has no height map and no scan", "add one, or read it with --mode vision")
    if mode in ("vision", "fused") and not visual:
        raise problem_of(named, "has no photograph", "add one of the same stem, or read with --mode tactile")
    touches = tactile and mode != "vision"
    return touches, not touches or (visual and mode in ("fused", "auto"))


# most samples of a recording (instants times channels), if there are limits
MOST_SCAN_SAMPLES = 60_000_000


class PartReader:
    """Reads parts from their files; `limits` are checked from their headers before anything is decoded."""

    def __init__(
        self,
        reader: Reader,
        settings: ReadSettings | None = None,
        *,
        limits: Limits | None = None,
    ) -> None:
        self.settings = settings or ReadSettings()
        self.reader, self.mode, self.limits = reader, self.settings.mode, limits
        self.budget_s = self.settings.touch_budget_s

    def read(
        self,
        part: PartFiles,
        *,
        expected: str = "",
        again: Retake | None = None,  # simulated second measurement, in place of the files' content
        felt: ActiveReading | None = None,  # reading of its scan, if it was read during active touch
        notes: tuple[str, ...] = (),
    ) -> Reading:
        """Load a part, read it, and verify its expected text, if any. Raises FileError, VerifyError."""
        evidence = self._evidence(part, expected, again, felt)
        return self.reader.decide(replace(evidence, expected=expected, notes=(*evidence.notes, *notes)))

    def _evidence(
        self, part: PartFiles, expected: str, again: Retake | None, felt: ActiveReading | None
    ) -> Evidence:
        from pipeline.reading.scan_plan import seen_region
        from recognition.decide.evidence import Evidence
        from recognition.reader import centre_on

        if part.problem is not None:
            raise part.problem
        self._check_expected(part, expected)
        touches, sees = senses_of(part, self.mode)
        if self.mode == "auto" and touches and "network" not in self.reader.settings.experts:
            sees = False  # templates alone read by touch only
        photo, notes = None, list[str]()
        if sees:  # first, because touch takes longer
            photo, notes = self._photo(part, touches=touches)
        top = None
        if touches and felt is None and not part.scan:
            most = self.limits.map_samples if self.limits else MAX_PIXELS
            with naming(part.height_map):
                top = read_part_map(Path(part.height_map), self.settings, most=most)
        if again is not None:
            photo = None if photo is None else again.photo(photo)
            top = None if top is None else replace(top, height_map=again.surface(top.height_map))
        vision, region_mm = None, None
        if photo is not None:
            photo = photo if top is None else centre_on(photo, top.height_map)
            with naming(part.photo):
                vision = self.reader.look_at(photo)
            if self.budget_s is not None and top is not None:
                # touch scans where the camera sees the line
                seen = self.reader.decide(Evidence(vision=vision))
                region_mm = seen_region(seen, photo, height_mm=self.reader.settings.height_mm)
        touch = felt.evidence if touches and felt is not None else None
        if touches and touch is None:
            with naming(part.scan or part.height_map):
                touch = self._touch(part, top, again, region_mm)
        texts = frozenset({without_blanks(part.other_text)} - {""})
        return Evidence(touch, vision, notes=tuple(notes), other_texts=texts)

    def _photo(self, part: PartFiles, *, touches: bool) -> tuple[Photo | None, list[str]]:
        try:
            photo, problems = load_photos(part, self.limits)
            return photo, [f"read without one of its photographs: {problem}" for problem in problems]
        except FileError as problem:
            if self.mode != "auto" or not touches:
                raise
            return None, [f"read by touch alone: {problem}"]

    def _touch(
        self, part: PartFiles, top: Surface | None, again: Retake | None, region_mm: Region | None
    ) -> SenseEvidence:
        if top is None:
            scan = read_scan(part.scan, most=MOST_SCAN_SAMPLES if self.limits else None)
            return self.reader.feel_scan(scan if again is None else again.recorded(scan))
        surface = replace(top, part_id=part.name)
        if again is not None:
            feel = again.feel(self.reader.settings.array, soil=top.soil, part_id=part.name)
            surface = replace(surface, feel=feel)
        elif self.budget_s is not None:
            stage = simulated_stage(self.reader.settings.array, part.name)
            surface = replace(surface, stage=stage, budget_s=self.budget_s, region_mm=region_mm)
        return self.reader.feel(surface)

    def _check_expected(self, part: PartFiles, expected: str) -> None:
        grammar = self.reader.grammar
        if expected and grammar is not None and (broken := grammar.objections(expected)):
            from recognition.decide.verify import VerifyError

            where = f"text expected of {part.name}"
            raise VerifyError(
                f"is {expected!r}, but {'; '.join(broken)}", where=where, hint="correct one of them"
            )


def simulated_stage(array: VirtualArray, part_id: str) -> OpenStage:
    """A function that mounts a surface on the simulated stage."""
    from pipeline.reading.scan_plan import FramedSession
    from recognition.see.virtual_bench import VirtualBench

    def open_stage(
        surface: HeightMap, soil: Soil | None, height_mm: float, region_mm: Region | None
    ) -> StageSession:
        bench = VirtualBench(surface, height_mm, array, soil=soil, part_id=part_id).mounted()
        session: StageSession = bench.open_session()
        if region_mm is None:
            return session
        # the field limits the passes, and the recording stores it
        return FramedSession(session, x_mm=0.0, y_mm=0.0, field_mm=region_mm)

    return open_stage


def load_photos(part: PartFiles, limits: Limits | None = None) -> tuple[Photo, tuple[MarksError, ...]]:
    """Load the photographs of a part as one, and notes on unusable ones. FileError, of the first: none can be used."""
    from pipeline.formats.photos import read_photo

    if not part.photos:
        raise FileError(part.name, "has no photograph", "add one of the same stem")
    if part.photo_problem is not None:
        raise part.photo_problem
    first: Photo | None = None
    problems: list[MarksError] = []
    most = MAX_PIXELS if limits is None else limits.photo_pixels
    for path in part.photos:
        try:
            with naming(path):
                photo = read_photo(Path(path), most=most)
                first = photo if first is None else replace(first, others=(*first.others, photo))
        except FileError as problem:
            problems.append(problem)
    if first is None:
        raise problems[0]
    return first, tuple(problems)
