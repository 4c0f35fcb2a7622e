"""What was read, as a workbook for Excel and as a table for programs."""

from __future__ import annotations

import json
from datetime import datetime
from pathlib import Path
from typing import Any

import openpyxl
import pytest

from tests.contract.front_doors import Command, save_height_map
from tests.support.run_tables import csv_rows

AS_GIVEN = ("--orientation", "upright", "--rows", "top-first")
READ = ("--format", "9999", "--font", "gothic", "--height-mm", "4", "--jobs", "1", *AS_GIVEN)


@pytest.fixture(scope="module")
def lot(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A part that bears 1997, and one that cannot be read and whose name would be a formula."""
    folder = tmp_path_factory.mktemp("lot")
    save_height_map(folder / "A-1.npz", "1997")
    (folder / "=1+1.npz").write_bytes(b"no archive")
    return folder


def lines(sheet: Any) -> list[dict[str, Any]]:
    """The lines of a sheet by their headings."""
    head, *rows = sheet.iter_rows()
    return [dict(zip([cell.value for cell in head], row, strict=True)) for row in rows]


def test_a_workbook_opens_on_what_a_person_wants(lot: Path, tmp_path: Path, command: Command) -> None:
    out, summary = tmp_path / "lot.xlsx", tmp_path / "lot.json"
    done = command("read", lot, *READ, "--out", out, "--summary", summary)
    assert done.status == 1
    assert f"wrote {out}" in done.out
    assert {path.name for path in tmp_path.iterdir()} == {"lot.xlsx", "lot.json", "lot.quarantine.csv"}
    book = openpyxl.load_workbook(out)
    assert book.sheetnames == ["Parts", "All columns", "Characters", "Run"]

    bad, good = lines(book["Parts"])
    assert list(good) == [
        "Part", "Serial", "Right serial", "Decision", "Confidence", "Expected", "Verdict", "Depth mm", "Why",
    ]  # fmt: skip
    assert 0.05 < good["Depth mm"].value < 0.5
    # text, which Excel takes neither for a number nor for a formula
    assert (good["Serial"].value, good["Serial"].data_type, good["Serial"].number_format) == (
        "1997",
        "s",
        "@",
    )
    assert (bad["Part"].value, bad["Part"].data_type) == ("=1+1", "s")
    assert good["Decision"].value == "accept"
    assert 0.98 <= good["Confidence"].value <= 1.0
    assert not good["Why"].value
    assert "is damaged" in bad["Why"].value
    assert bad["Confidence"].value is None
    assert (book["Parts"].freeze_panes, book["Parts"].auto_filter.ref) == ("A2", "A1:I3")

    whole = lines(book["All columns"])[1]
    assert whole["text"].value == "1997"
    assert isinstance(whole["height_mm"].value, float)
    places = [line for line in lines(book["Characters"]) if line["Part"].value == "A-1"]
    assert [line["Read"].value for line in places] == list("1997")
    assert all(line["Probability"].value > line["Probability 2"].value for line in places)

    run = {line["What"].value: line["Value"].value for line in lines(book["Run"])}
    first, last = run["first part read"], run["last part read"]
    assert (
        datetime.fromisoformat(first)
        <= datetime.fromisoformat(last)
        <= datetime.fromisoformat(run["written"])
    )
    assert run["setting format"] == "9999"
    assert run["program"]
    told = json.loads(summary.read_text())
    assert (told["program"], told["settings"]["format"]) == (run["program"], ["9999"])


def test_a_table_says_when_by_what_and_how_it_was_read(lot: Path, tmp_path: Path, command: Command) -> None:
    out = tmp_path / "lot.csv"
    command("read", lot, *READ, "--out", out)
    bad, good = csv_rows(out)
    assert good["text"] == "1997"
    assert datetime.fromisoformat(good["at"]).tzinfo is not None
    assert datetime.fromisoformat(bad["at"]).tzinfo is not None
    assert good["program"] == bad["program"] != ""
    assert len(good["settings"]) == 16


def test_the_right_serial_that_a_person_fills_in_is_the_truth(
    lot: Path, tmp_path: Path, command: Command
) -> None:
    out = tmp_path / "lot.xlsx"
    flags = ("--line", "lot=AAA99", "--verify", "1997")
    command("read", lot / "A-1.npz", *READ, *flags, "--out", out)
    book = openpyxl.load_workbook(out)
    (row,) = lines(book["Parts"])
    assert (row["Expected"].value, row["Verdict"].value, row["lot"].value) == ("1997", "confirmed", None)
    unchecked = command("read", lot / "A-1.npz", *READ, "--truth", out)
    assert unchecked.status == 1
    assert "lot.xlsx: holds no part" in unchecked.err
    row["Right serial"].value = "1998"
    book.save(out)
    done = command("read", lot / "A-1.npz", *READ, "--truth", out)
    assert "wrong: A-1 (1998 read as 1997)" in done.out
    assert "accepted and wrong: 1 of 1: A-1" in done.out


@pytest.mark.parametrize("name", ["lot.xlsx", "lot.csv"])
def test_a_finished_table_is_replaced_by_force_alone(
    name: str, lot: Path, tmp_path: Path, command: Command
) -> None:
    out = tmp_path / name
    out.write_bytes(b"mine" * 1000)
    done = command("read", lot / "=1+1.npz", *READ, "--out", out)
    assert (done.status, out.read_bytes()) == (1, b"mine" * 1000)
    assert f"{name}: is a finished table; name another table, or replace it with --force" in done.err
    done = command("read", lot / "=1+1.npz", *READ, "--out", out, "--force")
    assert "it is kept as" in done.out
    assert (tmp_path / f"{name}~").read_bytes() == b"mine" * 1000
