"""`tactile-marks demo --service` and `serve` as a new user meets them."""

from __future__ import annotations

import socket
from pathlib import Path

import pytest

from tests.contract.front_doors import main


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
    assert main(["serve", "--folder", str(tmp_path), "--host", "0.0.0.0", "--port", "0"]) == 2
    assert "tactile-marks tokens add" in capsys.readouterr().err


def test_mode_is_no_setting_of_a_service(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    config = tmp_path / "t.toml"
    config.write_text('mode = "fused"\n[service]\nport = 0\n')
    assert main(["serve", "--folder", str(tmp_path), "--config", str(config)]) == 2
    assert "mode" in capsys.readouterr().err
