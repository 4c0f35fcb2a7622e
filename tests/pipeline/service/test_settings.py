from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.service.settings import MqttSettings, ServiceSettings, TcpSettings, host_and_port, is_loopback
from pipeline.service.stage.devices import is_driver
from pipeline.workers import machine
from pipeline.workers.machine import LEAST_WORKER_MB, Machine


@pytest.mark.parametrize(
    ("host", "alone"),
    [("127.0.0.1", True), ("127.8.9.1", True), ("[::1]", True), ("localhost", True), ("0.0.0.0", False),
     ("[::]", False), ("192.168.0.4", False), ("press-7.example", False)],
)  # fmt: skip
def test_tokens_are_asked_for_where_others_can_call(host: str, alone: bool) -> None:
    assert is_loopback(host.strip("[]")) == alone
    assert ServiceSettings(port=f"{host}:8417").tokens_asked == (not alone)
    assert ServiceSettings(port=f"{host}:8417", tokens="on").tokens_asked


def test_the_opc_ua_server_has_the_certificate_of_tls_unless_it_has_its_own() -> None:
    tls = {"certificate": "tls.pem", "key": "tls.key"}
    both = ServiceSettings(tls=tls, opcua={"port": "0.0.0.0:4840", "users": {"line": "x"}})  # type: ignore[arg-type]
    assert (both.opcua_server.certificate, both.opcua_server.key) == (Path("tls.pem"), Path("tls.key"))
    own = ServiceSettings(tls=tls, opcua={"certificate": "own.der", "key": "own.pem"})  # type: ignore[arg-type]
    assert (own.opcua_server.certificate, own.opcua_server.key) == (Path("own.der"), Path("own.pem"))
    assert ServiceSettings().opcua_server.certificate is None


def test_the_path_of_the_brokers_address_is_the_first_level_of_the_topics() -> None:
    paths = {"": "tactile-marks", "/plant/line-4": "plant/line-4", "/Halle%204": "Halle 4"}
    for path, prefix in paths.items():
        assert MqttSettings(url=f"mqtt://host:1883{path}").prefix == prefix


@pytest.mark.parametrize(
    ("section", "name", "says", "values"),
    [
        ("mqtt", "url", "mqtt://host:1883", ("127.0.0.1:1883", "http://127.0.0.1", "mqtt://")),
        (
            "mqtt",
            "url",
            "beginning of a topic",
            tuple(f"mqtt://host/{path}" for path in ("", "a/%23", "+/a", "/a", "a/", "$SYS", "a%00")),
        ),
        ("webhook", "url", "https://host", ("example.org", "ftp://127.0.0.1", "http://", "mqtt://127.0.0.1")),
    ],
)
def test_an_address_that_cannot_be_is_refused(
    section: str, name: str, says: str, values: tuple[str, ...]
) -> None:
    for value in values:
        with pytest.raises(ValueError, match=says):
            ServiceSettings(**{section: {name: value}})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("port", "place"),
    [(8418, ("127.0.0.1", 8418)), ("0", ("127.0.0.1", 0)), ("192.168.7.10:8418", ("192.168.7.10", 8418)),
     ("[::1]:4840", ("::1", 4840)), ("press-7:1", ("press-7", 1))],
)  # fmt: skip
def test_a_port_stands_alone_or_behind_its_address(port: int | str, place: tuple[str, int]) -> None:
    assert host_and_port(TcpSettings(port=port).port or "") == place  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "port", ["", "tcp", "70000", "-1", "host:", ":80", "a@b:80", "host:80/x", "::1:80:x"]
)
def test_what_is_no_port_is_refused(port: str) -> None:
    with pytest.raises(ValueError, match="write 8418, or 192"):
        host_and_port(port)


@pytest.mark.parametrize(
    ("device", "driver"),
    [("press_hall.stage:open_stage", True), ("bench.toml", False), ("parts/", False), (r"C:\parts", False),
     ("C:parts", False), ("/data/a:b", False)],
)  # fmt: skip
def test_a_device_is_a_driver_or_a_path(device: str, driver: bool) -> None:
    assert is_driver(device) == driver


def test_more_memory_of_a_worker_takes_larger_requests(monkeypatch: pytest.MonkeyPatch) -> None:
    for share_mb, upload in ((0, 102_400_000), (40, 102_400_000), (8192, 2 * 102_400_000)):
        monkeypatch.setattr(machine, "memory_share_mb", lambda _, share_mb=share_mb: share_mb)
        assert Machine.of(1).worker_memory_mb == max(LEAST_WORKER_MB, share_mb)
        assert Machine.of(1).upload_bytes == upload


@pytest.mark.parametrize(
    ("of_unit", "of_slice", "limit"),
    [("max", "max", None), ("8589934592", "max", 8 << 30), ("8589934592", "4294967296", 4 << 30)],
)
def test_the_memory_of_a_container_or_unit_counts(
    tmp_path: Path, of_unit: str, of_slice: str, limit: int | None
) -> None:
    unit = tmp_path / "groups" / "line.slice" / "marks.service"
    unit.mkdir(parents=True)
    (unit / "memory.max").write_text(f"{of_unit}\n")
    (unit.parent / "memory.max").write_text(f"{of_slice}\n")
    process = tmp_path / "cgroup"
    process.write_text("0::/line.slice/marks.service\n")
    assert machine.group_limit(process, tmp_path / "groups") == limit
    assert machine.group_limit(tmp_path / "none", tmp_path / "groups") is None


def test_a_share_of_a_container_is_large_enough_to_read(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(machine, "group_limit", lambda: None)
    alone_mb = machine.memory_share_mb(1)
    for limit, share_mb in ((1 << 30, LEAST_WORKER_MB), (1 << 50, alone_mb)):
        monkeypatch.setattr(machine, "group_limit", lambda limit=limit: limit)
        assert machine.memory_share_mb(1) == min(alone_mb, share_mb)
