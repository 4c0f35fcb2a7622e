"""What is printed: harmless names, closed or full streams, words that help; pipes are no files."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from glyphs import load_font
from pipeline import GlyphDatabase, ReadSettings, save_database
from tests.contract.front_doors import ROOT, Command, environment
from tests.support.waiting import PATIENCE_S

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


FILES = ("config", "database", "lexicon", "job", "truth", "order", "certificate")


def _waits(*_: object) -> None:
    raise TimeoutError("it waits for the pipe")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes have names here")
@pytest.mark.parametrize(
    "arguments",
    [
        *(
            ("read", "PLATE", f"--{name}", "PIPE")
            for name in ("config", "database", "lexicon", "job", "truth", "order")
        ),
        ("read", "--manifest", "PIPE"),
        ("serve", "--config", "PIPE"),
        ("serve", "--database", "PIPE"),
        ("serve", "--port", "0", "--tls.certificate", "PIPE"),
        ("serve", "--port", "0", "--opcua.certificate", "PIPE"),
        ("serve", "--port", "0", "--stage.device", "PIPE"),
        ("glyphs", "list", "--database", "PIPE"),
    ],
    ids=" ".join,
)
def test_a_pipe_is_no_file(
    command: Command,
    height_map: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: tuple[str, ...],
) -> None:
    monkeypatch.chdir(tmp_path)
    os.mkfifo("pipe")
    given = {"PLATE": str(height_map), "PIPE": "pipe"}
    signal.signal(signal.SIGALRM, _waits)
    signal.alarm(round(PATIENCE_S))
    try:
        ended = command(*(given.get(argument, argument) for argument in arguments))
    finally:
        signal.alarm(0)
    assert ended.status in (1, 2)
    assert "pipe" in ended.err
    assert len(ended.err.splitlines()) == 1


@pytest.mark.skipif(sys.platform != "linux", reason="a file can be limited here alone")
def test_a_backup_that_does_not_fit_is_one_line(command: Command, tmp_path: Path) -> None:
    store = f"sqlite:///{tmp_path}/store.db"
    assert command("tokens", "add", "line", "--scope", "read", "--store", store).status == 0
    # no file may grow beyond 60 kB, as on a disk that is full
    limited = "import resource as r, sys; r.setrlimit(r.RLIMIT_FSIZE, (60_000, 60_000)); "
    ended = subprocess.run(
        [sys.executable, "-c", limited + "from pipeline.cli.main import main; sys.exit(main(sys.argv[1:]))",
         "store", "backup", str(tmp_path / "b"), "--store", store],
        cwd=tmp_path, env=environment(), capture_output=True, text=True, check=False, timeout=60.0,
    )  # fmt: skip
    assert ended.returncode == 1, ended.stderr
    assert len(ended.stderr.splitlines()) == 1
    assert "room" in ended.stderr
    assert not (tmp_path / "b").exists()
    assert command("store", "backup", tmp_path / "b", "--store", store, "--folder", tmp_path).status == 0
