"""A part's way through the service by every door: HTTP behind a proxy's prefix, TCP, folder, webhook, MQTT, OPC UA."""

from __future__ import annotations

import asyncio
import contextlib
import html
import logging
import re
import shutil
import socket
import struct
import time
from collections.abc import Iterator
from typing import Any
from urllib.parse import urljoin

import httpx
import numpy as np
import pytest
from asyncua import Client, Node, ua
from PIL import Image

from tests.contract.front_doors import status_of
from tests.contract.plant import Plant, run_plant
from tests.support.line_broker import Listener, hello, message
from tests.support.waiting import wait_until

pytestmark = pytest.mark.anyio
PAGES = ("/", "/review", "/parts", "/dashboard", "/jobs", "/shadow", "/docs", "/login", "/nothing/here")
SPACE = "urn:tactile-marks:reader"


@pytest.fixture
def anyio_backend() -> str:
    return "asyncio"


@pytest.fixture(autouse=True)
def _quiet_client(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.CRITICAL, logger="asyncua")


@pytest.fixture(scope="module")
def plant(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Plant]:
    with run_plant(tmp_path_factory.mktemp("plant")) as running:
        yield running


@pytest.fixture
def http(plant: Plant) -> Iterator[httpx.Client]:
    with plant.client() as client:
        yield client


@pytest.fixture(scope="module")
def unsure(plant: Plant) -> dict[str, Any]:
    """A part of which the camera is unsure, before anyone has felt it."""
    with plant.client() as client:
        answer = client.post("/v1/parts", files=plant.photo("filthy"), data={"name": "filthy"})
    assert answer.status_code == 201, answer.text
    part: dict[str, Any] = answer.json()
    return part


@pytest.fixture
def listener(plant: Plant) -> Iterator[Listener]:
    with contextlib.closing(plant.broker.listener()) as one:
        yield one


def is_problem(answer: httpx.Response, status: int) -> dict[str, Any]:
    """The problem document of a refusal."""
    assert (answer.status_code, answer.headers["content-type"]) == (status, "application/problem+json")
    problem: dict[str, Any] = answer.json()
    assert problem["status"] == status
    assert problem["detail"]
    return problem


def test_the_camera_alone_accepts_a_clean_part(plant: Plant, http: httpx.Client) -> None:
    part = http.post("/v1/parts", files=plant.photo("clean"), data={"name": "tray-1"}).json()
    assert (part["state"], part["text"], part["plan"]) == ("accepted", plant.truth["clean"], None)
    assert part["reading"]["source"] == "vision"
    assert http.get(part["links"]["self"]).json() == part
    for picture in ("photo", "boxes"):
        assert http.get(part["links"][picture]).headers["content-type"].startswith("image/")
    is_problem(http.get(part["links"]["edges"]), 404)  # nothing was felt
    wait_until(lambda: bool(plant.receiver.of(part["id"])), plant.service.process)
    sent = plant.receiver.of(part["id"])[-1]
    assert (sent["state"], sent["text"]) == ("accepted", plant.truth["clean"])


def test_an_unsure_camera_asks_for_touch_with_a_plan(unsure: dict[str, Any]) -> None:
    assert (unsure["state"], unsure["text"]) == ("touch_needed", "")
    plan = unsure["plan"]
    x0, y0, x1, y1 = plan["region_mm"]
    assert x1 > x0
    assert y1 > y0
    assert plan["passes"] > 0
    assert plan["seconds"] > 0.0
    assert plan["directions_deg"]
    assert plan["reason"]


def test_the_stage_feels_what_the_camera_could_not_read(
    plant: Plant, http: httpx.Client, unsure: dict[str, Any]
) -> None:
    answer = http.post(f"/v1/parts/{unsure['id']}/touch")
    assert answer.status_code == 200, answer.text
    part = answer.json()
    assert part["state"] in ("accepted", "review")
    assert part["state"] == "review" or part["text"] == plant.truth["filthy"]
    assert part["reading"]["source"] in ("fused", "tactile")
    assert part["reading"]["passes"]
    history = http.get(f"/v1/parts/{part['id']}/history").json()
    assert [event["kind"] for event in history["events"]][:3] == ["received", "read", "touch_needed"]
    assert {"photo", "scan"} <= {one["kind"] for one in history["evidence"]}


def test_a_part_that_the_stage_lost_is_not_felt_unasked_but_once_it_is_released(
    plant: Plant, http: httpx.Client
) -> None:
    def ask(line: bytes) -> list[str]:
        with socket.create_connection(("127.0.0.1", plant.tcp_port), timeout=60.0) as tcp:
            tcp.sendall(line + b"\r\n")
            return tcp.makefile("rb").readline().decode().strip().split(";")

    def events() -> list[dict[str, Any]]:
        shown: list[dict[str, Any]] = http.get(f"/v1/parts/{part_id}/history").json()["events"]
        return shown

    shutil.copy(plant.parts / "filthy.png", plant.parts / "nest.png")
    with plant.camera_saving("nest"):
        name, decision, *_, part_id = ask(b"TRIGGER nest")
    assert (name, decision in ("REVIEW", "REJECT")) == ("nest", True)  # nothing may be seen under the dirt
    part = http.get(f"/v1/parts/{part_id}").json()
    assert (part["state"], part["plan"] is None) == ("review", False)
    assert "there is no height map of nest" in part["not_felt"]
    # another part lies there now
    shutil.copy(plant.parts / "clean.npz", plant.parts / "nest.npz")
    before = events()
    time.sleep(3.0)  # three looks at the parts that wait
    assert events() == before
    ended = ask(b"TOUCH nest")
    assert ended[0] == "nest"
    assert http.get(f"/v1/parts/{part_id}").json()["reading"]["source"] in ("fused", "tactile")


def test_both_files_at_once_are_fused(plant: Plant, http: httpx.Client) -> None:
    part = http.post("/v1/parts", files={**plant.photo("clean"), **plant.scan("clean")}).json()
    assert (part["state"], part["text"]) == ("accepted", plant.truth["clean"])
    assert part["reading"]["source"] == "fused"


def test_an_expected_serial_is_confirmed_or_refuted(plant: Plant, http: httpx.Client) -> None:
    right = plant.truth["clean"]
    wrong = right[:-1] + ("4" if right[-1] != "4" else "7")
    for expected, verdict, state in ((right, "confirmed", "accepted"), (wrong, "refuted", "review")):
        part = http.post("/v1/parts", files=plant.scan("clean"), data={"expected": expected}).json()
        assert part["reading"]["verdict"] == verdict
        assert part["state"] == state


def test_one_key_makes_one_part_which_is_searched_and_exported(plant: Plant, http: httpx.Client) -> None:
    key, about = {"Idempotency-Key": "tray-3"}, {"name": "searched-5"}
    first = http.post("/v1/parts", files=plant.scan("clean"), headers=key, data=about)
    again = http.post("/v1/parts", files=plant.scan("clean"), headers=key, data=about)
    assert (first.status_code, again.status_code) == (201, 200)
    assert first.json()["id"] == again.json()["id"]
    is_problem(http.post("/v1/parts", files=plant.scan("filthy"), headers=key, data=about), 422)
    found = http.get("/v1/parts", params={"text": plant.truth["clean"], "limit": 500}).json()
    assert [one["id"] for one in found].count(first.json()["id"]) == 1
    table = http.get("/v1/parts.csv")
    assert table.headers["content-type"].startswith("text/csv")
    assert table.text.count("searched-5") == 1


def test_a_review_is_kept_beside_what_was_read(plant: Plant, http: httpx.Client) -> None:
    part = http.post("/v1/parts", files=plant.scan("clean"), data={"name": "tray-4"}).json()
    said = {"action": "correct", "text": "B77", "who": "Anna"}
    reviewed = http.post(f"/v1/parts/{part['id']}/review", json=said)
    assert reviewed.status_code == 200, reviewed.text
    assert (reviewed.json()["state"], reviewed.json()["text"]) == ("reviewed", "B77")
    history = http.get(f"/v1/parts/{part['id']}/history").json()
    (kept,) = history["reviews"]
    assert (kept["before"], kept["after"], kept["who"]) == (plant.truth["clean"], "B77", "Anna")
    assert history["readings"][0]["text"] == plant.truth["clean"]
    outside = {"action": "correct", "text": "7777", "who": "Anna"}
    is_problem(http.post(f"/v1/parts/{part['id']}/review", json=outside), 422)


def test_health_readiness_and_metrics(http: httpx.Client) -> None:
    assert http.get("/healthz").status_code == 200
    assert http.get("/readyz").status_code == 200
    assert "tactile_marks_jobs_running" in http.get("/metrics").text
    assert http.get("/healthz", headers={"X-Request-ID": "abc-1"}).headers["x-request-id"] == "abc-1"


def test_a_trigger_over_tcp_is_answered_in_one_line(plant: Plant, http: httpx.Client) -> None:
    with socket.create_connection(("127.0.0.1", plant.tcp_port), timeout=60.0) as line:
        answers = line.makefile("rb")
        line.sendall(b"PING\r\nTRIGGER clean\r\n")
        assert answers.readline() == b"PONG\r\n"
        with plant.camera_saving("clean"):
            name, decision, text, _, source, part_id = answers.readline().decode().strip().split(";")
        assert (name, decision, text, source) == ("clean", "ACCEPT", plant.truth["clean"], "vision")
        assert http.get(f"/v1/parts/{part_id}").json()["text"] == text
        # its answer was lost, and it is looked up; a new trigger would wait for a new picture
        line.sendall(b"RESULT clean\r\n")
        assert answers.readline().decode().strip().split(";")[1:3] == ["ACCEPT", plant.truth["clean"]]
        line.sendall(b"TRIGGER clean\r\n")
        assert answers.readline().startswith(b"ERROR;there is no new photograph of clean")
        line.sendall(b"TRIGGER nobody\r\nDANCE\r\n")
        assert answers.readline().startswith(b"ERROR;")
        assert answers.readline().startswith(b"ERROR;")


def test_a_photograph_in_the_watched_folder_becomes_one_part(plant: Plant, http: httpx.Client) -> None:
    def parts(name: str) -> list[dict[str, Any]]:
        return [one for one in http.get("/v1/parts").json() if one["name"] == name]

    (plant.watched / "notes.txt").write_text("no picture")
    shutil.copy(plant.parts / "clean.png", plant.watched / "watched-1.png.filepart")
    wait_until(lambda: "notes.txt" in plant.service.log, plant.service.process)
    (plant.watched / "watched-1.png.filepart").rename(plant.watched / "watched-1.png")
    wait_until(lambda: bool(parts("watched-1")), plant.service.process)
    assert [(one["state"], one["text"]) for one in parts("watched-1")] == [("accepted", plant.truth["clean"])]
    assert parts("watched-1.png") == []


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (b"", "is empty"),
        (b"no picture at all", "not a picture"),
        (b"\x89PNG\r\n\x1a\n" + bytes(30), "PNG"),
        (None, "cut short"),
    ],
    ids=["empty", "no picture", "damaged", "cut short"],
)
def test_a_photograph_that_cannot_be_read_is_counted_published_and_waits_for_a_person(
    plant: Plant, http: httpx.Client, content: bytes | None, why: str
) -> None:
    def parts() -> list[dict[str, Any]]:
        return [one for one in http.get("/v1/parts").json() if one["name"] == name]

    whole = (plant.parts / "clean.png").read_bytes()
    name = f"day-2/{why}"
    (plant.watched / "day-2").mkdir(exist_ok=True)
    (plant.watched / f"{name}.png").write_bytes(whole[: len(whole) // 2] if content is None else content)
    wait_until(lambda: bool(parts()), plant.service.process)
    (part,) = parts()
    assert (part["state"], part["text"], part["reading"]["decision"]) == ("review", "", "reject")
    (message,) = part["reading"]["messages"]
    assert message.startswith("photograph cannot be read: ")
    assert why in message
    wait_until(lambda: bool(plant.receiver.of(part["id"])), plant.service.process)
    assert message in html.unescape(http.get(f"/review/{part['id']}").text)


def test_a_receiver_that_fails_at_first_gets_every_result_in_order(plant: Plant, http: httpx.Client) -> None:
    plant.receiver.status = 500
    try:
        part = http.post("/v1/parts", files=plant.scan("clean"), data={"name": "late-6"}).json()
        said = {"action": "correct", "text": "B78", "who": "Anna"}
        assert http.post(f"/v1/parts/{part['id']}/review", json=said).status_code == 200
    finally:
        plant.receiver.status = 204
    wait_until(lambda: len(plant.receiver.of(part["id"])) >= 2, plant.service.process)
    arrived = plant.receiver.of(part["id"])
    assert [one["text"] for one in arrived] == [plant.truth["clean"], "B78"]
    numbers = [one["delivery_id"] for one in arrived]
    assert numbers == sorted(numbers, key=str)


# --------------------------------------------------------------------------- proxy, TCP, broker


@pytest.mark.parametrize("path", PAGES)
def test_every_link_of_a_page_holds_under_the_prefix_of_a_proxy_and_asks_no_other_host(
    plant: Plant, path: str
) -> None:
    answer = httpx.get(
        f"{plant.url}{path}", headers={"Accept": "text/html"}, follow_redirects=True, timeout=120.0
    )
    assert answer.status_code == (404 if path == PAGES[-1] else 200)
    assert "Content-Security-Policy" in answer.headers
    assert 'src="http' not in answer.text
    links = set(re.findall(r'\b(?:href|src|action|data-[a-z]+)="([^"#]+)"', answer.text))
    addresses = {html.unescape(one) for one in links if one.startswith((".", "/"))}
    assert addresses
    assert not [one for one in addresses if one.startswith("/")]
    for one in addresses:
        there = urljoin(str(answer.url), one)
        assert there.startswith(plant.url)
        assert status_of(there) in (200, 303, 405), there


def test_redirects_hold_under_the_prefix_of_a_proxy(plant: Plant) -> None:
    for path in ("/", "/review/next"):
        location = httpx.get(f"{plant.url}{path}").headers["location"]
        there = urljoin(f"https://plant.example/marks{path}", location)
        assert there.startswith("https://plant.example/marks/review")


def test_a_prefix_may_be_passed_on_or_taken_off_and_stands_in_links(plant: Plant) -> None:
    assert status_of(f"{plant.url}/healthz") == status_of(f"{plant.url}/marks/healthz") == 200
    assert status_of(f"{plant.url}/markshealthz") == 404
    here = plant.send_part()["links"]["self"]
    assert here.startswith("/marks/v1/parts/")
    assert status_of(f"{plant.url}{here}") == 200
    assert httpx.get(f"{plant.url}/openapi.json").json()["servers"] == [{"url": "/marks"}]


@pytest.mark.parametrize("path", ["/healthz", "/readyz", "/metrics", "/v1/jobs", "/parts"])
def test_head_is_answered_as_get_without_a_body(plant: Plant, path: str) -> None:
    answer = httpx.head(f"{plant.url}{path}")
    assert (answer.status_code, answer.content) == (200, b"")
    assert int(answer.headers["content-length"]) > 0


@pytest.mark.parametrize("encoded", ["filename*=utf-8''%D1%84.png", "filename*0=fo; filename*1=to.png"])
def test_a_file_that_is_named_in_the_extended_form_alone_is_read(plant: Plant, encoded: str) -> None:
    head = f'Content-Disposition: form-data; name="photo"; {encoded}\r\nContent-Type: image/png\r\n\r\n'
    body = b"--XyZ\r\n" + head.encode() + (plant.parts / "clean.png").read_bytes() + b"\r\n--XyZ--\r\n"
    kind = {"Content-Type": "multipart/form-data; boundary=XyZ"}
    answer = httpx.post(f"{plant.url}/v1/parts", content=body, headers=kind, timeout=120.0)
    assert answer.status_code == 201, answer.text


def test_lines_of_fixed_length_that_are_filled_up_with_nul_are_answered(plant: Plant) -> None:
    with socket.create_connection(("127.0.0.1", plant.tcp_port), timeout=120.0) as caller:
        answers = caller.makefile("rb")
        for sent in (b"PING\r\n" + bytes(10), b"PING\r\n" + bytes(10), b"PING\0\0\0\r\n", b"\0\0PING\n\0"):
            caller.sendall(sent)
            assert answers.readline() == b"PONG\r\n", sent
        caller.sendall(b"PI\0NG\r\n")
        assert answers.readline().startswith(b"ERROR;")


def test_a_result_that_the_broker_refuses_waits_is_shown_and_comes_once_it_may(
    plant: Plant, listener: Listener
) -> None:
    wait_until(lambda: plant.ready()["mqtt"] == "works")
    wait_until(lambda: plant.in_outbox() == 0.0)  # results of parts before this one have gone
    with plant.broker.allowed("topic write tactile-marks/status"):
        refused = plant.send_part()["id"]
        wait_until(lambda: plant.ready()["mqtt"].startswith("refuses 1 result"))
        assert plant.ready()["status"] == "degraded"
        wait_until(lambda: plant.in_outbox() == 1.0)
        assert "refuses 1 result" in plant.connection("mqtt")
        assert "Not authorized" in httpx.get(f"{plant.url}/dashboard").text
        assert len(plant.logged("mqtt does not take the result")) == 1
        assert refused not in [one["id"] for one in listener.results()]
    wait_until(lambda: [one["id"] for one in listener.results()].count(refused) == 1)
    wait_until(lambda: plant.ready()["mqtt"] == "works")


def test_a_broker_that_is_down_is_shown_and_logged_once(plant: Plant) -> None:
    wait_until(lambda: plant.ready()["mqtt"] == "works")
    before = len(plant.logged("mqtt is away"))
    plant.broker.kill()
    waiting = plant.send_part()["id"]
    wait_until(lambda: "cannot be reached since" in plant.ready()["mqtt"])
    wait_until(lambda: "1 results wait" in plant.ready()["mqtt"])
    assert "cannot be reached" in plant.connection("mqtt")
    plant.broker.start()
    with contextlib.closing(plant.broker.listener()) as listener:
        wait_until(lambda: waiting in [one["id"] for one in listener.results()])
    wait_until(lambda: (plant.ready()["status"], plant.ready()["mqtt"]) == ("ready", "works"))
    assert len(plant.logged("mqtt is away")) == before + 1


@pytest.mark.parametrize("limit", ["message_size_limit 500", "max_packet_size 500"])
def test_a_result_that_is_too_large_for_the_broker_waits(plant: Plant, limit: str) -> None:
    wait_until(lambda: (plant.ready()["mqtt"], plant.in_outbox()) == ("works", 0.0))
    before = len(plant.logged("mqtt does not take the result"))
    with plant.broker.limited(limit):
        plant.send_part()
        wait_until(lambda: plant.ready()["mqtt"].startswith("refuses 1 result"))
        assert "1 results wait" in plant.ready()["mqtt"]
        assert len(plant.logged("mqtt does not take the result")) == before + 1
    wait_until(lambda: (plant.ready()["mqtt"], plant.in_outbox()) == ("works", 0.0))


# ------------------------------------------------------------------------------------------- OPC UA


async def reader_at(client: Client) -> tuple[Node, int, int]:
    """The reader's node, and the indices of its own namespace and of AutoID's."""
    own, autoid = [
        await client.get_namespace_index(uri) for uri in (SPACE, "http://opcfoundation.org/UA/AutoID/")
    ]
    return client.get_node(ua.NodeId("reader", own)), own, autoid


async def test_the_same_session_is_answered_while_a_method_runs(plant: Plant) -> None:
    noise = np.random.default_rng(5).integers(90, 160, (300, 400), dtype=np.uint8)
    Image.fromarray(noise).save(plant.parts / "P1.png")
    async with plant.opcua_client() as client:
        reader, space, autoid = await reader_at(client)
        status = await reader.get_child([f"{autoid}:DeviceStatus"])
        called = asyncio.create_task(reader.call_method(f"{space}:TriggerPart", "P1"))
        seen = []
        with plant.camera_saving("P1"):
            while not called.done():
                seen.append(await status.read_value())
                await asyncio.sleep(0.02)
        assert 3 in seen  # busy
        part_id, _, decision, _, _ = await called
        assert len(part_id) == 26
        assert decision in ("REJECT", "REVIEW", "TOUCH")


async def test_a_part_that_came_over_http_is_shown(plant: Plant) -> None:
    part = await asyncio.to_thread(plant.send_part)
    assert part["text"] == plant.truth["clean"]
    async with plant.opcua_client() as client:
        reader, _, autoid = await reader_at(client)
        shown = await (await reader.get_child([f"{autoid}:LastScanData"])).read_value()
        assert getattr(shown, "String", shown) == plant.truth["clean"]


async def test_wrong_passwords_are_logged_and_delay_the_next(plant: Plant) -> None:
    before = len(plant.logged("sign-in denied"))
    clock = asyncio.get_running_loop()
    begin = clock.time()
    for n in range(4):
        with pytest.raises(ua.UaStatusCodeError):
            async with plant.opcua_client(f"wrong-{n}"):
                pass
    assert clock.time() - begin > 0.25 + 0.5 + 1.0
    assert len(plant.logged("sign-in denied to 'line-user' from 127.0.0.1")) > before
    assert "geheim" not in plant.service.log
    async with plant.opcua_client() as client:  # and the right one is let in
        assert await client.get_namespace_index(SPACE)
    plain = Client(plant.opcua_url, timeout=100)
    plain.set_user("line-user")
    plain.set_password("geheim")
    with pytest.raises(ua.UaError):  # a password never travels in the clear
        async with plain:
            pass


async def test_silent_callers_keep_nobody_out(plant: Plant) -> None:
    with contextlib.ExitStack() as stack:
        for _ in range(100):
            stack.enter_context(socket.create_connection(("127.0.0.1", plant.opcua_port), timeout=10.0))
        async with plant.opcua_client() as client:
            assert await client.get_namespace_index(SPACE)


def nonsense(url: str) -> Iterator[bytes]:
    """Beginnings of what no client sends."""
    yield b"GET / HTTP/1.1\r\nHost: x\r\n\r\n"
    yield bytes(range(3, 60))
    yield hello(url) + message(b"MSGF", bytes(24)) * 50
    yield hello(url) + message(b"OPNF", b"\xff" * 40) * 50
    yield b"MSGF" + struct.pack("<I", 0xFFFFFFFF) + bytes(100)


async def test_nonsense_is_let_go_and_leaves_few_lines(plant: Plant) -> None:
    before = len(plant.service.log)
    for _ in range(20):
        for sent in nonsense(plant.opcua_url):
            with (
                contextlib.suppress(OSError),
                socket.create_connection(("127.0.0.1", plant.opcua_port)) as caller,
            ):
                caller.settimeout(10.0)
                caller.sendall(sent)
                if sent.startswith(b"MSGF"):
                    continue  # it waits for more, and is closed by the time for signing in
                while caller.recv(4096):
                    pass
    async with plant.opcua_client() as client:
        assert await client.get_namespace_index(SPACE)
    grown = plant.service.log[before:]
    assert len(grown) < 20_000
    assert "Traceback" not in grown
    assert "OPC UA: a connection from 127.0.0.1 was closed: it does not speak OPC UA" in grown
