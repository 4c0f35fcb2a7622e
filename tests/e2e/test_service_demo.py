"""`tactile-marks demo --service` and `serve` as a new user meets them."""

from __future__ import annotations

import socket
from pathlib import Path

import pytest

from pipeline.cli import service_demonstration as service_demo
from pipeline.cli.main import main
from pipeline.files.synth import SynthSpec, write_part
from pipeline.service.client import Client
from pipeline.service.line.result_string import ResultString
from pipeline.service.process import service_process


def test_the_demo_takes_parts_from_the_camera_to_touch(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(service_demo, "SEVERITIES", (0.0, 0.5))
    assert main(["demo", "--service", "--out", str(tmp_path)]) == 0
    told = capsys.readouterr().out
    assert "camera" in told
    assert "touch needed" in told
    assert "of stage time" in told
    assert told.rstrip().endswith("for a person to review")


def test_stay_goes_with_service(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["demo", "--stay"]) == 2
    assert "--service" in capsys.readouterr().err


def test_a_trigger_at_the_tcp_port_photographs_feels_and_reads(tmp_path: Path) -> None:
    truth = write_part(SynthSpec(format="AA99", seed=2), tmp_path / "P17", 0, photos=True)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    options = ("--tcp-port", str(port), "--camera", str(tmp_path), "--stage", str(tmp_path), "--jobs", "1")
    reading = ("--format", "AA99", "--font", "gothic", "--height-mm", "5")
    with (
        service_process(tmp_path / "service", *options, *reading) as service,
        socket.create_connection(("127.0.0.1", port), timeout=60.0) as line,
        Client(service.url) as client,
    ):
        line.sendall(b"TRIGGER P17\r\n")
        answer = line.makefile("rb").readline().decode().rstrip("\r\n")
        part = client.part(answer.rpartition(";")[2])
        assert answer == ResultString().of(part)
        assert answer.startswith(f"P17;ACCEPT;{truth};")
        line.sendall(b"TRIGGER nobody\r\n")
        assert line.makefile("rb").readline().startswith(b"ERROR;")


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
    assert main(["serve", "--folder", str(tmp_path), "--host", "0.0.0.0", "--port", "0"]) == 2
    assert "tactile-marks tokens add" in capsys.readouterr().err


def test_mode_is_no_setting_of_a_service(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    config = tmp_path / "t.toml"
    config.write_text('mode = "fused"\n[service]\nport = 0\n')
    assert main(["serve", "--folder", str(tmp_path), "--config", str(config)]) == 2
    assert "mode" in capsys.readouterr().err


def test_an_unknown_setting_of_the_service_is_an_error(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    config = tmp_path / "t.toml"
    config.write_text("[service]\nprot = 8417\n")
    assert main(["serve", "--folder", str(tmp_path), "--config", str(config)]) == 2
    assert "did you mean port" in capsys.readouterr().err
