"""`tactile-marks enroll`: learn the shapes of a die from reviewed parts."""

from __future__ import annotations

import tempfile
from contextlib import ExitStack
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter
from cyclopts.validators import Number

from pipeline.cli.exit_status import FAILED, CommandError, UsageError
from pipeline.cli.settings import READING, ReadingOfFile
from pipeline.cli.shared import Flag, write_picture
from pipeline.cli.store import DATA, AtData

if TYPE_CHECKING:
    from pipeline.formats.part_files import PartFiles
    from pipeline.reading.enrolment import EnrolReport
    from pipeline.store.evidence_folder import EvidenceFolder
    from pipeline.store.store import Store

_PAGE = 500  # reviewed parts that are fetched from a store at once


def enroll(
    *inputs: Path,
    database: Path,
    font: str,
    truth: Path | None = None,
    from_store: Flag = False,
    since: Annotated[float | None, Parameter(validator=Number(gt=0, lte=36_500))] = None,
    picture: Path | None = None,
    check: bool = True,
    reading: ReadingOfFile = READING,
    location: AtData = DATA,
) -> int:
    """Learn the shapes of a die from reviewed parts, and keep them in a glyph database.

    Args:
        inputs: Height maps and scans, folders or globs of them.
        database: Glyph database to add them to, for read --database; made, with the built-in fonts, if it is missing.
        font: Name for this die, such as press-7; use it again to learn more of the same die.
        truth: CSV with the columns part and text: the serial that a person read on each part.
        from_store: Use the reviewed parts of the service's store instead.
        since: Only parts reviewed within this many days.
        picture: Picture of the exemplars, .png, .svg or .pdf. [default: the database's name with .png]
        check: Read each half of the parts with the shapes learned from the other half, and report whether that helps.
    """
    if from_store == bool(inputs):
        raise UsageError("enroll: name parts with --truth, or give --from-store")
    if inputs and truth is None:
        raise UsageError("enroll: give --truth, a table of the parts' serials")
    if not from_store and (location.store is not None or since is not None):
        raise UsageError("enroll: --store and --since go with --from-store")
    from pipeline.common.output_paths import PICTURES, check_writable
    from pipeline.reading.enrolment import enrol
    from pipeline.reading.enrolment_check import check_held_out
    from pipeline.workers.options import in_a_worker

    with ExitStack() as stack:
        left_out, opened = 0, None
        if truth is not None and inputs:
            parts = _of_table(inputs, truth)
        else:
            opened = stack.enter_context(location.open_store())
            links = Path(stack.enter_context(tempfile.TemporaryDirectory()))
            parts, left_out = _of_store(opened, location.evidence, links, since)
        if not parts:
            raise CommandError("enroll: no reviewed part with a scan or a height map was found")
        picture = picture or database.with_suffix(".png")
        check_writable(database)
        check_writable(picture, PICTURES)
        report = in_a_worker(enrol, parts, database, font=font, settings=reading)
        if opened is not None:
            for part_id, characters in report.enrolled:
                opened.note_event(part_id, "enrolled", {"font": font, "characters": characters})
        print(report.describe())
        if report.exemplars:
            _draw(database, report, picture)
        if check and report.exemplars:
            held_out = in_a_worker(check_held_out, parts, database, font=font, settings=reading)
            print(held_out.describe() if held_out else "held out: too few parts to check the font on others")
    if left_out:
        print(
            f"{left_out} reviewed parts left out: they were never scanned, or their files are no longer kept"
        )
    return 0 if report.enrolled or report.known else FAILED


def _draw(database: Path, report: EnrolReport, picture: Path) -> None:
    from pipeline.formats.glyph_database import load_database
    from pipeline.plots.fonts_picture import exemplars_figure

    held = load_database(database)
    exemplars = [exemplar for exemplar in held.exemplars if exemplar.font_name == report.font]
    write_picture(exemplars_figure(held.fonts[report.font], exemplars, report.set_aside), picture)


def _of_table(inputs: tuple[Path, ...], truth: Path) -> list[PartFiles]:
    from pipeline.formats.find_parts import discover
    from pipeline.formats.truth import load_truth

    texts, listed = load_truth(truth), discover(inputs)
    listed.report_passed_over([truth])
    parts = []
    for part in listed:
        text = texts.text_of(part.name)
        if part.problem is not None:
            raise part.problem
        if text and part.felt:
            parts.append(replace(part, expected=text))
    return parts


def _of_store(
    opened: Store, folder: EvidenceFolder, links: Path, since_days: float | None
) -> tuple[list[PartFiles], int]:
    """The reviewed parts of a store, oldest first, and the number of those left out.

    Evidence files are named by their hash, without suffix; links to them, in a folder of their own, have the suffix.
    """
    from pipeline.common.records import EvidenceKind, PartState, ReviewAction
    from pipeline.formats.part_files import PartFiles

    since = None if since_days is None else datetime.now(UTC) - timedelta(days=since_days)
    parts: list[PartFiles] = []
    left_out, before = 0, None
    while page := opened.parts(state=PartState.REVIEWED, before=before, limit=_PAGE):
        before = page[-1].id
        for part in page:
            if part.review is None or part.review.action is ReviewAction.UNREADABLE or not part.text:
                continue
            if since is not None and part.review.at is not None and part.review.at < since:
                continue
            files: dict[str, Any] = {}
            for record in opened.evidence(part.id):
                if record.kind not in (EvidenceKind.SCAN, EvidenceKind.HEIGHT_MAP):
                    continue
                for path in folder.whole((record.sha256,)):
                    link = links / (record.sha256 + Path(record.name).suffix)
                    if not link.exists():
                        link.symlink_to(path.absolute())
                    files[record.kind.value] = str(link)
            if files:
                parts.append(PartFiles(part.id, expected=part.text, **files))
            else:
                left_out += 1
    return parts[::-1], left_out
