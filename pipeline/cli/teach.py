"""`tactile-marks enroll`, `glyphs` and `synth`: shapes of a die, fonts, and parts to try them on."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable
from contextlib import ExitStack
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter
from cyclopts.validators import Number

from pipeline.cli.choices import (
    DieName,
    FaceName,
    Flag,
    LayoutName,
    PlateName,
    Positive,
    PracticeName,
    listed,
)  # fmt: skip
from pipeline.cli.exit_status import FAILED, CommandError, UsageError
from pipeline.cli.settings import READING, SERVICE, Config, ReadingOfFile, ServiceOfFile, StoreAddress

if TYPE_CHECKING:
    from glyphs.fonts.glyph import Font
    from pipeline.reading.enrolment import EnrolReport, ReviewedPart
    from pipeline.store.evidence_folder import EvidenceFolder
    from pipeline.store.store import Store

_PAGE = 500  # reviewed parts that are asked of a store at once


def enroll(
    *inputs: Path,
    database: Path,
    font: str,
    truth: Path | None = None,
    from_store: Flag = False,
    store: StoreAddress = None,
    since: Annotated[float | None, Parameter(validator=Number(gt=0, lte=36_500))] = None,
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
        raise UsageError("enroll: name parts with --truth, or give --from-store")
    if inputs and truth is None:
        raise UsageError("enroll: give --truth, a table of what stands on the parts")
    if not from_store and (store is not None or since is not None):
        raise UsageError("enroll: --store and --since go with --from-store")
    from glyphs.atomic import check_writable
    from pipeline.cli.store import opened_store
    from pipeline.plots.pictures import check_picture
    from pipeline.reading.enrolment import enrol
    from pipeline.reading.enrolment_check import check_held_out
    from pipeline.workers.options import in_a_worker

    with ExitStack() as stack:
        left_out, opened = 0, None
        if truth is not None and inputs:
            parts = _of_table(inputs, truth)
        else:
            from pipeline.store.evidence_folder import EvidenceFolder

            opened = stack.enter_context(opened_store(store, service))
            links = Path(stack.enter_context(tempfile.TemporaryDirectory()))
            parts, left_out = _of_store(opened, EvidenceFolder(service.evidence_folder), links, since)
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
    """List the parts whose text is in a table."""
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


def _of_store(
    opened: Store, folder: EvidenceFolder, links: Path, since_days: float | None
) -> tuple[list[ReviewedPart], int]:
    """List the reviewed parts of a store, and count those left out.

    Files of evidence are named by their hash; links to them, in a folder of their own, have the suffixes of their kind.
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


def list_fonts(database: Path | None = None) -> int:
    """List the built-in fonts, or those of a glyph database, with the number of their characters.

    Parameters
    ----------
    database
        Glyph database.
    """
    from glyphs.fonts.outlines import BUILTIN_FONTS, load_font
    from glyphs.stamping.database import load_database

    if database is not None:
        content = load_database(database)
        fonts = list(content.fonts.values())
    else:
        fonts = [load_font(name) for name in BUILTIN_FONTS]
    for font in fonts:
        stroke = f"stroke h x {font.stroke_ratio:.3g}" if font.stroke_ratio else "outlines"
        print(f"{font.name:<20} {len(font.glyphs):4d} characters  {stroke:<18}  {font.source}")
    if database is not None:
        print(f"{len(content.dies)} dies, {len(content.exemplars)} enrolled exemplars")
    return 0


def show(*font: str, out: Path | None = None, face: FaceName = "flat", height_mm: float = 5.0) -> int:
    """Draw every character of fonts, and some as stamped relief.

    Parameters
    ----------
    font
        Built-in names, TTF/OTF files or glyph databases (.glyphs); by default all built-in fonts.
    out
        Picture to write, .png, .svg or .pdf. By default NAME.png here, of the only file or font that is named; else
        fonts.png.
    face
        Face of the die.
    height_mm
        Character height.
    """
    from glyphs.fonts.outlines import BUILTIN_FONTS
    from glyphs.stamping.faces import Face
    from pipeline.plots.font_sheet import sheet_figure
    from pipeline.plots.pictures import check_picture, save_figure

    out = out or Path(f"{Path(font[0]).stem if len(font) == 1 else 'fonts'}.png")
    check_picture(out)
    fonts = [one for name in font or BUILTIN_FONTS for one in _fonts_of(name)]
    save_figure(sheet_figure(fonts, die_face=Face(face), height_mm=height_mm), out)
    print(f"wrote {out}")
    return 0


def build(out: Path, *font: str) -> int:
    """Write a glyph database of fonts, to be given to `read --database`.

    Parameters
    ----------
    out
        Database to write.
    font
        Built-in names or TTF/OTF files.
    """
    if not font:
        raise UsageError("glyphs build: name at least one font")
    from glyphs.atomic import check_writable
    from glyphs.fonts.outlines import load_font
    from glyphs.stamping.database import GlyphDatabase, save_database

    check_writable(out)
    fonts = [load_font(name) for name in font]
    save_database(GlyphDatabase(fonts={f.name: f for f in fonts}), out)
    print(f"wrote {out}: " + ", ".join(f"{f.name} ({len(f.glyphs)})" for f in fonts))
    return 0


def _fonts_of(name: str) -> list[Font]:
    """Load the fonts of a glyph database, else the font of a name or file."""
    from glyphs.fonts.outlines import load_font
    from glyphs.stamping.database import DatabaseError, load_database

    if Path(name).suffix.lower() != ".glyphs":
        return [load_font(name)]
    fonts = list(load_database(Path(name)).fonts.values())
    if not fonts:
        raise DatabaseError(f"{name} holds no font", hint="enroll parts, or build it from fonts")
    return fonts


@dataclass(frozen=True)
class Stamping:
    """Stamping and photographs of the parts; fields of `pipeline.formats.synth.SynthSpec`.

    Attributes:
        format: Mask of the serials: A letter, 9 digit, * either, any other character itself.
        font: Built-in name or TTF/OTF file.
        seed: Of everything random: the same seed gives the same parts.
        height_mm: Character height in mm.
        depth_mm: Depth of the marks in mm; the usual one for the height unless given.
        face: Face of the die.
        bevel_deg: Slope of the walls, degrees.
        raised: Raised marks instead of sunk ones.
        variation: Let blows and plates differ as in a shop.
        practice: Who stamps: a press, a hand with single stamps, or nobody (all ideal); a press unless given.
        die: In place of a face: also a V with a blunt edge, pile-up on one side, double strikes, one wall missing.
        plate: What is stamped: bent (cylinder: line along its axis; ring: around it), or left rough by a tool.
        layout: A straight line, one turned by up to 5 degrees, an arc, or another line above or below.
        pixel_mm: Size of a pixel on the part, mm.
        light_azimuth_deg: Where the lamp stands: 0 at the right, 90 below, 270 above; drawn at random unless given.
        light_elevation_deg: How high it stands over the plate; drawn from 25 to 65 unless given.
        lights: Photographs of each part, PART.light-1.png and so on, the lamp on another side each time.
    """

    format: str
    font: str = "gothic"
    seed: int = 0
    height_mm: float = 5.0
    depth_mm: float | None = None
    face: FaceName = "flat"
    bevel_deg: float = 45.0
    raised: Flag = False
    variation: bool = True
    practice: PracticeName | None = None
    die: DieName | None = None
    plate: PlateName | None = None
    layout: LayoutName | None = None
    pixel_mm: float = 0.06
    light_azimuth_deg: float | None = None
    light_elevation_deg: float | None = None
    lights: int = 1


def synth(
    out: Path,
    *,
    parts: int,
    stamping: Annotated[Stamping, Parameter(name="*")],
    dirt: float = 0.0,
    soil: str = "workshop",
    mix: str = "",
    photo: bool = True,
    jobs: Positive = None,
    overwrite: Flag = False,
) -> int:
    """Stamp serials on plates: part-000.npz, part-000.png and so on, and truth.csv.

    Parameters
    ----------
    out
        Folder for them.
    parts
        Number of parts.
    dirt
        How dirty, 0 to 1.
    soil
        What the dirt is; of several, separated by commas, the first lies lowest: workshop, caked, rust, paint, weld,
        mud, wear, casting, or module:function of your own. The workshop's is a mixture of seven kinds.
    mix
        Amounts of these kinds, 0 to 1, in place of their shares of the mixture, such as grime=0.5,oil=0: grime (caked
        into the grooves), oil, swarf, scratches, pits, paint (chipped), burr (a ragged rim).
    photo
        Take a photograph of every part.
    jobs
        Worker processes; one for each core unless given, or none for a few parts.
    overwrite
        Write into a folder that is not empty.
    """
    from dataclasses import replace
    from functools import partial

    from glyphs.soiling.soiled import Soiling
    from glyphs.soiling.workshop.mixture import Dirt
    from glyphs.stamping.faces import Face
    from pipeline.formats.synth import SynthSpec, write_parts
    from pipeline.workers.executors import ordered_map
    from pipeline.workers.options import ExecutorOptions

    mixture = replace(Dirt.of(dirt), **_amounts(mix, vars(Dirt.of(0.0)))) if mix else None
    made_so = {**vars(stamping), "face": Face(stamping.face)}
    spec = SynthSpec(soiling=Soiling(listed(soil), dirt, mixture=mixture), **made_so)
    with ExecutorOptions(jobs=jobs).opened(parts) as executor:
        each = partial(ordered_map, executor)
        made = write_parts(spec, out, parts=parts, photos=photo, overwrite=overwrite, each=each)
    print(f"wrote {len(made)} parts and truth.csv to {out}")
    return 0


def _amounts(mix: str, kinds: Iterable[str]) -> dict[str, float]:
    """Parse kinds of dirt with their amounts.

    Raises:
        UsageError: another kind, or no number.
    """
    try:
        found = {kind.strip(): float(amount) for kind, amount in (one.split("=") for one in listed(mix))}
    except ValueError as error:
        raise UsageError(f"--mix is {mix!r}", "write kinds and amounts, such as grime=0.5,oil=0") from error
    if unknown := [kind for kind in found if kind not in kinds]:
        raise UsageError(f"--mix has no {unknown[0]!r}", f"the kinds are {', '.join(kinds)}")
    return found
