"""`tactile-marks demo --service` and `serve` as a new user meets them."""

from __future__ import annotations

import socket
from pathlib import Path

import httpx
import pytest

from tests.contract.front_doors import free_port, main, run_service, synth, truth_of


def test_stay_goes_with_service(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["demo", "--stay"]) == 2
    assert "--service" in capsys.readouterr().err


def test_a_trigger_at_the_tcp_port_photographs_feels_and_reads(tmp_path: Path) -> None:
    made = synth(tmp_path / "made", "AA99", "--seed", "2")
    for suffix in (".npz", ".png"):
        (made / f"part-000{suffix}").rename(tmp_path / f"P17{suffix}")
    port = free_port()
    options = ("--tcp-port", str(port), "--camera", str(tmp_path), "--stage", str(tmp_path), "--jobs", "1")
    reading = ("--format", "AA99", "--font", "gothic", "--height-mm", "5")
    with (
        run_service(tmp_path / "service", *options, *reading) as service,
        socket.create_connection(("127.0.0.1", port), timeout=60.0) as line,
        httpx.Client(base_url=service.url, timeout=60.0) as http,
    ):
        line.sendall(b"TRIGGER P17\r\n")
        answer = line.makefile("rb").readline().decode().rstrip("\r\n")
        assert answer.startswith(f"P17;ACCEPT;{truth_of(made)['part-000']};")
        part = http.get(f"/v1/parts/{answer.rpartition(';')[2]}").json()
        assert (part["name"], part["state"]) == ("P17", "accepted")
        assert part["text"] == truth_of(made)["part-000"]
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
