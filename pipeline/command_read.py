"""`tactile-marks read`: parts in, a table of serials out."""

from __future__ import annotations

import sys
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from pipeline.failing import USAGE, CommandError, failures_told

if TYPE_CHECKING:
    from pipeline.batch import Row

ModeName = Literal["tactile", "vision", "fused", "auto"]
FidelityName = Literal["pointwise", "contact"]
Texts = Annotated[list[str] | None, Parameter(negative="")]


def read(
    *inputs: str,
    mode: ModeName | None = None,
    font: Texts = None,
    format: Texts = None,
    lexicon: Path | None = None,
    check: Texts = None,
    exclude: str | None = None,
    verify: str | None = None,
    height_mm: float | None = None,
    fidelity: FidelityName | None = None,
    database: Path | None = None,
    depth_rule: str | None = None,
    min_depth_mm: float | None = None,
    accept_confidence: float | None = None,
    accept_margin: float | None = None,
    truth: Path | None = None,
    out: Path | None = None,
    config: Path | None = None,
) -> int:
    """Read the serials of parts: height maps, scans and photographs, or folders and globs of them.

    The exit status is 1 if any part could not be read, and with --verify unless every part is confirmed.

    Parameters
    ----------
    inputs
        Height maps (.npz, .x3p, .sdf, .sur ...), scans (.h5) and photographs (.png, .jpg ...), or folders and globs
        of them; files of one stem are one part.
    mode
        Senses that read: touch, the camera, both together, or whatever a part has files for. Without it touch
        reads, and the camera what is a photograph only.
    font
        Built-in name or TTF/OTF file; may be repeated. Without it every built-in font competes.
    format
        What serials look like; may be repeated, all must hold. A mask (A letter, 9 digit, * either, any other
        character itself), re:EXPRESSION, sets:AB,0-9,... a place each, vin, check:RULE; +check=RULE and
        +exclude=IOQ may follow any of them.
    lexicon
        File of the serials that there are, one a line; # starts a comment.
    check
        Check digit that must hold, such as luhn, iso7064mod37_2 or stdnum:imei; luhn@3-8 looks at places 3 to 8.
    exclude
        Characters that no serial has, such as IOQ.
    verify
        Text that the parts should bear, or a CSV with the columns part and text: each is confirmed, refuted or
        undecided, and the exit status is 1 unless every part is confirmed.
    height_mm
        Character height in mm; found out if not given.
    fidelity
        How touch is simulated.
    database
        Glyph database to take the fonts from.
    depth_rule
        Rule that the marks must meet, such as 27CFR478.92; parts that do not are told, the text is read alike.
    min_depth_mm
        Depth in mm that the marks must have everywhere; told alike.
    accept_confidence
        Least confidence, 0 to 1, of a reading that is accepted.
    accept_margin
        Least lead of every character over its rival, 0 to 1, in a reading that is accepted.
    truth
        CSV with the columns part and text; prints the accuracy.
    out
        Table to write: .csv, .jsonl or .parquet.
    config
        TOML file with settings; tactile-marks.toml in the working folder is read by itself.
    """
    from pipeline.batch import read_parts
    from pipeline.expected import load_expected
    from pipeline.parts import discover
    from pipeline.read_table import print_table
    from pipeline.readers import Readers
    from pipeline.senses import Mode, Senses
    from pipeline.settings import load_settings
    from pipeline.tables import check_output, write_rows
    from pipeline.truth import load_truth, score

    if not inputs:
        raise CommandError("read: name a height map, a scan, a photograph, a folder or a glob", status=USAGE)
    with failures_told():
        settings = load_settings(
            config=config,
            mode=mode,
            font=tuple(font) if font else None,
            format=tuple(format) if format else None,
            lexicon=lexicon,
            check=tuple(check) if check else None,
            exclude=exclude,
            height_mm=height_mm,
            fidelity=fidelity,
            database=database,
            depth_rule=depth_rule,
            min_depth_mm=min_depth_mm,
            accept_confidence=accept_confidence,
            accept_margin=accept_margin,
        )
        if out is not None:
            check_output(out)
        stamped = load_truth(truth) if truth is not None else None
        wanted = Mode(settings.mode) if settings.mode is not None else None
        sight = wanted in (Mode.VISION, Mode.FUSED, Mode.AUTO)
        parts = discover(inputs, photos=sight and wanted is not Mode.FUSED, beside=sight)
        readers = Readers(settings)
        expected = load_expected(verify, readers.grammar) if verify is not None else None
        senses = Senses(readers, mode=wanted, expected=expected)
        senses.prepare(parts)
        with _progress(len(parts)) as advance:
            rows = read_parts(parts, senses, grammar=readers.grammar, on_row=advance)
        print_table(rows)
        if out is not None:
            write_rows(rows, out)
            print(f"wrote {out}")
        if stamped is not None:
            print(score(rows, stamped).describe())
        if expected is not None and (missing := expected.not_among(row.part for row in rows)):
            print(f"{len(missing)} of the table of {verify} not read: {', '.join(missing[:5])}")
    if expected is not None:
        return 0 if all(row.verdict == "confirmed" for row in rows) else 1
    return 1 if any(row.error for row in rows) else 0


class _Progress:
    """A bar on the terminal; called with every row."""

    def __init__(self, total: int) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

        columns = (TextColumn("reading"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
        self._bar = Progress(*columns, console=Console(stderr=True), transient=True)
        self._task = self._bar.add_task("reading", total=total)

    def __enter__(self) -> _Progress:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

    def __call__(self, _: Row) -> None:
        self._bar.advance(self._task)


def _progress(total: int) -> AbstractContextManager[Any]:
    return _Progress(total) if total > 1 and sys.stderr.isatty() else nullcontext()
