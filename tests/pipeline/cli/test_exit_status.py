from __future__ import annotations

import importlib
import sys
import tempfile
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
