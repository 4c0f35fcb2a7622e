"""Completion as a shell does it."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from pipeline.cli.main import main

ASK = r"""
source completion
shopt -s extglob
complete -p tactile-marks
for line in "$@"; do
    read -ra COMP_WORDS <<< "$line"
    [[ $line == *' ' ]] && COMP_WORDS+=("")
    COMP_CWORD=$((${#COMP_WORDS[@]} - 1)) COMP_LINE=$line COMP_POINT=${#line} COMPREPLY=()
    _tactile_marks
    echo "${COMPREPLY[*]}"
done
"""


def completed(folder: Path, script: str, *lines: str) -> list[str]:
    """What bash offers at the end of every line, after the way in which the command is registered."""
    bash = shutil.which("bash")
    if bash is None:
        pytest.skip("bash is not installed")
    (folder / "completion").write_text(script, encoding="utf-8")
    done = subprocess.run(
        [bash, "--norc", "-c", ASK, "bash", *lines], cwd=folder, capture_output=True, text=True, check=True
    )
    assert done.stderr == ""
    return done.stdout.splitlines()


def test_bash_completes_commands_options_choices_and_files(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["completion", "bash"]) == 0
    (tmp_path / "truth.csv").touch()
    lines = {
        "tactile-marks rea": "read",
        "tactile-marks glyphs ": "list show build",
        "tactile-marks read --height-m": "--height-mm",
        "tactile-marks read --mode f": "fused",
        "tactile-marks read part.npz --fidelity ": "pointwise contact",
        "tactile-marks read --truth tr": "truth.csv",
        "tactile-marks benchmark run --desi": "--design",
        "tactile-marks completion z": "zsh",
    }
    registered, *words = completed(tmp_path, capsys.readouterr().out, *lines)
    assert dict(zip(lines, words, strict=True)) == lines
    assert "-o default" in registered  # what the script has no answer to is completed as a file: parts, fonts


def test_zsh_and_fish_have_every_command_and_option(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["completion", "zsh"]) == 0
    zsh = capsys.readouterr().out
    assert main(["completion", "fish"]) == 0
    fish = capsys.readouterr().out
    for name in ("read", "benchmark", "glyphs", "enroll", "worker", "completion"):
        assert f"'{name}:" in zsh
        assert f"-a '{name}'" in fish
    assert "--height-mm[" in zsh
    assert "-l height-mm" in fish
    assert "\n_cyclopts_tactile-marks() {" in zsh  # what the last line but one calls
    assert zsh.rstrip().splitlines()[-1] == "compdef _tactile-marks_or_file tactile-marks"


def test_an_unknown_shell_is_told_in_a_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["completion", "ksh"]) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert "fish" in told
