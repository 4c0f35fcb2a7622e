from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.common.setting_sources import SettingsError
from pipeline.common.settings import load_settings
from pipeline.service.settings import is_loopback, load_service_settings


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_nothing_need_be_set() -> None:
    settings = load_service_settings()
    assert (settings.host, settings.port) == ("127.0.0.1", 8417)
    assert not settings.tokens_asked
    assert settings.store_url.startswith("sqlite:////")
    assert settings.store_url.endswith("tactile-marks-data/store.db")


def test_the_table_of_the_file_the_environment_and_the_flags_in_this_order(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    Path("tactile-marks.toml").write_text("height_mm = 4.0\n[service]\nport = 1\nqueue = 1\nworkers = 1\n")
    monkeypatch.setenv("TACTILE_MARKS_SERVICE_QUEUE", "2")
    monkeypatch.setenv("TACTILE_MARKS_SERVICE_WORKERS", "2")
    settings = load_service_settings(workers=3)
    assert (settings.port, settings.queue, settings.workers) == (1, 2, 3)
    assert load_settings().height_mm == 4.0  # the same file and environment trouble no reader


@pytest.mark.parametrize(
    ("written", "says"),
    [
        ("[service]\nprot = 1\n", "did you mean port"),
        ("service = 3\n", "make it a table"),
        ('[service]\nport = "many"\n', "port in"),
        ('[service]\nhost = "0.0.0.0"\ntokens = "off"\n', "without tokens"),
        ('[service]\nwebhook = "ftp://x"\n', "begin it with https://"),
        ('[service]\nmqtt = "broker:1883"\n', "mqtt://host:1883"),
        ('[service]\nline_host = "0.0.0.0"\ntcp_port = 8418\n', "tcp_clients"),
        ('[service]\nline_host = "0.0.0.0"\nopcua_port = 4840\n', "opcua_certificate"),
        ('[service]\ntcp_clients = ["the line"]\n', "tcp_clients in"),
        ("[service]\nretention_days = -1\n", "retention_days in"),
    ],
)
def test_what_cannot_be_is_told_with_its_mend(written: str, says: str) -> None:
    Path("tactile-marks.toml").write_text(written)
    with pytest.raises(SettingsError, match=says):
        load_service_settings()


def test_a_misspelt_variable_of_the_service_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TACTILE_MARKS_SERVICE_PROT", "1")
    with pytest.raises(SettingsError, match="TACTILE_MARKS_SERVICE_PROT"):
        load_service_settings()


@pytest.mark.parametrize(
    ("host", "alone"),
    [("127.0.0.1", True), ("127.8.9.1", True), ("::1", True), ("localhost", True), ("0.0.0.0", False), ("::", False),
     ("192.168.0.4", False), ("press-7.example", False)],
)  # fmt: skip
def test_tokens_are_asked_for_where_others_can_call(host: str, alone: bool) -> None:
    assert is_loopback(host) == alone
    assert load_service_settings(host=host).tokens_asked == (not alone)
    assert load_service_settings(host=host, tokens="on").tokens_asked
