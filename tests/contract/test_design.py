"""`design` as an engineer uses it, `scan` with what it wrote, and a whisker that `identify` has found."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.contract.front_doors import ROOT, Command, main
from whisker_array import load_scan, moment_ratio

ASKED = ["design", "--height-mm", "5", "--alpha", "30:60", "--mu", "0.1:0.5", "--depth-mm", "0.2"]
ARRAY = ["design", "--height-mm", "5", "--array"]


def test_what_is_designed_is_written_drawn_and_scanned_with(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, picture = tmp_path / "w.toml", tmp_path / "w.png"
    assert main([*ASKED, "--no-trade-offs", "--out", str(out), "--picture", str(picture)]) == 0
    told = capsys.readouterr().out
    for word in ("build", "worst edge contrast", "binds", "linear beam", "first frequency"):
        assert word in told
    assert picture.stat().st_size > 20_000
    part, scan = tmp_path / "plate.npz", tmp_path / "plate.h5"
    z = np.zeros((120, 160), dtype=np.float32)
    z[40:80, 70:90] = -0.2
    np.savez(part, z_mm=z, pitch_mm=0.1)
    assert (
        main(["scan", str(part), "--out", str(scan), "--whisker", str(out), "--profilers", "--two-way"]) == 0
    )
    scanned = load_scan(scan)
    assert len(scanned.touches) == 2
    assert any(sweep.plan.pushed for sweep in scanned.sweeps)
    # the two ends of the range, as eq. (16) has them: clearly edges, and no jam
    ratio = moment_ratio(np.tan(np.radians([-60.0, -30.0, 30.0, 60.0])), 0.1, scanned.touch.tip)
    assert np.isfinite(ratio).all()
    assert (np.abs(ratio - 1.0) > 0.1).all()


def test_one_inclination_is_singled_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    picture = tmp_path / "tuned.pdf"
    assert main([*ASKED, "--sensitive-to", "45", "--picture", str(picture)]) == 0
    told = capsys.readouterr().out
    assert "null at 45 deg" in told
    assert "F, mu = 0.29" in told
    assert "-0.00" not in told
    assert picture.read_bytes().startswith(b"%PDF")


def test_a_level_whisker_can_be_asked_for(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*ASKED, "--beta-deg", "0", "--no-trade-offs"]) == 0
    told = capsys.readouterr().out
    assert "beta 0.00 deg" in told
    assert "scan speed, mm/s" not in told


def test_an_array_is_told_and_drawn(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    picture = tmp_path / "array.png"
    assert main([*ARRAY, "--accuracy", "0.5", "--whiskers", "8", "--picture", str(picture)]) == 0
    told = capsys.readouterr().out
    assert "Quickest: 8 whiskers" in told
    assert max(map(len, told.splitlines()[:-1])) <= 80
    assert picture.stat().st_size > 10_000


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ("--alpha=60:30", "--alpha is '60:30'"),
        ("--alpha=steep", "--alpha is 'steep'"),
        ("--alpha=30:45:60", "write least:greatest"),
        ("--alpha=30:90", "below 90"),
        ("--mu=0.1:nan", "--mu"),
        ("--mu=0.5:0.1", "--mu"),
        ("--mu=-0.1:0.5", "friction"),
        ("--depth-mm=0", "depth_mm"),
        ("--height-mm=-5", "character_height_mm"),
        ("--height-mm=nan", "height"),
        ("--beta-deg=-10:45", "--beta-deg"),
        ("--section=round", "take a ribbon"),
        ("--sensitive-to=3", "cannot be singled out"),
    ],
)
def test_a_request_that_makes_no_sense_is_one_line(
    change: str, says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    name = change.partition("=")[0]
    given = [*ASKED]
    if name in given:
        del given[given.index(name) : given.index(name) + 2]
    assert main([*given, change]) == 2
    said = capsys.readouterr().err
    assert said.startswith("tactile-marks: ")
    assert says in said
    assert said.count("\n") == 1


@pytest.mark.parametrize("whiskers", ["", "eight", "0,8", "1000"])
def test_whiskers_of_an_array_are_numbers(whiskers: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*ARRAY, f"--whiskers={whiskers}"]) == 2
    assert "--whiskers is" in capsys.readouterr().err


def test_an_array_or_walls_must_be_given(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(ASKED[:3]) == 2
    assert "--alpha, --mu and --depth-mm" in capsys.readouterr().err


@pytest.mark.parametrize("wrong", ["--out=w.json", "--picture=p.toml", "--out=none/w.toml"])
def test_files_are_refused_before_the_search(wrong: str) -> None:
    assert main([*ASKED, wrong]) == 1


def test_a_drawn_whisker_is_compared_with_the_limits(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    drawn = tmp_path / "drawn.toml"
    drawn.write_text(
        'kind = "L"\nl1_mm = 30.0\nl2_mm = 2.5\nl3_mm = 2.5\nbeta_deg = 0.0\npreload_mm = 0.6\ntip_radius_mm = 0.05\n'
        'friction = 0.2\ncharacter_height_mm = 5.0\nmaterial = "music wire"\n'
        '[section]\nkind = "ribbon"\nthickness_mm = 0.2\nwidth_mm = 1.0\n'
    )
    assert main([*ASKED, "--whisker", str(drawn)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert any(line.startswith("worst edge contrast") for line in lines)
    assert "+-" not in "".join(lines)  # nothing is known of its uncertainty
    (axis,) = (line for line in lines if line.startswith("sensor axis") and ">=" in line)
    assert axis.endswith("broken")


FOUND = ROOT / "tests" / "data" / "whiskers" / "identified.toml"
JOB = ("design", "--height-mm", "5", "--alpha", "20:45", "--mu", "0.1:0.3", "--depth-mm", "0.3")


@pytest.fixture
def a_piece(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("piece.toml").write_text('kind = "pits"\nangle_deg = [45]\nfloor_mm = 0.6\nland_mm = 1.2\n')


@pytest.mark.usefixtures("a_piece")
def test_what_is_known_of_a_whisker_is_shown_by_scan_and_design(command: Command) -> None:
    scanned = command("scan", "piece.toml", "--out", "again.h5", "--whisker", FOUND)
    assert scanned.status == 0
    promised = scanned.out.splitlines()
    assert promised[-5].startswith("moment of the land, N mm")
    assert "+-" in promised[-1]
    designed = command(*JOB, "--whisker", FOUND)
    assert designed.status == 0
    lines = designed.out.splitlines()
    assert lines[:6] == promised[-6:]
    assert lines[6].startswith("worst edge contrast")


@pytest.mark.usefixtures("a_piece")
def test_design_judges_a_whisker_that_was_not_identified(command: Command) -> None:
    Path("drawn.toml").write_text(FOUND.read_text().partition("[identified]")[0])
    judged = command(*JOB, "--whisker", "drawn.toml")
    assert judged.status == 0
    assert "worst edge contrast" in judged.out


@pytest.mark.usefixtures("a_piece")
def test_what_identify_and_design_refuse(command: Command) -> None:
    refused = command(*JOB, "--whisker", FOUND, "--out", "other.toml")
    assert refused.status == 2
    assert "leave out --out" in refused.err
    refused = command("identify", "piece.h5", "--piece", "piece.toml", "--out", "found.toml")
    assert refused.status == 2
    assert "add --whisker" in refused.err
    refused = command("identify", "piece.toml", "--piece", "piece.toml")
    assert refused.status == 1
    assert "piece.toml" in refused.err
