"""Exit statuses and their messages, and completion as a shell does it."""

from __future__ import annotations

import importlib
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from unittest.mock import Mock

import pytest

from glyphs.errors import FileError, MarksError, MissingExtraError
from pipeline.cli.exit_status import FAILED, FAULT, USAGE, CommandError, failures_reported
from pipeline.cli.main import main
from pipeline.common.settings import SettingsError
from pipeline.errors import OwnFileError
from pipeline.formats.find_parts import NothingFoundError
from pipeline.service.client import ServiceError
from pipeline.service.process import NotServingError
from pipeline.service.stage.driver import StageDownError
from pipeline.store.errors import NotFoundError, UnfitError
from pipeline.workers.cluster import ClusterError
from pipeline.workers.executors import WorkerLostError


def test_a_library_of_an_extra_is_told_with_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "uvicorn", None)
    with (
        pytest.raises(CommandError, match=r"needs uvicorn; .*'tactile-marks\[service\]'") as told,
        failures_reported(),
    ):
        importlib.import_module("uvicorn")
    assert told.value.status == USAGE


def test_a_part_that_names_its_own_extra_is_believed() -> None:
    with pytest.raises(CommandError, match=r"MQTT needs paho-mqtt; .*\[mqtt\]"), failures_reported():
        raise MissingExtraError("MQTT", "paho-mqtt", "mqtt")


class StoreError(MarksError):
    """A setting's error that has the name of a machine's."""


@pytest.mark.parametrize(
    ("error", "status"),
    [
        (FileError("part.npz", "is empty", "copy it again"), FAILED),
        (OwnFileError("die.glyphs", "is gone", "put it back"), FAILED),
        (NothingFoundError(["parts"]), FAILED),
        (StageDownError("the stage has not answered", "see that it works"), FAILED),
        (NotFoundError("there is no such part"), FAILED),
        (ClusterError("the scheduler is lost"), FAILED),
        (WorkerLostError("killed"), FAILED),
        (NotServingError("it did not start"), FAILED),
        (ServiceError(503, {}), FAILED),
        (UnfitError("the name is too long"), USAGE),
        (SettingsError("--jobs is 0"), USAGE),
        (MissingExtraError("MQTT", "paho-mqtt", "mqtt"), USAGE),
        (StoreError("format is empty"), USAGE),
    ],
)
def test_the_status_says_whether_an_argument_or_the_world_is_at_fault(error: MarksError, status: int) -> None:
    with pytest.raises(CommandError) as told, failures_reported():
        raise error
    assert (told.value.status, str(told.value)) == (status, str(error))


def test_a_fault_of_the_program_is_not_taken_for_a_missing_extra() -> None:
    with pytest.raises(ModuleNotFoundError, match="no_such_module"), failures_reported():
        importlib.import_module("pipeline.no_such_module")


def test_a_fault_of_the_program_is_never_taken_for_bad_usage(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("pipeline.runs.production.run_batch", Mock(side_effect=ValueError("array is empty")))
    assert main(["read", "part.npz"]) == FAULT
    last = capsys.readouterr().err.splitlines()[-1]
    assert last == (
        "tactile-marks: fault of the program (ValueError: array is empty); please report it with the lines above"
    )


def test_a_machine_without_room_for_temporary_files_is_no_fault_of_the_program(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", None)
    monkeypatch.setattr(tempfile, "_candidate_tempdir_list", list)
    monkeypatch.setattr("pipeline.runs.production.run_batch", lambda *_: tempfile.gettempdir())
    assert main(["read", "part.npz"]) == FAILED
    assert "No usable temporary directory" in capsys.readouterr().err


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
        "tactile-marks read part.npz --sensors ": "real ideal",
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
