"""What is printed: harmless names, streams that are closed, full or read by nobody, and words that help."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from glyphs import load_font
from pipeline import GlyphDatabase, ReadSettings, save_database
from tests.contract.front_doors import ROOT, Command, environment

READ = ("--format", "A9", "--font", "gothic", "--height-mm", "4", "--jobs", "1")


def shell(line: str, folder: Path) -> int:
    """The status of a line of bash; TM is the command."""
    command = f'TM() {{ {sys.executable} -m pipeline "$@"; }}; {line}'
    return subprocess.run(
        ["bash", "-c", command], cwd=folder, env=environment(), timeout=120.0, check=False
    ).returncode


def test_control_characters_of_a_name_reach_no_terminal(tmp_path: Path, command: Command) -> None:
    name = "esc\x1b[31mRED\nwrote everything, all accepted\u202e"
    (tmp_path / f"{name}.npz").write_bytes(b"no archive")
    (tmp_path / "b.npz").write_bytes(b"no archive")
    for inputs in ([tmp_path], sorted(tmp_path.glob("*.npz"))):
        done = command("read", *inputs, *READ, "--out", tmp_path / "rows.jsonl", "--force")
        shown = done.out + done.err
        assert not [char for char in shown if not char.isprintable() and char != "\n"]
        assert not [line for line in shown.splitlines() if line.startswith("wrote everything")]
        assert r"esc\x1b[31mRED\nwrote" in shown
    listed = (tmp_path / "rows.quarantine.csv").read_text(encoding="utf-8")
    assert "\x1b" not in listed


@pytest.mark.skipif(sys.platform == "win32", reason="no such shell")
@pytest.mark.parametrize(
    ("line", "status"),
    [
        ("TM glyphs list 2>&- <&- >&-", 0),
        ("TM read bad.npz | true; exit ${PIPESTATUS[0]}", 141),
        ("TM --help | true; exit ${PIPESTATUS[0]}", 141),
        ("TM glyphs list > /dev/full 2> said; status=$?; grep -q 'No space left' said || exit 9; exit $status", 1),
        ("TM glyphs lst 2> /dev/full", 2),
        ("TM read bad.npz --out rows.csv >&-; grep -q '^\"bad\",' rows.csv", 0),
    ],
)  # fmt: skip
def test_an_output_that_cannot_be_written_is_no_fault_of_the_program(
    line: str, status: int, tmp_path: Path
) -> None:
    (tmp_path / "bad.npz").write_bytes(b"no archive")
    assert shell(line, tmp_path) == status


@pytest.mark.parametrize("text", ["AA9?", "A[0-9]", "A{2}9", "A+", "A|9", "^A9$"])
def test_an_operator_in_a_format_of_places_is_refused(text: str, command: Command) -> None:
    done = command("read", "part.npz", "--format", text)
    assert done.status == 2
    assert "has no meaning in a mask" in done.err
    assert "re:" in done.err


@pytest.mark.parametrize(("word", "meant"), [("touch", "tactile"), ("camera", "vision"), ("both", "fused")])
def test_everyday_words_for_a_mode_are_understood(word: str, meant: str) -> None:
    assert ReadSettings.of(mode=word).mode == meant


def test_the_fonts_of_a_database_are_drawn(
    tmp_path: Path, command: Command, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    save_database(GlyphDatabase(fonts={"futural": load_font("futural")}), tmp_path / "press-7.glyphs")
    done = command("glyphs", "show", "press-7.glyphs")
    assert (done.status, done.out) == (0, "wrote press-7.png\n")
    assert Path("press-7.png").stat().st_size > 5_000
    save_database(GlyphDatabase(), tmp_path / "empty.glyphs")
    done = command("glyphs", "show", "empty.glyphs")
    assert done.status != 0
    assert "holds no font" in done.err


def test_pages_and_workbooks_come_with_the_plain_install() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    plain = {line.partition(">")[0] for line in project["dependencies"]}
    assert {"jinja2", "openpyxl"} <= plain
