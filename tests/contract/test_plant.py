"""A part's way through the service by every door: HTTP, TCP, watched folder, webhook."""

from __future__ import annotations

import shutil
import socket
from collections.abc import Iterator
from typing import Any
from urllib.parse import urlsplit

import httpx
import pytest

from tests.contract.plant import Plant, run_plant
from tests.support.programs import program
from tests.support.waiting import wait_until

CHROMIUM = ["--no-sandbox", "--disable-gpu", "--disable-background-networking", "--no-first-run"]
SETTLED_MS = 400  # the page ignores an Enter that was meant for the page before


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


@pytest.mark.parametrize(
    ("role", "name", "data"),
    [
        ("scan", "part.npz", b"rubbish"),
        ("scan", "part.h5", b"\x89HDF\r\n\x1a\n" + bytes(500)),
        ("photo", "part.png", b"\x89PNG\r\n\x1a\n" + bytes(50)),
    ],
)
def test_a_damaged_file_is_refused_by_name_and_makes_no_part(
    http: httpx.Client, role: str, name: str, data: bytes
) -> None:
    before = http.get("/v1/parts").json()
    assert name in is_problem(http.post("/v1/parts", files={role: (name, data)}), 422)["detail"]
    assert http.get("/v1/parts").json() == before


def test_what_is_not_there_is_404(http: httpx.Client) -> None:
    unknown = "01JD0000000000000000000000"
    for path in (f"/v1/parts/{unknown}", f"/v1/parts/{unknown}/history", "/v1/nothing"):
        assert http.get(path).status_code == 404


def test_health_readiness_and_metrics(http: httpx.Client) -> None:
    assert http.get("/healthz").status_code == 200
    assert http.get("/readyz").status_code == 200
    assert "tactile_marks_jobs_running" in http.get("/metrics").text
    assert http.get("/healthz", headers={"X-Request-ID": "abc-1"}).headers["x-request-id"] == "abc-1"


@pytest.mark.parametrize("path", ["/", "/review", "/parts", "/dashboard", "/jobs", "/docs", "/login"])
def test_every_page_comes_without_asking_other_hosts(http: httpx.Client, path: str) -> None:
    page = http.get(path, follow_redirects=True)
    assert page.status_code == 200
    assert 'src="http' not in page.text
    assert "Content-Security-Policy" in page.headers


def test_a_trigger_over_tcp_is_answered_in_one_line(plant: Plant, http: httpx.Client) -> None:
    with socket.create_connection(("127.0.0.1", plant.tcp_port), timeout=60.0) as line:
        answers = line.makefile("rb")
        line.sendall(b"PING\r\nTRIGGER clean\r\n")
        assert answers.readline() == b"PONG\r\n"
        name, decision, text, _, source, part_id = answers.readline().decode().strip().split(";")
        assert (name, decision, text, source) == ("clean", "ACCEPT", plant.truth["clean"], "vision")
        assert http.get(f"/v1/parts/{part_id}").json()["text"] == text
        line.sendall(b"TRIGGER nobody\r\nDANCE\r\n")
        assert answers.readline().startswith(b"ERROR;")
        assert answers.readline().startswith(b"ERROR;")


def test_a_photograph_in_the_watched_folder_becomes_one_part(plant: Plant, http: httpx.Client) -> None:
    def parts() -> list[dict[str, Any]]:
        return [one for one in http.get("/v1/parts").json() if one["name"] == "watched-1"]

    (plant.watched / "notes.txt").write_text("no picture")
    (plant.watched / "broken.png").write_bytes(b"no picture either")
    shutil.copy(plant.parts / "clean.png", plant.watched / "watched-1.png")
    wait_until(lambda: bool(parts()), plant.service.process)
    assert [(one["state"], one["text"]) for one in parts()] == [("accepted", plant.truth["clean"])]
    wait_until(lambda: "broken.png" in plant.service.log, plant.service.process)


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


def test_an_operator_reviews_by_keyboard(plant: Plant, http: httpx.Client) -> None:
    """In a real browser at phone width; nothing goes wrong on the page, and no other host is asked."""
    playwright = pytest.importorskip("playwright.sync_api")
    sent = http.post(
        "/v1/parts", files=plant.scan("clean"), data={"name": "desk-7", "expected": "Q00"}
    ).json()
    assert sent["state"] == "review"
    wrong: list[str] = []
    hosts: set[str | None] = set()
    with playwright.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=program("chromium"), args=CHROMIUM)
        page = browser.new_page(viewport={"width": 390, "height": 844})  # a phone
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.on("request", lambda request: hosts.add(urlsplit(request.url).hostname))
        page.goto(f"{plant.service.url}/review/{sent['id']}")
        page.wait_for_load_state("load")
        assert page.input_value("#text") == plant.truth["clean"]
        assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
        page.fill("input[name=who]", "Anna")
        page.focus("#text")
        page.wait_for_timeout(SETTLED_MS)
        page.keyboard.press("Enter")
        page.wait_for_url(lambda url: "done=" in url)
        browser.close()
    history = http.get(f"/v1/parts/{sent['id']}/history").json()
    (kept,) = history["reviews"]
    assert (kept["after"], kept["who"]) == (plant.truth["clean"], "Anna")
    assert wrong == []
    assert hosts == {"127.0.0.1"}
