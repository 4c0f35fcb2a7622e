"""From labelled parts to a certificate, and to a warning where other parts are read with it."""

from __future__ import annotations

import contextlib
import json
import re
import shutil
import signal
import sqlite3
from pathlib import Path

import pytest

from tests.contract.front_doors import main, start_process
from tests.support.run_tables import csv_rows
from tests.support.waiting import PATIENCE_S, wait_until

pytestmark = pytest.mark.usefixtures("empty_folder")

PARTS = 20
"""The fewest that are compared; 11 without a wrong one show a risk of 0.2 at 90 %."""
MADE_SO = ["--format", "A9", "--height-mm", "4", "--no-photo"]
AS_GIVEN = "--orientation upright --rows top-first"
READ_SO = ["--font", "gothic", *MADE_SO[:4], "--experts", "network", *AS_GIVEN.split(), "--jobs", "1"]
"""How a part is soonest accepted: how well it is read is not the question here. One mark alone takes thrice as long."""


@pytest.fixture(scope="module")
def workshop(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("certify") / "workshop"
    soiled = f"--seed 1 --soil workshop --dirt 0.2 --parts {PARTS}".split()
    assert main(["synth", str(folder), *soiled, *MADE_SO]) == 0
    return folder


@pytest.fixture(scope="module")
def certificate(workshop: Path) -> Path:
    path = workshop.parent / "certificate.json"
    risk = ("--risk", "0.2", "--confidence", "0.9", "--out", str(path))
    assert main(["certify", str(workshop), "--truth", str(workshop / "truth.csv"), *risk, *READ_SO]) == 0
    return path


def test_a_certificate_says_what_the_parts_show(certificate: Path) -> None:
    made = json.loads(certificate.read_text(encoding="utf-8"))
    assert (made["risk"], made["confidence"], made["parts"]) == (0.2, 0.9, PARTS)
    assert made["accepted"] >= 11
    assert made["bound"] <= 0.2
    assert made["sources"] == ["tactile"]
    assert made["threshold"] >= 0.9  # what the reader accepts by itself
    asked = {"font": ["gothic"], "format": ["A9"], "height_mm": 4.0, "experts": ["network"]}
    assert made["settings"] == {**asked, "orientation": "upright", "rows": "top-first"}
    page = certificate.with_suffix(".html").read_text(encoding="utf-8")
    assert made["data_sha256"] in page
    assert "fine roughness" in page


def test_other_parts_are_read_with_a_warning_and_the_same_parts_without(
    workshop: Path, certificate: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    # one clean part in many files: clean ones are read soonest
    assert main(["synth", "clean", "--seed", "2", "--dirt", "0", "--parts", "1", *MADE_SO]) == 0
    for number in range(1, PARTS):
        shutil.copy("clean/part-000.npz", f"clean/part-{number:03d}.npz")
    vouched = ("--certificate", str(certificate), *READ_SO)
    assert main(["read", "clean", *vouched, "--out", "clean.csv", "--summary", "clean.json"]) == 0
    warning = capsys.readouterr().err
    assert "unlike the certified ones" in warning
    assert "roughness" in warning
    assert "roughness" in json.loads(Path("clean.json").read_text(encoding="utf-8"))["drift"]
    assert main(["read", str(workshop), *vouched, "--repeats", "--out", "again.csv"]) == 0
    assert "unlike" not in capsys.readouterr().err
    rows = csv_rows("again.csv")
    made = json.loads(certificate.read_text(encoding="utf-8"))
    # exactly the parts that the certificate counts are accepted again
    assert sum(row["decision"] == "accept" for row in rows) == made["accepted"]
    assert all(float(row["confidence"]) >= made["threshold"] for row in rows if row["decision"] == "accept")


def test_an_interrupted_certification_goes_on(workshop: Path, capsys: pytest.CaptureFixture[str]) -> None:
    few = [str(workshop / f"part-0{k:02d}.npz") for k in range(6)]
    given = ["certify", *few, "--truth", str(workshop / "truth.csv"), *READ_SO]
    unfinished = Path("certificate.json.unfinished")
    running = start_process(*given)
    wait_until(lambda: parts_kept(unfinished) >= 1, running)
    running.send_signal(signal.SIGINT)
    _, error = running.communicate(timeout=PATIENCE_S)
    assert running.returncode == 130
    assert "start the same command again" in error
    assert main(["5" if a == "4" else a for a in given]) == 1
    assert "holds another certification" in capsys.readouterr().err
    assert main(given) == 1  # six parts are too few for a risk of 0.001
    shown = capsys.readouterr().out
    (done,) = re.findall(r"continuing a broken-off certification: (\d+) parts", shown)
    assert 1 <= int(done) < len(few)
    assert "6 labelled parts" in shown
    said = " ".join(shown.split())
    assert "not certified: a risk of 1 in 1,000 at 95% confidence takes 2,995 accepted parts" in said
    assert "more parts like these are missing" in said
    assert not unfinished.exists()
    assert not Path("certificate.json").exists()


def parts_kept(journal: Path) -> int:
    """Parts in the journal of a command that runs; it has its file to itself, so a copy is looked at."""
    copy = Path("copy.db")
    try:
        for ending in ("", "-wal"):
            shutil.copy(f"{journal}{ending}", f"{copy}{ending}")
        with contextlib.closing(sqlite3.connect(copy)) as database:
            return int(database.execute("select count(*) from parts").fetchone()[0])
    except (OSError, sqlite3.Error):
        return 0
    finally:
        for path in Path().glob("copy.db*"):
            path.unlink()


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("--risk", "0"), "risk is 0"),
        (("--confidence", "1.5"), "confidence is 1.5"),
        (("--out", "c.toml"), "ends in .json"),
        (("--certificate", "CERTIFICATE"), "a certificate is set"),
        (("--truth", "nowhere.csv"), "nowhere.csv"),
    ],
)
def test_bad_usage_is_one_line(
    arguments: tuple[str, str],
    says: str,
    workshop: Path,
    certificate: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    changed = tuple(str(certificate) if a == "CERTIFICATE" else a for a in arguments)
    truth = () if "--truth" in arguments else ("--truth", str(workshop / "truth.csv"))
    assert main(["certify", str(workshop), *truth, *changed, *READ_SO]) in (1, 2)
    error = capsys.readouterr().err
    assert says in error
    assert error.count("\n") == 1


def test_a_benchmark_accepts_what_it_vouches_for(certificate: Path) -> None:
    made_so = ("--dirt", "0", "--parts", "1", *MADE_SO[:4])
    read_so = ("--mode", "tactile,vision", "--give", "font,height,format", "--certificate", str(certificate))
    assert main(["benchmark", "run", "--out", "b", *made_so, *read_so]) == 0
    decisions = {row["mode"]: (row["decision"], row["flags"]) for row in csv_rows("b/benchmark.csv")}
    assert decisions["tactile"][0] == "accept"
    assert decisions["vision"][0] == "review"
    assert "the certificate does not cover this sense (vision)" in decisions["vision"][1]
    assert 'id="certificate"' in Path("b/report.html").read_text(encoding="utf-8")
