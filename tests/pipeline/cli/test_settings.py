"""Settings from flags, environment and file, and where they are documented."""

from __future__ import annotations

import errno
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest
from cyclopts import App, CycloptsError

from pipeline.cli.main import main
from pipeline.cli.settings import (
    PARTS,
    READING,
    SERVICE,
    Config,
    JobPath,
    Parts,
    Reading,
    ReadingOfFile,
    Service,
    explained,
    from_file_and_environment,
    with_flags,
)
from pipeline.common.settings import PartSettings, ReadSettings, SettingsError
from pipeline.service.settings import ServiceSettings
from pipeline.workers import machine
from pipeline.workers.options import PoolSettings, WorkerSettings

FILE = Path("tactile-marks.toml")


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def run(command: Callable[..., object], *flags: str) -> object:
    app = App(config=from_file_and_environment, default_command=command, result_action="return_value")
    try:
        return app(flags, exit_on_error=False, print_error=False)
    except CycloptsError as error:
        raise SettingsError(explained(error)) from error


def reading(*flags: str) -> ReadSettings:
    """The settings of a command that reads."""

    def command(reading: Reading = READING, job: JobPath = None, config: Config = None) -> ReadSettings:
        return reading

    settings = run(command, *flags)
    assert isinstance(settings, ReadSettings)
    return settings


def serving(*flags: str) -> tuple[ServiceSettings, ReadSettings]:
    """The settings of a command that serves."""

    def command(
        service: Service = SERVICE, reading: Reading = READING, config: Config = None
    ) -> tuple[ServiceSettings, ReadSettings]:
        return service, reading

    settings = run(command, *flags)
    assert isinstance(settings, tuple)
    return settings


def test_nothing_need_be_set() -> None:
    assert reading() == ReadSettings()
    assert serving() == (ServiceSettings(), ReadSettings())


SOURCES = (
    # a setting; the file and what comes of it, the environment likewise, and flags
    ("height_mm", "height_mm = 3", 3.0, "4", 4.0, "--height-mm 5", 5.0),
    ("accept_risk", 'accept_risk = "1 in 200"', 0.005, "1/100", 0.01, "--accept-risk 0.02", 0.02),
    ("sensors", 'sensors = "ideal"', "ideal", "real", "real", "--sensors ideal", "ideal"),
    ("font", 'font = ["gothic", "futural"]', ("gothic", "futural"), "futural, my font.ttf", ("futural", "my font.ttf"),
     "--font timesr --font a,b.ttf", ("timesr", "a,b.ttf")),
    # a format has commas of its own, so the environment gives one
    ("format", 'format = ["sets:AB,0-9,0-9", "re:A\\\\d+"]', ("sets:AB,0-9,0-9", "re:A\\d+"), "sets:AB,0-9,0-9",
     ("sets:AB,0-9,0-9",), "--format AA --format re:A.", ("AA", "re:A.")),
    ("depth_rule", 'depth_rule = "27 cfr 478.92"', ("27 cfr 478.92",), "70-16-05", ("70-16-05",),
     "--depth-rule 70-16-05 --depth-rule press-7=0.1:0.25@4:6", ("70-16-05", "press-7=0.1:0.25@4:6")),
    ("line", '[line]\nlot = "AAA99"\ndate = "99/99"', ("lot=AAA99", "date=99/99"),
     '{"lot": "AA9", "heat": "sets:H,0-9"}', ("lot=AA9", "heat=sets:H,0-9"),
     "--line lot=AAA99 --line date=99/99", ("lot=AAA99", "date=99/99")),
    ("line", '[line.lot]\nformat = "AAA99"\nregion = [0.0, 0.5, 1.0, 1.0]', ("lot@0,0.5,1,1=AAA99",),
     '{"lot": {"format": "A9", "region": [0, 0, 1, 0.5]}}', ("lot@0,0,1,0.5=A9",), "--line lot=A9", ("lot=A9",)),
    ("region", "region = [0, 0.2, 1, 0.6]", (0.0, 0.2, 1.0, 0.6), "0, 0.1, 1, 0.5", (0.0, 0.1, 1.0, 0.5),
     "--region 0 0 0.5 1", (0.0, 0.0, 0.5, 1.0)),
)  # fmt: skip


@pytest.mark.parametrize("source", SOURCES, ids=lambda source: source[0])
def test_flags_go_over_environment_over_file(
    source: tuple[Any, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    name, toml, of_file, variable, of_variable, flags, of_flags = source
    Path("other.toml").write_text(toml, encoding="utf-8")
    assert getattr(reading("--config", "other.toml"), name) == of_file
    FILE.write_text(f"{toml}\n[service]\nport = 1\n", encoding="utf-8")
    assert getattr(reading(), name) == getattr(serving()[1], name) == of_file
    monkeypatch.setenv(f"TACTILE_MARKS_{name.upper()}", variable)
    assert getattr(reading(), name) == getattr(serving()[1], name) == of_variable
    assert getattr(reading(*flags.split()), name) == of_flags


def test_the_service_has_a_table_and_variables_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    FILE.write_text(
        "height_mm = 4.0\n[workers]\njobs = 1\n[service]\nport = 1\ndrain_s = 1\nopcua.users = {line = 'x'}\n"
        "[service.tcp]\nformat = '{text}'\n",
        encoding="utf-8",
    )
    monkeypatch.setenv("TACTILE_MARKS_SERVICE_DRAIN_S", "2")
    monkeypatch.setenv("TACTILE_MARKS_SERVICE_RETENTION_DAYS", "2")
    monkeypatch.setenv("TACTILE_MARKS_BUDGET_S", "20")
    monkeypatch.setenv("TACTILE_MARKS_SERVICE_TCP_CLIENTS", "192.168.7.0/24, 10.0.0.1")
    service, read = serving("--retention-days", "3", "--format", "AA99")
    assert (service.port, service.drain_s, service.retention_days) == ("1", 2, 3.0)
    assert service.tcp.format == "{text}"
    assert serving("--tcp.format", "{id}")[0].tcp.format == "{id}"
    assert service.tcp.clients == ("192.168.7.0/24", "10.0.0.1")
    assert service.opcua.users == {"line": "x"}
    assert (read.height_mm, read.budget_s, read.format) == (4.0, 20.0, ("AA99",))
    assert reading().height_mm == 4.0  # the same file and environment trouble no reader
    monkeypatch.setenv("TACTILE_MARKS_SERVICE_OPCUA_USERS", '{"line": "y"}')
    assert serving()[0].opcua.users == {"line": "y"}


def test_a_service_reads_several_lines_and_stands_at_a_named_line() -> None:
    service, read = serving("--line", "lot=AAA99", "--line-name", "press")
    assert service.line_name == "press"
    assert read.line == ("lot=AAA99",)
    with pytest.raises(SettingsError, match="'press' is not a line; write NAME=FORMAT"):
        serving("--line", "press")


def test_no_flag_sets_two_things() -> None:
    assert set(ReadSettings.leaves()).isdisjoint(ServiceSettings.leaves())


def test_a_command_whose_flags_mean_something_else_has_settings_of_the_file() -> None:
    def command(
        font: str, *, reading: ReadingOfFile = READING, config: Config = None
    ) -> tuple[str, ReadSettings]:
        return font, reading

    FILE.write_text('font = "gothic"\n', encoding="utf-8")
    assert run(command, "--font", "press-7") == ("press-7", ReadSettings(font=("gothic",)))


def test_a_job_stands_in_place_of_file_and_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    FILE.write_text('height_mm = 3\norientation = "upright"\n', encoding="utf-8")
    monkeypatch.setenv("TACTILE_MARKS_BUDGET_S", "20")
    Path("jobs").mkdir()
    Path("jobs/lids.txt").write_text("KX40\n", encoding="utf-8")
    Path("jobs/left.toml").write_text('format = "AA99"\nlexicon = "lids.txt"\n', encoding="utf-8")
    job = ReadSettings(format=("AA99",), lexicon=Path("jobs/lids.txt").absolute())
    assert reading("--job", "jobs/left.toml") == job
    over = reading("--job", "jobs/left.toml", "--format", "A9", "--mode", "auto")
    assert over == job.model_copy(update={"format": ("A9",), "mode": "auto"})
    with pytest.raises(SettingsError, match="--job and --config both say how to read; name one"):
        reading("--job", "jobs/left.toml", "--config", str(FILE))


@pytest.mark.parametrize(
    ("toml", "message"),
    [
        ("hight_mm = 5", r"unknown setting hight_mm in tactile-marks\.toml; did you mean height_mm"),
        ("[servce]\nport = 1", r"unknown section \[servce\] in .*; did you mean \[service\]\?"),
        (
            "[service.stge]\nfolder = 'x'",
            r"unknown section \[service.stge\] in .*did you mean \[service.stage\]",
        ),
        ("height_mm = -5", r"height_mm in tactile-marks\.toml is '-5': write a number above 0"),
        ('height_mm = "tall"', "height_mm in .* is 'tall'"),
        ('mode = "smell"', "mode in .* is 'smell'.*'tactile'"),
        ("format = 'check:luhm'", "format in .* unknown check digit 'luhm'; known are vin, vin-na, luhn"),
        ("check = 'luhn'", 'unknown setting check in .*; did you mean format = "check:RULE"'),
        ("[service]\nqueue = 1", "unknown setting queue in .*; leave it out: it follows from the machine"),
        ("[service]\njobs = 1", r"jobs in .* is in the wrong place; write it under \[workers\]"),
        ("[service]\nhost = '::1'", 'host in .*; did you mean port = "HOST:PORT"'),
        ("[service.tcp]\nhost = '::1'", 'tcp.host in .*; did you mean tcp.port = "HOST:PORT"'),
        ("[service.tcp]\nport = 'COM3'", "tcp.port in .* is 'COM3'.*write 8418, or"),
        ("[service.watch]\nsettle_s = 1", "watch.settle_s in .*; did you mean watch.photos"),
        ("line = ['lot=A', 'lot=9']", "line in .* two lines are called lot"),
        ("region = [0, 0.8, 1, 0.2]", "region in .* give left, top, right and bottom as shares, 0 to 1"),
        ("line = 'a b=A'", "line in .* 'a b' is not a name for a line"),
        (
            "accept_risk = 1.5",
            "accept_risk in .* is '1.5': write a risk between 0 and 1, such as 0.001, 1/1000 or",
        ),
        ("height_mm = ", "not TOML"),
        ("port = 1\n", r"port in .* is in the wrong place; write it under \[service\]"),
        (
            '[service]\nfont = ["gothic"]\n',
            "font in .* is in the wrong place; write it above the first table",
        ),
        ("service = 3\n", "make it a table"),
        ('[service]\nport = "0.0.0.0:8417"\ntokens = "off"\n', "without tokens"),
        ('[service]\nwebhook.url = "ftp://x"\n', "write https://host/path"),
        ('[service.tcp]\nport = "0.0.0.0:8418"\n', "tcp.clients"),
        ('[service.opcua]\nport = "0.0.0.0:4840"\n', "opcua.certificate"),
        (
            '[service.opcua]\nport = "0.0.0.0:0"\ncertificate = "a.der"\nkey = "a.pem"\n',
            "give it .* opcua.users",
        ),
        ("[service]\ntcp = 1\n", r"tcp in .* is 1; make it a table: \[service.tcp\]"),
        ("[service]\nopcua = {port = 0, users = {line = 'x'}}\n", "opcua.users need opcua.certificate"),
    ],
)
def test_a_bad_file_is_an_error_with_key_and_place(toml: str, message: str) -> None:
    FILE.write_text(toml, encoding="utf-8")
    with pytest.raises(SettingsError, match=message):
        serving()


@pytest.mark.parametrize(
    ("flag", "near"),
    [
        ("--service.folder", "--folder"),
        ("--tls-certificate", "--tls.certificate"),
        ("--fodler", "--folder"),
        ("--zz", ""),
        ("--check", '--format "check:RULE"'),
        ("--stage.folder", "--stage.device"),
    ],
)
def test_an_unknown_flag_names_the_nearest_one_or_none(
    flag: str, near: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["serve", flag, "x"]) == 2
    printed = capsys.readouterr().err
    assert f"Unknown option: {flag}." in printed
    assert (f"Did you mean {near}?" if near else "(see ") in printed
    assert ("Did you mean" in printed) == bool(near)


def test_a_setting_without_a_flag_is_named_with_its_other_places(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["serve", "--region", "0", "0", "1", "1"]) == 2
    assert "Set region in tactile-marks.toml or as TACTILE_MARKS_REGION." in capsys.readouterr().err
    assert main(["read", "a.npz", "--min-depth-mm", "0.2"]) == 2
    assert 'Did you mean --depth-rule "0.2:"?' in capsys.readouterr().err


@pytest.mark.parametrize(
    ("variable", "value", "message"),
    [
        ("TACTILE_MARKS_HEIGHT_MM", "0", "TACTILE_MARKS_HEIGHT_MM is '0': write a number above 0"),
        ("TACTILE_MARKS_SENSRS", "ideal", "TACTILE_MARKS_SENSRS.*did you mean sensors"),
        ("TACTILE_MARKS_LINE", '{"lot"', "TACTILE_MARKS_LINE is"),
        ("TACTILE_MARKS_SERVICE_PROT", "1", "TACTILE_MARKS_SERVICE_PROT.*did you mean port"),
        ("TACTILE_MARKS_SERVICE_JOBS", "1", r"TACTILE_MARKS_SERVICE_JOBS.*did you mean jobs in \[workers\]"),
        ("TACTILE_MARKS_SERVICE_OPCUA_USERS", "[", "TACTILE_MARKS_SERVICE_OPCUA_USERS"),
        ("TACTILE_MARKS_SERVICE_SHUTDOWN_GRACE_S", "1", "did you mean drain_s"),
    ],
)
def test_a_bad_environment_is_an_error_with_its_variable(
    variable: str, value: str, message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(variable, value)
    with pytest.raises(SettingsError, match=message):
        serving()


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        (("--depth-rule", "x"), "--depth-rule is 'x': unknown depth rule"),
        (
            ("--experts", "network,nose"),
            "--experts is .* there is no expert nose; there are network, templates",
        ),
        (("--config", "none.toml"), r"none\.toml is not there"),
        (("--config", "."), "is not a file"),
    ],
)
def test_bad_flags(flags: tuple[str, ...], message: str) -> None:
    with pytest.raises(SettingsError, match=message):
        reading(*flags)


def test_a_database_that_is_not_there_is_a_wrong_setting_wherever_it_is_named(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    missing = "press-7.glyphs"
    with pytest.raises(SettingsError, match=r"^press-7\.glyphs is not there; check the name"):
        reading("--database", missing)
    FILE.write_text(f'database = "{missing}"\n', encoding="utf-8")
    with pytest.raises(SettingsError, match=r"named by database in tactile-marks\.toml, is not there"):
        serving()
    assert main(["read", "a.npz"]) == 2
    FILE.unlink()
    monkeypatch.setenv("TACTILE_MARKS_DATABASE", missing)
    assert main(["read", "a.npz"]) == 2
    assert "named by TACTILE_MARKS_DATABASE, is not there" in capsys.readouterr().err


def test_a_group_of_settings_is_no_setting() -> None:
    with pytest.raises(
        SettingsError, match=r"--watch is 'x', but it is a group of settings; .* such as watch\.folder"
    ):
        serving("--watch", "x")


def test_every_setting_has_a_description_and_stands_in_help(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "400")
    monkeypatch.setenv("TERM", "xterm")  # on a dumb one rich keeps the 80 columns of an earlier test
    flags = {"serve": (ServiceSettings, PartSettings, PoolSettings), "read": (ReadSettings, WorkerSettings)}
    for command, models in flags.items():
        assert main([command, "--help-all"]) == 0
        # however wide an earlier test has left the console
        shown = " ".join(capsys.readouterr().out.replace("│", " ").split())
        for model in models:
            for name, field in model.leaves().items():
                assert field.description
                assert field.description[:40] in shown
                assert f"--{name.replace('_', '-')}" in shown
        assert ("[default: 8417]" in shown) == (command == "serve")
        assert "()" not in shown


PASTED = """
format = ["AA99"]
[service]
port = 8420
watch.folder = "camera"
[service.tcp]
port = 8421
"""


@pytest.mark.parametrize("order", [1, -1])
def test_settings_may_be_pasted_into_the_file_to_begin_with(order: int) -> None:
    assert main(["settings", str(FILE)]) == 0
    FILE.write_text("\n".join([FILE.read_text(encoding="utf-8"), PASTED][::order]), encoding="utf-8")
    service, reading = serving()
    assert (service.port, service.tcp.port, service.watch.folder) == ("8420", "8421", Path("camera"))
    assert reading.format == ("AA99",)


@pytest.mark.parametrize(
    ("toml", "message"),
    [
        (
            "[service]\nport = 1\n[service]\nhost = 'x'\n",
            r"has a second \[service\] in line 3; put all its settings in one place",
        ),
        ("service.tcp.port = 1\n[service.tcp]\n", r"has a second \[service\.tcp\] in line 2"),
        (
            "service.port = 1\nservice.port = 2\nfont = []\n",
            "sets a name twice, again in line 2; remove one of them",
        ),
        ("service.port = 1.5", "port in .* is '1.5': it is not a port; write 8418, or 192"),
        ("active = 'maybe'", "active in .* is 'maybe': write true or false$"),
        ("service.opcua.users = 5", "opcua.users in .* is 5: write a table of names and values$"),
    ],
)
def test_a_fault_of_the_file_is_told_in_plain_words(
    toml: str, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    FILE.write_text(toml, encoding="utf-8")
    assert main(["serve"]) == 2
    assert re.search(message, capsys.readouterr().err.strip())


def test_a_file_of_settings_to_begin_with(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["settings", str(FILE)]) == 0
    text = FILE.read_text(encoding="utf-8")
    assert serving() == (ServiceSettings(), ReadSettings())
    for model in (ReadSettings, ServiceSettings):
        for name, field in model.leaves().items():
            assert f"\n#{model.table and f'{model.table}.'}{name} = " in text
            assert str(field.description)[:60] in text
    in_force = re.sub(r"^#(?=[a-z])", "", text, flags=re.MULTILINE)  # every setting that has a value
    FILE.write_text(re.sub(r"^[\w.]+ = +# .*$", "", in_force, flags=re.MULTILINE), encoding="utf-8")
    assert 'service.port = "8417"' in FILE.read_text(encoding="utf-8").splitlines()
    assert serving() == (ServiceSettings(), ReadSettings())
    capsys.readouterr()
    assert main(["settings", "other.toml"]) == 0
    assert main(["settings", "other.toml"]) == 2
    assert "other.toml is there already" in capsys.readouterr().err
    assert Path("other.toml").read_text(encoding="utf-8") == text


def test_a_file_of_settings_on_a_full_disk_leaves_nothing_behind(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    with monkeypatch.context() as patched:
        patched.setattr("os.fsync", Mock(side_effect=OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))))
        assert main(["settings", "one.toml"]) == 1
    printed = capsys.readouterr().err
    assert (
        "one.toml: cannot be written (No space left on device); name a folder that can be written" in printed
    )
    assert list(Path().iterdir()) == []
    assert main(["settings", "one.toml"]) == 0


def test_settings_shows_what_is_set_and_what_follows_from_the_machine(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    FILE.write_text('format = "AA99"\n[workers]\njobs = 2\n', encoding="utf-8")
    monkeypatch.setenv("TACTILE_MARKS_SERVICE_DRAIN_S", "5")
    monkeypatch.setattr(machine, "memory_share_mb", lambda _: 5000)
    assert main(["settings"]) == 0
    shown = capsys.readouterr().out
    lines = shown.splitlines()
    assert 'format = ["AA99"]' in lines
    assert "workers.jobs = 2" in lines
    assert "service.drain_s = 5.0" in lines
    assert '#service.port = "8417"' in lines
    assert re.search(r"^# memory of each process +5,000 MB$", shown, re.MULTILINE)
    assert re.search(r"^# parts that wait for a process +64$", shown, re.MULTILINE)
    assert re.search(r"^# largest photograph +50,000,000 pixels$", shown, re.MULTILINE)


def test_flags_go_over_the_settings_of_a_command_with_few_flags() -> None:
    def command(
        parts: Parts = PARTS, reading: ReadingOfFile = READING, config: Config = None
    ) -> ReadSettings:
        return with_flags(reading, parts)

    FILE.write_text('font = "gothic"\nheight_mm = 4\nbudget_s = 9\n', encoding="utf-8")
    read = run(command, "--font", "futural", "--accept-risk", "1/50")
    assert read == ReadSettings(font=("futural",), height_mm=4.0, budget_s=9.0, accept_risk=0.02)
    assert "accept_risk" in read.model_fields_set


def test_help_of_a_command_is_its_whole_docstring(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["tokens", "add", "--help"]) == 0
    assert "the store keeps only its hash" in capsys.readouterr().out


def test_a_flag_unlike_all_others_is_not_explained_by_one(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["read", "part.npz", "--settings", "line.toml"]) == 2
    assert "Unknown option: --settings. (see " in capsys.readouterr().err
