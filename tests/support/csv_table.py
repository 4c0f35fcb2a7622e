"""Tables that the program has written."""

from __future__ import annotations

import csv
from pathlib import Path


def csv_rows(path: Path | str) -> list[dict[str, str]]:
    """The rows of a CSV table, by column."""
    with Path(path).open(newline="", encoding="utf-8-sig") as stream:
        return list(csv.DictReader(stream))
