"""Rows as `.csv`, `.jsonl` or `.parquet`; what is not known is an empty field or null."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, fields
from pathlib import Path

from pipeline.atomic import check_writable, replacing
from pipeline.batch import Row
from pipeline.problems import FileProblem


def check_output(path: Path) -> None:
    """Refuse, before the work starts, a file that could not be written at its end.

    Raises:
        FileProblem: unknown suffix, or a place that cannot be written.
    """
    if path.suffix.lower() not in _WRITERS:
        raise FileProblem(path, "is no table that can be written", f"end it in {', '.join(_WRITERS)}")
    check_writable(path)


def write_rows(rows: Sequence[Row], path: Path) -> None:
    """Write the rows; the file appears whole or not at all.

    Raises:
        FileProblem: unknown suffix, or it cannot be written.
    """
    check_output(path)
    with replacing(path) as temporary:
        _WRITERS[path.suffix.lower()](rows, temporary)


def _write_csv(rows: Sequence[Row], path: Path) -> None:
    import csv

    with path.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.DictWriter(stream, [f.name for f in fields(Row)])
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)


def _write_jsonl(rows: Sequence[Row], path: Path) -> None:
    import json

    with path.open("w", encoding="utf-8") as stream:
        stream.writelines(json.dumps(asdict(row), ensure_ascii=False) + "\n" for row in rows)


def _write_parquet(rows: Sequence[Row], path: Path) -> None:
    import pyarrow
    import pyarrow.parquet

    kinds = {
        "str": pyarrow.string(),
        "float": pyarrow.float64(),
        "float | None": pyarrow.float64(),
        "bool": pyarrow.bool_(),
    }
    schema = pyarrow.schema([(f.name, kinds[str(f.type)]) for f in fields(Row)])
    table = pyarrow.Table.from_pylist([asdict(row) for row in rows], schema=schema)
    pyarrow.parquet.write_table(table, path)


_WRITERS: dict[str, Callable[[Sequence[Row], Path], None]] = {
    ".csv": _write_csv,
    ".jsonl": _write_jsonl,
    ".parquet": _write_parquet,
}
