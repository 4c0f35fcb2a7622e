"""The command line as a person meets it."""

from __future__ import annotations

import re
import socket
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.contract.front_doors import main
from tests.support.run_tables import csv_rows

pytestmark = pytest.mark.usefixtures("empty_folder")

ROOT = Path(__file__).parents[2]


def save_map(path: Path, z: np.ndarray, pitch_mm: float = 0.05) -> None:
    np.savez(path, z_mm=z.astype(np.float32), pitch_mm=pitch_mm)


def test_help_needs_nothing_heavy() -> None:
    program = (
        "import sys; from importlib.metadata import entry_points; "
        "(entry,) = entry_points(group='console_scripts', name='tactile-marks'); "
        "status = entry.load()(['--help']); "
        "heavy = {'numpy', 'scipy', 'numba', 'h5py', 'matplotlib', 'pyarrow', 'pydantic'}; "
        "print(status, sorted(heavy & set(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines()[-1] == "0 []"
    for command in ("read", "synth", "scan", "inspect", "demo", "glyphs"):
        assert command in done.stdout


COMMANDS = (
    *(
        "read",
        "inspect",
        "demo",
        "enroll",
        "certify",
        "study",
        "synth",
        "scan",
        "calibrate",
        "identify",
        "import",
    ),
    *("design", "serve", "worker", "completion", "glyphs list", "glyphs show", "glyphs build"),
    *("bench check", "bench home", "bench calibrate", "bench scan"),
    *("tokens add", "tokens list", "tokens revoke", "store backup", "store restore", "store check"),
    *("benchmark run", "benchmark compare", "benchmark export", "benchmark score"),
)


def flags_in(help_text: str) -> set[str]:
    """Flags that a page of help describes, without the names of positional arguments."""
    return {found[1] for line in help_text.splitlines() if (found := re.match(r"│[* ]+(--[a-z-]+)", line))}


@pytest.mark.parametrize("command", COMMANDS)
def test_help_of_a_command_is_one_screen_and_the_rest_is_a_flag_away(
    command: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "100")
    assert main([*command.split(), "--help"]) == 0
    short = capsys.readouterr().out
    assert main([*command.split(), "--help-all"]) == 0
    whole = capsys.readouterr().out
    assert f"Usage: tactile-marks {command}" in short
    assert len(short.splitlines()) <= 50
    few, all_flags = flags_in(short), flags_in(whole)
    assert few <= all_flags
    assert len(few) <= 6
    assert (f": tactile-marks {command} --help-all" in short) == (few < all_flags)


def test_help_of_the_program_leaves_out_commands_that_few_need(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--help"]) == 0
    short = capsys.readouterr().out
    assert main(["--help-all"]) == 0
    whole = capsys.readouterr().out
    assert "6 more commands: tactile-marks --help-all" in short
    for command in {name.split()[0] for name in COMMANDS}:
        assert f"│ {command} " in whole
        assert (f"│ {command} " in short) == (command not in LEFT_OUT)


LEFT_OUT = ("calibrate", "identify", "import", "study", "worker", "completion")


@pytest.mark.parametrize(
    ("status", "arguments", "message"),
    [
        # bad usage
        (2, ["raed"], "raed"),
        (2, ["read"], "name a height map"),
        (2, ["read", "a.npz", "--hight-mm", "5"], "--hight-mm"),
        (2, ["read", "a.npz", "--height-mm", "tall"], "tall"),
        (2, ["read", "a.npz", "--height-mm", "-5"], "--height-mm"),
        (2, ["read", "a.npz", "--mode", "smell"], "smell"),
        (2, ["read", "a.npz", "--sensors", "exact"], "exact"),
        (2, ["read", "a.npz", "--font", "comic"], "comic"),
        (2, ["read", "a.npz", "--config", "none.toml"], "none.toml"),
        (2, ["read", "a.npz", "--database", "none.db"], "none.db"),
        (2, ["synth", "out", "--parts", "2"], "--format"),
        (2, ["synth", "out", "--parts", "0", "--format", "9"], "number of parts"),
        (2, ["synth", "out", "--parts", "1", "--format", "9", "--font", "comic"], "comic"),
        (2, ["scan", "a.npz", "--out", "a.tdms"], ".h5"),
        (2, ["scan", "a.npz", "--out", "a.h5", "--height-mm", "-1"], "--height-mm"),
        (2, ["glyphs", "build", "f.db"], "font"),
        # files that fail
        (1, ["read", "empty"], "no height map"),
        (1, ["read", "a.npz", "--out", "t.ods"], "t.ods"),
        (1, ["read", "a.npz", "--out", "none/t.csv"], "none/t.csv"),
        (1, ["read", "a.npz", "--truth", "none.csv"], "none.csv"),
        (1, ["scan", "none.npz", "--out", "a.h5", "--height-mm", "3"], "none.npz"),
        (1, ["scan", "a.npz", "--out", "none/a.h5"], "none/a.h5"),
        (1, ["calibrate", "none.h5"], "none.h5"),
        (1, ["inspect", "none.npz"], "none.npz"),
        (1, ["inspect", "a.npz", "--out", "a.jpg"], "a.jpg"),
        (1, ["glyphs", "show", "gothic", "--out", "a.jpg"], "a.jpg"),
        (1, ["demo", "--out", "a.npz/deeper"], "a.npz/deeper"),
    ],
)
def test_what_cannot_be_done_is_one_line_and_a_status(
    status: int, arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("empty").mkdir()
    save_map(Path("a.npz"), np.zeros((9, 9)))
    assert main(arguments) == status
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert error.startswith("tactile-marks: ")


def test_bad_files_are_rows_and_the_rest_is_read(capsys: pytest.CaptureFixture[str]) -> None:
    Path("parts").mkdir()
    rng = np.random.default_rng(0)
    save_map(Path("parts/bare.npz"), rng.normal(0.0, 0.0005, (100, 160)))
    save_map(Path("parts/dropouts.npz"), np.full((20, 30), np.nan))
    save_map(Path("parts/pitch.npz"), np.zeros((20, 30)), 0.0)
    Path("parts/rubbish.npz").write_bytes(b"rubbish")
    Path("parts/scan.h5").write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(500))
    known = ("--font", "gothic", "--format", "A9", "--height-mm", "4", "--orientation", "upright")
    assert main(["read", "parts", "parts/none.npz", *known, "--out", "t.csv"]) == 1
    shown = capsys.readouterr()
    assert "Traceback" not in shown.out + shown.err
    assert "6 parts, 1 reject, 5 with an error" in shown.out
    rows = {row["part"]: row for row in csv_rows("t.csv")}
    assert rows["bare"]["decision"] == "reject"
    assert rows["bare"]["text"] == ""
    assert "no characters" in rows["bare"]["flags"]
    for name, file in (
        ("dropouts", "parts/dropouts.npz"),
        ("pitch", "parts/pitch.npz"),
        ("rubbish", "parts/rubbish.npz"),
        ("scan", "parts/scan.h5"),
        ("none", "parts/none.npz"),
    ):
        assert rows[name]["error"].startswith(f"{file}: ")


def test_fonts_are_listed_shown_and_kept(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["glyphs", "list"]) == 0
    listed = capsys.readouterr().out
    assert listed.splitlines()[0].startswith("gothic")
    assert main(["glyphs", "build", "fonts.db", "gothic", "futural"]) == 0
    assert main(["glyphs", "list", "--database", "fonts.db"]) == 0
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()[1:3]] == ["gothic", "futural"]
    assert main(["glyphs", "show", "gothic", "--out", "sheet.png"]) == 0
    assert Path("sheet.png").read_bytes().startswith(b"\x89PNG")


def test_output_that_is_no_text_is_shown_all_the_same(tmp_path: Path) -> None:
    (tmp_path / "part-\udcff.npz").write_bytes(b"rubbish")
    shown = subprocess.run(
        [sys.executable, "-m", "pipeline", "read", ".", "--out", "rows.csv"],
        cwd=tmp_path, capture_output=True, check=False, env={"PYTHONPATH": str(ROOT), "PATH": ""},
    )  # fmt: skip
    assert shown.returncode == 1
    assert b"Traceback" not in shown.stderr
    assert b"part-\\udcff" in shown.stdout
    row = (tmp_path / "rows.csv").read_bytes().splitlines()[1]
    assert row.startswith(b'"part-?",')
    assert b',"part-\\u005cudcff.npz: is damaged' in row


def test_stay_goes_with_service(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["demo", "--stay"]) == 2
    assert "--service" in capsys.readouterr().err


def test_an_address_in_use_is_told_in_a_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = str(taken.getsockname()[1])
        assert main(["serve", "--folder", str(tmp_path), "--port", port]) == 2
        assert "name another --port" in capsys.readouterr().err


def test_beyond_this_machine_a_token_must_be_made_first(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["serve", "--folder", str(tmp_path), "--port", "0.0.0.0:0"]) == 2
    assert "tactile-marks tokens add" in capsys.readouterr().err


def test_mode_is_no_setting_of_a_service(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    config = tmp_path / "t.toml"
    config.write_text('mode = "fused"\n[service]\nport = 0\n')
    assert main(["serve", "--folder", str(tmp_path), "--config", str(config)]) == 2
    assert "mode" in capsys.readouterr().err
