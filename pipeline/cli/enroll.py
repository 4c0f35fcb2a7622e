"""`tactile-marks enroll`: learn a die's shapes from parts that a person has reviewed."""

from __future__ import annotations

import tempfile
from contextlib import ExitStack
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from pipeline.cli.exit_status import FAILED, USAGE, CommandError, failures_reported
from pipeline.cli.settings import READING, SERVICE, Config, ReadingOfFile, ServiceOfFile, StoreAddress

if TYPE_CHECKING:
    from pipeline.reading.enrolment import EnrolReport, ReviewedPart
    from pipeline.service.settings import ServiceSettings
    from pipeline.store.evidence_folder import EvidenceFolder
    from pipeline.store.store import Store

_PAGE = 500


def enroll(
    *inputs: Path,
    database: Path,
    font: str,
    truth: Path | None = None,
    from_store: Annotated[bool, Parameter(negative="")] = False,
    store: StoreAddress = None,
    since: float | None = None,
    picture: Path | None = None,
    check: bool = True,
    reading: ReadingOfFile = READING,
    service: ServiceOfFile = SERVICE,
    config: Config = None,
) -> int:
    """Learn the shapes of a die from reviewed parts, and keep them in a glyph database.

    Parameters
    ----------
    inputs
        Height maps and scans, folders or globs of them.
    database
        Glyph database to add them to, for read --database; made, with the built-in fonts, if it is missing.
    font
        Name for this die, such as press-7; use it again to learn more of the same die.
    truth
        CSV with the columns part and text: what a person read on each part.
    from_store
        Take the reviewed parts of the service's store instead.
    since
        Only parts reviewed in this many days up to now.
    picture
        Picture of the exemplars, .png, .svg or .pdf. [default: the database's name and .png]
    check
        Read each half of the parts with what the other half taught, and say whether it helps.
    """
    if from_store == bool(inputs):
        raise CommandError("enroll: name parts with --truth, or give --from-store", status=USAGE)
    if inputs and truth is None:
        raise CommandError("enroll: give --truth, a table of what stands on the parts", status=USAGE)
    if not from_store and (store is not None or since is not None):
        raise CommandError("enroll: --store and --since go with --from-store", status=USAGE)
    if since is not None and not 0.0 < since <= 36_500.0:
        raise CommandError(f"enroll: --since is {since} days", hint="give a positive number", status=USAGE)
    with failures_reported(), ExitStack() as stack:
        from glyphs.atomic import check_writable
        from pipeline.plots.pictures import check_picture
        from pipeline.reading.enrolment import enrol
        from pipeline.reading.enrolment_check import check_held_out
        from pipeline.workers.options import in_a_worker

        left_out = 0
        if from_store:
            opened, folder = _opened(store, service)
            stack.callback(opened.close)
            links = Path(stack.enter_context(tempfile.TemporaryDirectory()))
            parts, left_out = _of_store(opened, folder, links, since)
        else:
            assert truth is not None
            opened, parts = None, _of_table(inputs, truth)
        if not parts:
            raise CommandError("enroll: no reviewed part with a scan or a height map was found")
        picture = picture or database.with_suffix(".png")
        check_writable(database)
        check_picture(picture)
        report = in_a_worker(enrol, parts, database, font=font, settings=reading)
        if opened is not None:
            for part_id, characters in report.enrolled:
                opened.note_event(part_id, "enrolled", {"font": font, "characters": characters})
        print(report.describe())
        if report.exemplars:
            _draw(database, report, picture)
            print(f"wrote {picture}")
        if check and report.exemplars:
            held_out = in_a_worker(check_held_out, parts, database, font=font, settings=reading)
            print(held_out.describe() if held_out else "held out: too few parts to check the font on others")
    if left_out:
        print(
            f"{left_out} reviewed parts left out: they were never scanned, or their files are no longer kept"
        )
    return 0 if report.enrolled or report.known else FAILED


def _draw(database: Path, report: EnrolReport, picture: Path) -> None:
    from glyphs.stamping.database import load_database
    from pipeline.plots.exemplars_picture import exemplars_figure
    from pipeline.plots.pictures import save_figure

    held = load_database(database)
    own = [one for one in held.exemplars if one.font_name == report.font and one.relief is not None]
    save_figure(exemplars_figure(held.fonts[report.font], own, report.set_aside), picture)


def _of_table(inputs: tuple[Path, ...], truth: Path) -> list[ReviewedPart]:
    """The parts that a table tells the text of."""
    from pipeline.formats.find_parts import discover
    from pipeline.formats.truth import load_truth
    from pipeline.reading.enrolment import ReviewedPart

    texts = load_truth(truth)
    found = []
    for part in discover(inputs):
        text = texts.text_of(part.name)
        if part.problem is not None:
            raise part.problem
        if text and part.felt:
            scan, height_map = (Path(file) if file else None for file in (part.scan, part.height_map))
            found.append(ReviewedPart(part.name, text, scan, height_map))
    return found


def _opened(url: str | None, service: ServiceSettings) -> tuple[Store, EvidenceFolder]:
    from pipeline.store.evidence_folder import EvidenceFolder
    from pipeline.store.store import Store, StoreError

    try:
        return Store.open(url or service.store_url), EvidenceFolder(service.evidence_folder)
    except StoreError as error:
        raise CommandError(f"enroll: {error}") from error


def _of_store(
    opened: Store, folder: EvidenceFolder, links: Path, since_days: float | None
) -> tuple[list[ReviewedPart], int]:
    """The reviewed parts of a store, and how many of them were left out.

    The evidence's files are named by what they hold; links in a folder of their own bear the suffixes that say how
    they are read.
    """
    from pipeline.common.records import EvidenceKind, ReviewAction
    from pipeline.reading.enrolment import ReviewedPart

    since = None if since_days is None else datetime.now(UTC) - timedelta(days=since_days)
    found: list[ReviewedPart] = []
    left_out, after = 0, None
    while page := opened.reviewed(since=since, after=after, limit=_PAGE):
        after = page[-1].id
        for part in page:
            if part.review is None or part.review.action is ReviewAction.UNREADABLE or not part.text:
                continue
            files: dict[EvidenceKind, Path] = {}
            for record in opened.evidence(part.id):
                if record.kind not in (EvidenceKind.SCAN, EvidenceKind.HEIGHT_MAP):
                    continue
                for path in folder.whole((record.sha256,)):
                    link = links / (record.sha256 + Path(record.name).suffix)
                    if not link.exists():
                        link.symlink_to(path.absolute())
                    files[record.kind] = link
            if not files:
                left_out += 1
                continue
            scan, height_map = files.get(EvidenceKind.SCAN), files.get(EvidenceKind.HEIGHT_MAP)
            found.append(ReviewedPart(part.id, part.text, scan, height_map))
    return found, left_out
