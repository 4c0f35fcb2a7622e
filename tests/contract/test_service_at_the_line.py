"""A service as a line has it: behind a proxy's prefix, with a TCP port and an MQTT broker."""

from __future__ import annotations

import contextlib
import html
import json
import re
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urljoin

import httpx
import numpy as np
import pytest
from PIL import Image

from tests.contract.broker import SERVICE_OPTIONS, Broker, Listener, free_port
from tests.contract.front_doors import RunningService, run_service, status_of, wait_until

PAGES = ("/", "/review", "/parts", "/dashboard", "/jobs", "/shadow", "/docs", "/nothing/here")


@pytest.fixture(scope="module")
def broker(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Broker]:
    made = Broker(tmp_path_factory.mktemp("line") / "broker")
    yield made
    made.stop()


@pytest.fixture(scope="module")
def tcp_port() -> int:
    return free_port()


@pytest.fixture(scope="module")
def line_options(broker: Broker, tcp_port: int) -> tuple[str, ...]:
    """The results go to a broker, and the TCP port is open."""
    line = ("--mqtt.url", broker.url, "--tcp.port", str(tcp_port), "--root-path", "/marks")
    return (*SERVICE_OPTIONS, *line)


@pytest.fixture(scope="module")
def line(tmp_path_factory: pytest.TempPathFactory, line_options: tuple[str, ...]) -> Iterator[RunningService]:
    with run_service(tmp_path_factory.mktemp("line-service"), *line_options) as running:
        yield running


@pytest.fixture
def listener(broker: Broker) -> Iterator[Listener]:
    with contextlib.closing(Listener(broker)) as one:
        yield one


def send_part(line: RunningService, height_map: Path) -> dict[str, Any]:
    with height_map.open("rb") as scan:
        answer = httpx.post(f"{line.url}/v1/parts", files={"scan": ("K7.npz", scan)}, timeout=120.0)
    assert answer.status_code == 201, answer.text
    part: dict[str, Any] = answer.json()
    return part


def ready(line: RunningService) -> dict[str, str]:
    answer = httpx.get(f"{line.url}/readyz", timeout=120.0)
    assert answer.status_code == 200
    told: dict[str, str] = answer.json()
    return told


def in_outbox(line: RunningService) -> float:
    """Results that wait for any target."""
    page = httpx.get(f"{line.url}/metrics", timeout=120.0).text
    (value,) = re.findall(r"^tactile_marks_outbox (\S+)$", page, re.MULTILINE)
    return float(value)


def connection(line: RunningService, key: str) -> str:
    """What the dashboard's card says of a connection."""
    page = httpx.get(f"{line.url}/dashboard", timeout=120.0).text
    (row,) = re.findall(rf'<tr data-connection="{key}">(.*?)</tr>', page, re.DOTALL)
    return html.unescape(re.sub(r"<[^>]+>", " ", row))


def warnings(line: RunningService, beginning: str) -> list[str]:
    logged = [json.loads(one) for one in line.log.splitlines() if one.startswith("{")]
    return [one["event"] for one in logged if one["event"].startswith(beginning)]


@pytest.mark.parametrize("path", PAGES)
def test_every_link_of_a_page_holds_under_the_prefix_of_a_proxy(line: RunningService, path: str) -> None:
    answer = httpx.get(
        f"{line.url}{path}", headers={"Accept": "text/html"}, follow_redirects=True, timeout=120.0
    )
    links = set(re.findall(r'\b(?:href|src|action|data-[a-z]+)="([^"#]+)"', answer.text))
    addresses = {html.unescape(one) for one in links if one.startswith((".", "/"))}
    assert addresses
    assert not [one for one in addresses if one.startswith("/")]
    for one in addresses:
        there = urljoin(str(answer.url), one)
        assert there.startswith(line.url)
        assert status_of(there) in (200, 303, 405), there


def test_redirects_hold_under_the_prefix_of_a_proxy(line: RunningService) -> None:
    for path in ("/", "/review/next"):
        location = httpx.get(f"{line.url}{path}").headers["location"]
        assert urljoin(f"https://plant.example/marks{path}", location) == "https://plant.example/marks/review"


def test_a_prefix_may_be_passed_on_or_taken_off_and_stands_in_links(
    line: RunningService, height_map: Path
) -> None:
    assert status_of(f"{line.url}/healthz") == status_of(f"{line.url}/marks/healthz") == 200
    assert status_of(f"{line.url}/markshealthz") == 404
    here = send_part(line, height_map)["links"]["self"]
    assert here.startswith("/marks/v1/parts/")
    assert status_of(f"{line.url}{here}") == 200
    assert httpx.get(f"{line.url}/openapi.json").json()["servers"] == [{"url": "/marks"}]


@pytest.mark.parametrize("path", ["/healthz", "/readyz", "/metrics", "/v1/jobs", "/parts"])
def test_head_is_answered_as_get_without_a_body(line: RunningService, path: str) -> None:
    answer = httpx.head(f"{line.url}{path}")
    assert (answer.status_code, answer.content) == (200, b"")
    assert int(answer.headers["content-length"]) > 0


@pytest.mark.parametrize("encoded", ["filename*=utf-8''%D1%84.png", "filename*0=fo; filename*1=to.png"])
def test_a_file_that_is_named_in_the_extended_form_alone_is_read(
    line: RunningService, tmp_path: Path, encoded: str
) -> None:
    noise = np.random.default_rng(5).integers(90, 160, (120, 240), dtype=np.uint8)
    Image.fromarray(noise).save(tmp_path / "photo.png")
    head = f'Content-Disposition: form-data; name="photo"; {encoded}\r\nContent-Type: image/png\r\n\r\n'
    body = b"--XyZ\r\n" + head.encode() + (tmp_path / "photo.png").read_bytes() + b"\r\n--XyZ--\r\n"
    kind = {"Content-Type": "multipart/form-data; boundary=XyZ"}
    answer = httpx.post(f"{line.url}/v1/parts", content=body, headers=kind, timeout=120.0)
    assert answer.status_code == 201, answer.text


def test_lines_of_fixed_length_that_are_filled_up_with_nul_are_answered(
    line: RunningService, tcp_port: int
) -> None:
    with socket.create_connection(("127.0.0.1", tcp_port), timeout=120.0) as caller:
        answers = caller.makefile("rb")
        for sent in (b"PING\r\n" + bytes(10), b"PING\r\n" + bytes(10), b"PING\0\0\0\r\n", b"\0\0PING\n\0"):
            caller.sendall(sent)
            assert answers.readline() == b"PONG\r\n", sent
        caller.sendall(b"PI\0NG\r\n")
        assert answers.readline().startswith(b"ERROR;")


def test_a_result_that_the_broker_refuses_waits_is_shown_and_comes_once_it_may(
    line: RunningService, broker: Broker, listener: Listener, height_map: Path
) -> None:
    wait_until(lambda: ready(line)["mqtt"] == "works")
    wait_until(lambda: in_outbox(line) == 0.0)  # results of parts before this one have gone
    with broker.allowed("topic write tactile-marks/status"):
        refused = send_part(line, height_map)["id"]
        wait_until(lambda: ready(line)["mqtt"].startswith("refuses 1 result"))
        assert ready(line)["status"] == "degraded"
        assert in_outbox(line) == 1.0
        assert "refuses 1 result" in connection(line, "mqtt")
        assert "Not authorized" in httpx.get(f"{line.url}/dashboard").text
        assert len(warnings(line, "mqtt does not take the result")) == 1
        assert refused not in [one["id"] for one in listener.results()]
    wait_until(lambda: [one["id"] for one in listener.results()].count(refused) == 1)
    wait_until(lambda: ready(line)["mqtt"] == "works")


def test_a_broker_that_is_down_is_shown_and_logged_once(
    line: RunningService, broker: Broker, height_map: Path
) -> None:
    wait_until(lambda: ready(line)["mqtt"] == "works")
    before = len(warnings(line, "mqtt is away"))
    broker.stop()
    waiting = send_part(line, height_map)["id"]
    wait_until(lambda: "cannot be reached since" in ready(line)["mqtt"])
    wait_until(lambda: "1 results wait" in ready(line)["mqtt"])
    assert "cannot be reached" in connection(line, "mqtt")
    broker.start()
    with contextlib.closing(Listener(broker)) as listener:
        wait_until(lambda: waiting in [one["id"] for one in listener.results()])
    wait_until(lambda: (ready(line)["status"], ready(line)["mqtt"]) == ("ready", "works"))
    assert len(warnings(line, "mqtt is away")) == before + 1


@pytest.mark.parametrize("limit", ["message_size_limit 500", "max_packet_size 500"])
def test_a_result_that_is_too_large_for_the_broker_waits(
    line: RunningService, broker: Broker, height_map: Path, limit: str
) -> None:
    wait_until(lambda: (ready(line)["mqtt"], in_outbox(line)) == ("works", 0.0))
    before = len(warnings(line, "mqtt does not take the result"))
    with broker.limited(limit):
        send_part(line, height_map)
        wait_until(lambda: ready(line)["mqtt"].startswith("refuses 1 result"))
        assert "1 results wait" in ready(line)["mqtt"]
        assert len(warnings(line, "mqtt does not take the result")) == before + 1
    wait_until(lambda: (ready(line)["mqtt"], in_outbox(line)) == ("works", 0.0))
