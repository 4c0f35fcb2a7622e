"""The part reader: from files to a reading, for command line, service, cluster and `pipeline.read`.

    files --load, within limits--> HeightMap, Scan, Photo --Reader--> Reading --verify--> Reading with a verdict

mode       height map or scan   photograph only   both
tactile    touch                -                 touch
vision     -                    vision            vision
fused      -                    -                 touch and vision, fused
auto       touch                vision            touch and vision, fused

Frames. A photograph alone is read in its own frame: x, y in mm from its first pixel, if its scale is known. A plan for
touch is made in that frame, and so is a recording of that plan. A height map has a frame of its own; the middle of the
picture is then assumed to lie over the middle of the map.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from glyphs.errors import FileError, MarksError
from glyphs.surface.maps import MAX_PIXELS
from pipeline.common.settings import Limits, ReadSettings
from pipeline.errors import naming, problem_of
from pipeline.formats.part_files import PartFiles
from pipeline.formats.touch_file import read_part_map, read_scan

if TYPE_CHECKING:
    from glyphs.camera.photo import Photo
    from glyphs.soiling.soil import Soil
    from glyphs.surface.maps import HeightMap
    from pipeline.formats.grid import PartMap
    from pipeline.reading.perturbation import Retake
    from recognition.active.active_reading import ActiveReading
    from recognition.active.moves import Region
    from recognition.decision.reading import Reading
    from recognition.find.first_pass import Feel
    from recognition.reader import Reader


MIRRORED_NOTE = "read with the rows of the map in the other order (the file does not state it; set rows)"


def senses_of(part: PartFiles, mode: str) -> tuple[bool, bool]:
    """Whether touch reads a part, and whether vision does.

    Raises:
        FileError: a file that the mode needs is missing.
    """
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
    """Reads parts from their files."""

    def __init__(
        self,
        reader: Reader,
        settings: ReadSettings | None = None,
        *,
        limits: Limits | None = None,
    ) -> None:
        """Make the part reader.

        Args:
            reader: reader, whose templates are reused from part to part.
            settings: mode (see the table above), height files, active touch.
            limits: size limits, checked from the files' headers before anything is decoded.
        """
        self.settings = settings or ReadSettings()
        self.reader, self.mode, self.limits = reader, self.settings.mode, limits
        self.budget_s = self.settings.touch_budget_s

    def read(self, part: PartFiles, *, expected: str = "") -> Reading:
        """Load a part, read it, and verify its expected text, if any.

        Raises:
            FileError: a file of the part cannot be used.
            VerifyError: the expected text cannot be verified.
        """
        return self.verified(self.unverified(part, expected=expected), expected)

    def unverified(
        self,
        part: PartFiles,
        *,
        expected: str = "",
        again: Retake | None = None,
        felt: ActiveReading | None = None,
    ) -> Reading:
        """Read a part without the verdict.

        Args:
            part: its files.
            expected: text that `verified` will check.
            again: simulated second measurement, in place of the files' content.
            felt: reading of its scan, if it was read during active touch.

        Raises:
            FileError: a file of the part cannot be used.
            VerifyError: the expected text does not fit the format.
        """
        return _reviewed_if_cut_short(self.reader.apply_certificate(self._read(part, expected, again, felt)))

    def _read(
        self, part: PartFiles, expected: str, again: Retake | None, felt: ActiveReading | None
    ) -> Reading:
        from pipeline.reading.scan_plan import seen_region
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
                vision = self.reader.vision.read_photo(photo)
            if self.budget_s is not None and top is not None:
                # touch scans where the camera sees the line
                region_mm = seen_region(vision, photo, height_mm=self.reader.settings.height_mm)
        touch = felt.reading if touches and felt is not None else None
        if touches and touch is None:
            with naming(part.scan or part.height_map):
                touch = self._touch(part, top, again, region_mm)
        reading = self.reader.fuse(touch, vision) if touch and vision else touch or vision
        assert reading is not None
        return replace(reading, notes=(*reading.notes, *notes))

    def _photo(self, part: PartFiles, *, touches: bool) -> tuple[Photo | None, list[str]]:
        """The photograph, and notes on unusable ones."""
        try:
            photo, problems = load_photos(part, self.limits)
            return photo, [f"read without one of its photographs: {problem}" for problem in problems]
        except FileError as problem:
            if self.mode != "auto" or not touches:
                raise
            return None, [f"read by touch alone: {problem}"]

    def verified(self, reading: Reading, expected: str) -> Reading:
        """Add the verdict on the expected text, if any, to a reading.

        Raises:
            VerifyError: the text cannot be verified.
        """
        return self.reader.verify(reading, expected) if expected else reading

    def _touch(
        self, part: PartFiles, top: PartMap | None, again: Retake | None, region_mm: Region | None
    ) -> Reading:
        """Read the height map; without one the recorded scan."""
        if top is None:
            return self._scan(part, again)
        feel = None
        if again is not None:
            feel = again.feel(fidelity=self.reader.settings.fidelity, soil=top.soil, part_id=part.name)
        return read_surface(
            self.reader, top, part.name, feel=feel, budget_s=self.budget_s, region_mm=region_mm
        )

    def _scan(self, part: PartFiles, again: Retake | None) -> Reading:
        """Read a recorded scan, which is preferred to a height map."""
        from recognition.active.replay import replay

        scan = read_scan(part.scan, most=MOST_SCAN_SAMPLES if self.limits else None)
        if scan.log is not None and again is None:
            return replay(self.reader.touch, scan).reading
        return self.reader.touch.read_scan(scan if again is None else again.recorded(scan))

    def _check_expected(self, part: PartFiles, expected: str) -> None:
        grammar = self.reader.grammar
        if expected and grammar is not None and (broken := grammar.objections(expected)):
            from recognition.decision.verify import VerifyError

            where = f"text expected of {part.name}"
            raise VerifyError(
                f"is {expected!r}, but {'; '.join(broken)}", where=where, hint="correct one of them"
            )


def _reviewed_if_cut_short(reading: Reading) -> Reading:
    """Send a reading to review if the stage failed before it had scanned all that was needed."""
    scan = None if reading.touch is None else reading.touch.trace.scan
    if scan is None or scan.log is None or not scan.log.problem:
        return reading
    from recognition.decision.decide import Finding, ReadingFlag

    n = len(scan.log.passes)
    note = f"the stage failed after {n} {'pass' if n == 1 else 'passes'}: {scan.log.problem}"
    return reading.with_findings(Finding(ReadingFlag.STAGE_FAILED, note))


def read_surface(
    reader: Reader,
    top: PartMap,
    part_id: str = "",
    *,
    feel: Feel | None = None,
    budget_s: float | None = None,
    region_mm: Region | None = None,
) -> Reading:
    """Read a height map by touch.

    Args:
        reader: reader of both senses.
        top: the part and its soil. If the order of its rows is unknown, a serial that reads differently mirrored goes
            to review, and an uncertain part is also read mirrored, unless the mirrored line is far less likely.
        part_id: name of the part.
        feel: scan function used in place of the default plan.
        budget_s: most stage seconds; if given, the part is scanned pass by pass instead.
        region_mm: region of the line on the map, if known; used pass by pass only.
    """

    def read(one: HeightMap, soil: Soil | None, region_mm: Region | None = None) -> Reading:
        if budget_s is None or feel is not None:
            return touch.read_height_map(one, soil=soil, part_id=part_id, feel=feel)
        from pipeline.reading.active_touch import read_actively

        return read_actively(touch, one, budget_s=budget_s, soil=soil, part_id=part_id, region_mm=region_mm)

    soil = top.soil
    touch = reader.touch if top.rows_known else reader.touch.with_unknown_rows()
    found = read(top.height_map, soil, region_mm)
    if top.rows_known:
        return found
    from recognition.decision.decide import ReadingFlag
    from recognition.decision.score import serial_is_sure

    # a simulated second measurement has the dirt on the map as given, and cannot be mirrored
    if serial_is_sure(found) or (feel is not None and soil is not None):
        return found
    if not touch.may_be_mirrored(found):
        return found
    other = read(top.height_map.mirrored, None if soil is None else soil.mirrored)
    named = found.flags & ReadingFlag.LAYOUT and not serial_is_sure(other)
    if named or other.nats_read <= found.nats_read:
        return found
    return replace(other, notes=(*other.notes, MIRRORED_NOTE))


def load_photos(part: PartFiles, limits: Limits | None = None) -> tuple[Photo, tuple[MarksError, ...]]:
    """Load the photographs of a part as one; return it and notes on unusable ones.

    Raises:
        FileError: it has none, or none can be used; names the problem of the first.
    """
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
