"""Options of a run other than the settings of reading and the executor."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from glyphs.errors import FileError
from pipeline.common.output_paths import check_writable
from pipeline.common.settings import SettingsError
from pipeline.runs.outputs import STORE_SCHEMES, has_rows, unfinished
from pipeline.runs.tables import SUFFIXES


@dataclass(frozen=True)
class RunOptions:
    """More inputs, checks, and outputs.

    Attributes:
        manifest: Table (.csv, .xlsx) of parts, with the columns part, height_map, scan, photo, expected, format,
            font; any of them may be missing; may be repeated. File names are relative to the table.
        recurse: Search the subfolders of folders, too. Their parts have the subfolder in their names.
        verify: Text that the parts should read, or a table with the columns part and text. Each part is confirmed,
            refuted or undecided.
        order: Production order: a file of serials one per line, or ranges such as KX400000..KX409999. A part that is
            read with certainty and is not in it goes to review.
        repeats: Accept parts with the same serial. Default: if several parts of a run are read with the same serial,
            all of them go to review.
        truth: Table with the columns part and text, to print the accuracy and the wrong parts.
        out: Table to write (.csv, .xlsx, .jsonl or .parquet), or the store of a service (sqlite:///FILE, postgresql://...).
            Parts that cannot be read are listed in the manifest NAME.quarantine.csv.
        force: Replace the finished table of an earlier run, which is kept as NAME~.
        evidence: The service's folder of evidence; with a store, pictures of the parts to review are put there.
        learn_die: Learn the shapes of the lot's own die from the parts that were read with certainty, read the others
            again with them, and write them beside the table, as NAME.die.glyphs. Default: for a dozen or more height
            maps and scans, if no font and no database is named; not with a store.
        summary: JSON file for the counts, reasons, rate and slowest parts that are printed.
    """

    manifest: tuple[str, ...] = ()
    recurse: bool = True
    verify: str | None = None
    order: Path | None = None
    repeats: bool = False
    truth: Path | None = None
    out: str | None = None
    force: bool = False
    evidence: Path | None = None
    learn_die: bool | None = None
    summary: Path | None = None

    @property
    def store(self) -> str | None:
        return self.out if self.out is not None and self.out.startswith(STORE_SCHEMES) else None

    def check(self) -> None:
        """Check, before work starts, that the outputs can be written. Raises FileError, SettingsError: they cannot."""
        if self.evidence is not None and self.store is None:
            raise SettingsError("--evidence goes with a store", hint="such as --out sqlite:///parts.db")
        if self.out is not None and self.store is None:
            table = Path(self.out)
            check_writable(table, SUFFIXES)
            if has_rows(table) and not (self.force or unfinished(table).exists()):
                raise FileError(
                    table, "is a finished table", "name another table, or replace it with --force"
                )
        if self.summary is not None:
            check_writable(self.summary)
