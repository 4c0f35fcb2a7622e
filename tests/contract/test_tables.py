"""Tables as people save them: manifests, truths, texts to verify, production orders and answers to score."""

from __future__ import annotations

import codecs
import csv
import io
import re
import shutil
import unicodedata
from collections.abc import Callable
from pathlib import Path
from typing import Literal

import openpyxl
import pytest

from tests.contract.front_doors import Command, Ended

AS_GIVEN = ("--orientation", "upright", "--rows", "top-first")
READ = ("--format", "A9", "--font", "gothic", "--height-mm", "4", "--jobs", "1", *AS_GIVEN)
Composed = Literal["NFC", "NFD"]
FORMS: dict[str, Callable[[str], bytes]] = {
    "comma": lambda text: text.encode(),
    "semicolon": lambda text: text.replace(",", ";").encode(),
    "tab": lambda text: text.replace(",", "\t").encode(),
    "sep line": lambda text: ("sep=;\r\n" + text.replace(",", ";").replace("\n", "\r\n")).encode(),
    "UTF-8 with mark": lambda text: codecs.BOM_UTF8 + text.encode(),
    "UTF-16": lambda text: text.replace(",", "\t").encode("utf-16"),
    "UTF-16 without mark": lambda text: text.replace(",", "\t").encode("utf-16-le"),
    "blank lines": lambda text: ("\n,,\n" + text.replace("\n", "\n\n")).encode(),
    "quotes and blanks": lambda text: text.replace(",", '" , "').replace("\n", '"\n"').join('""').encode(),
}


def saved(folder: Path, name: str, text: str, form: str = "comma") -> Path:
    """A table in one of the forms."""
    path = folder / name
    path.write_bytes(FORMS[form](text))
    return path


def damaged(path: Path) -> Path:
    """A file that is found, and ends its part at once with other words than one that is not there."""
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(b"no archive")
    return path


def found(done: Ended, *parts: str) -> bool:
    """Whether the files of all parts were found: each of them has a line of its own, and is damaged."""
    assert (done.status, done.err) == (1, "")
    assert ("is damaged" in done.out) != ("is not there" in done.out)
    failed = [line.split()[0] for line in done.out.splitlines() if line.split()[1:2] == ["error"]]
    assert set(parts) <= set(failed)
    return "is damaged" in done.out


def test_every_form_of_manifest_is_read(tmp_path: Path, command: Command) -> None:
    damaged(tmp_path / "a.npz")
    manifests = [
        saved(tmp_path, f"lot-{k}.csv", f"part,height_map,expected\nA-{k},a.npz,K7", form)
        for k, form in enumerate(FORMS)
    ]
    assert found(command("read", *manifests, *READ), *(f"A-{k}" for k in range(len(FORMS))))


@pytest.mark.parametrize("form", FORMS)
def test_every_form_of_truth_is_read(form: str, tmp_path: Path, command: Command) -> None:
    truth = saved(tmp_path, "truth.csv", "part,text\nA-1,K7", form)
    scored = command("benchmark", "score", truth, "--truth", truth)
    assert (scored.status, scored.err) == (0, "")
    assert answered(scored) == ["1", "0.0"]


@pytest.mark.parametrize("form", ["semicolon", "UTF-16"])
def test_a_part_of_the_order_is_accepted(
    form: str, tmp_path: Path, height_map: Path, command: Command
) -> None:
    shutil.copy(height_map, tmp_path / "a.npz")
    manifest = saved(tmp_path, "lot.csv", "A-1,a.npz,K7", form)  # without headings
    truth, order = saved(tmp_path, "truth.csv", "A-1,K7", form), tmp_path / "order.csv"
    saved(tmp_path, "order.csv", "pos,serial,qty\n1,K7,1\n2,K8,1", form)
    done = command("read", manifest, *READ, "--truth", truth, "--order", order)
    assert (done.status, done.err) == (0, "")
    assert "accept" in done.out
    assert "confirmed" in done.out
    assert "(1 of 1)" in done.out


def test_a_table_in_the_code_page_of_windows_is_read(tmp_path: Path, command: Command) -> None:
    damaged(tmp_path / "Gehäuse-1.npz")
    (tmp_path / "lot.csv").write_bytes("part;height_map\nA-ö;Gehäuse-1.npz\n".encode("cp1252"))
    assert found(command("read", tmp_path / "lot.csv", *READ), "A-ö")


def test_a_manifest_may_be_a_workbook(tmp_path: Path, command: Command) -> None:
    damaged(tmp_path / "a.npz")
    book = openpyxl.Workbook()
    for row in (("Part", "height_map", "Expected"), ("A-1", "a.npz", "K7")):
        book.active.append(row)
    book.save(tmp_path / "lot.xlsx")
    assert found(command("read", tmp_path / "lot.xlsx", *READ), "A-1")


def test_a_truth_that_is_no_serial_of_the_format_is_told(tmp_path: Path, command: Command) -> None:
    truth = saved(tmp_path, "truth.csv", "part,text\na,KO\nb,K7")
    done = command("read", damaged(tmp_path / "a.npz"), *READ, "--truth", truth)
    assert (
        "truth.csv: a should read 'KO', but it does not fit the format A9; correct the table or --format"
        in done.out
    )


@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
def test_no_file_name_becomes_a_formula(delimiter: str, tmp_path: Path, command: Command) -> None:
    for name in ("x;=1+1", "=1+1", " =1+1", "x;\t-1", "\u00a0@SUM(A1)"):
        damaged(tmp_path / f"{name}.npz")
    command("read", tmp_path, *READ, "--out", tmp_path / "rows.csv")
    for table in ("rows.csv", "rows.quarantine.csv"):
        content = (tmp_path / table).read_bytes()
        assert content.startswith(codecs.BOM_UTF8)  # without it Excel spoils the umlauts
        lines = csv.reader(io.StringIO(content.decode("utf-8-sig"), newline=""), delimiter=delimiter)
        assert [cell for row in lines for cell in row if re.match(r"\s*[=+@-]", cell)] == []


def test_names_of_files_as_other_systems_spell_them(tmp_path: Path, command: Command) -> None:
    damaged(tmp_path / "photos/a.npz")
    spelt = (r".\photos\a.npz", r"photos\a.npz", "PHOTOS/A.NPZ", "Photos\\A.npz")
    rows = "".join(f"A-{k};{name}\n" for k, name in enumerate(spelt))
    manifest = saved(tmp_path, "lot.csv", f"part;height_map\n{rows}")
    assert found(command("read", manifest, *READ), *(f"A-{k}" for k in range(len(spelt))))


@pytest.mark.parametrize(("on_disk", "in_table"), [("NFD", "NFC"), ("NFC", "NFD")])
def test_names_that_are_composed_otherwise(
    on_disk: Composed, in_table: Composed, tmp_path: Path, command: Command
) -> None:
    file = damaged(tmp_path / unicodedata.normalize(on_disk, "Gehäuse-1.npz"))
    told = unicodedata.normalize(in_table, "Gehäuse-1.npz")
    assert found(command("read", saved(tmp_path, "lot.csv", f"height_map\n{told}\n"), *READ))
    truth = saved(tmp_path, "truth.csv", f"part;text\n{told};K7\n")
    done = command("read", file, *READ, "--truth", truth)
    assert "(0 of 1)" in done.out  # the truth was found, the part was not read


@pytest.mark.parametrize(
    ("first", "second", "told"),
    [
        ("Gehäuse 1", "GEHA\u0308USE  1", "names GEHÄUSE 1 a second time, after line 2"),
        ("a", "a\u202eb", "line 3: 'a\\u202eb' has a character that cannot be seen"),
    ],
)
def test_names_of_parts_that_are_the_same_or_cannot_be_seen_are_refused(
    first: str, second: str, told: str, tmp_path: Path, command: Command
) -> None:
    for name in ("a", "b"):
        damaged(tmp_path / f"{name}.npz")
    lot = saved(tmp_path, "lot.csv", f"part,height_map\n{first},a.npz\n{second},b.npz\n")
    done = command("read", lot, *READ)
    assert done.status == 1
    assert told in done.err


def test_several_files_that_a_name_could_mean_are_named(tmp_path: Path, command: Command) -> None:
    damaged(tmp_path / "B.npz")
    damaged(tmp_path / "b.NPZ")
    done = command("read", saved(tmp_path, "lot.csv", "height_map\nb.npz\n"), *READ)
    assert done.status == 1
    assert "B.npz and b.NPZ are" in done.out
    assert found(command("read", saved(tmp_path, "lot.csv", "height_map\nB.npz\n"), *READ))


def test_a_path_with_a_drive_is_told(tmp_path: Path, command: Command) -> None:
    done = command("read", saved(tmp_path, "lot.csv", "height_map\nC:\\lot\\a.npz\n"), *READ)
    assert done.status == 1
    assert r"C:\lot\a.npz" in done.err
    assert "no drive C:" in done.err


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("serial,remark\nK7;1,good\n", "line 2 holds 'K7;1', and ';' stands in no serial"),
        ('K7\n"K8;2"\n', "line 2 holds 'K8;2'"),
        ("1;K7;1\n2;K8;1\n", "which column holds the serials"),
        ("pos;Teil\n1;K7\n", "which column holds the serials"),
        ("K7\nK8=9\n", "'=' stands in no serial"),
    ],
)
def test_an_order_that_can_be_taken_wrongly_is_refused(
    text: str, told: str, tmp_path: Path, command: Command
) -> None:
    order = saved(tmp_path, "order.csv", text)
    done = command("read", damaged(tmp_path / "a.npz"), *READ, "--order", order)
    assert done.status == 1
    assert told in done.err
    assert "serial" in done.err.partition("; ")[2]


def answered(done: Ended) -> list[str]:
    """Number of parts and character error rate, %, as the first table says them."""
    (row,) = re.findall(r"^ (?:mine|truth) +(\d+) +([\d.]+) ", done.out, re.MULTILINE)
    return list(row)


def score(command: Command, tmp_path: Path, answers: str) -> Ended:
    truth = saved(tmp_path, "truth.csv", "part;text\nA-1;K7\nA-2;K8\n")
    return command("benchmark", "score", saved(tmp_path, "mine.csv", answers), "--truth", truth)


def test_answers_as_a_european_spreadsheet_writes_them(tmp_path: Path, command: Command) -> None:
    done = score(command, tmp_path, "sep=;\npart;text;confidence;accepted\nA-1;K7;0,93;yes\nA-2;K9;0,5;no\n")
    assert (done.status, done.err) == (0, "")
    assert answered(done) == ["2", "25.0"]


def test_a_confidence_that_is_no_number_is_told(tmp_path: Path, command: Command) -> None:
    done = score(command, tmp_path, "part;text;confidence\nA-1;K7;0,9,3\n")
    assert done.status == 1
    assert "line 2: the confidence is '0,9,3'" in done.err
