from __future__ import annotations

import importlib
import sys
import tempfile
from unittest.mock import Mock

import pytest

from glyphs.errors import MissingExtraError
from pipeline.cli.exit_status import FAILED, FAULT, USAGE, CommandError, failures_reported
from pipeline.cli.main import main


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
