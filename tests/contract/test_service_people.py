"""People at a service: taking a part over, undoing a review, editing and deleting jobs, on the page and over HTTP."""

from __future__ import annotations

import html
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from tests.contract.front_doors import RunningService

JOB = {"format": "A9", "font": "gothic", "height_mm": 4.0}


@pytest.fixture
def people(service: RunningService) -> Iterator[tuple[httpx.Client, httpx.Client]]:
    """Two browsers, with cookies of their own."""
    with (
        httpx.Client(base_url=service.url, timeout=120.0, follow_redirects=True) as ada,
        httpx.Client(base_url=service.url, timeout=120.0, follow_redirects=True) as bob,
    ):
        yield ada, bob


def new_part(service: RunningService, height_map: Path) -> dict[str, Any]:
    """A part that waits for a person: it bears another serial than the one expected."""
    scan = {"scan": ("K7.npz", height_map.read_bytes())}
    answer = httpx.post(f"{service.url}/v1/parts", files=scan, data={"expected": "Q0"}, timeout=120.0)
    made: dict[str, Any] = answer.json()
    assert made["state"] == "review"
    return made


def submit(browser: httpx.Client, page: httpx.Response, to: str, **fields: str) -> httpx.Response:
    """Send the form of a page whose address ends so, with its hidden fields."""
    for action, inner in re.findall(
        r'<form method="post" action="([^"]+)"[^>]*>(.*?)</form>', page.text, re.DOTALL
    ):
        if not action.endswith(to):
            continue
        kept = re.findall(r'<input type="hidden" name="([^"]+)" value="([^"]*)"', inner)
        areas = re.findall(r'<textarea name="([^"]+)"[^>]*>\n?(.*?)</textarea>', inner, re.DOTALL)
        form = {name: html.unescape(value) for name, value in (*kept, *areas)}
        return browser.post(page.url.join(action), data={**form, **fields})
    raise AssertionError(f"{page.url} has no form to {to}")


def is_taken(page: httpx.Response) -> bool:
    return re.search(r'id="taken" role="alert">', page.text) is not None


def test_a_part_that_a_closed_browser_holds_can_be_taken_over(
    people: tuple[httpx.Client, httpx.Client], service: RunningService, height_map: Path
) -> None:
    (ada, bob), part = people, new_part(service, height_map)
    address = f"/review/{part['id']}"
    ada.get("/review")  # the first page gives a browser its cookie
    bob.get("/review")
    assert not is_taken(ada.get(address))
    blocked = bob.get(address)
    assert is_taken(blocked)
    assert "Take over" in blocked.text
    refused = submit(bob, blocked, part["id"], text="K8", who="Bob")
    assert refused.status_code == 409
    assert not is_taken(submit(bob, blocked, "/takeover"))
    assert is_taken(ada.get(address))
    saved = submit(bob, bob.get(address), part["id"], text="K8", who="Bob")
    assert saved.status_code == 200
    assert bob.get(f"/v1/parts/{part['id']}").json()["text"] == "K8"


def test_a_review_can_be_undone_by_the_one_who_made_it(
    people: tuple[httpx.Client, httpx.Client], service: RunningService, height_map: Path
) -> None:
    (ada, bob), part = people, new_part(service, height_map)
    here = f"/v1/parts/{part['id']}"
    said = {"action": "correct", "text": "K6", "who": "Ada"}
    assert ada.post(f"{here}/review", json=said).json()["state"] == "reviewed"
    assert bob.delete(f"{here}/review", params={"who": "Bob"}).status_code == 409
    undone = ada.delete(f"{here}/review", params={"who": "Ada"}).json()
    assert (undone["state"], undone["text"]) == ("review", part["text"])
    assert ada.delete(f"{here}/review", params={"who": "Ada"}).status_code == 409
    history = ada.get(f"{here}/history").json()
    assert [one["kind"] for one in history["events"]][-2:] == ["reviewed", "review_undone"]
    assert len(history["reviews"]) == 1

    ada.get("/review")
    saved = submit(ada, ada.get(f"/review/{part['id']}"), part["id"], text="K8", who="Ada")
    assert ada.get(here).json()["text"] == "K8"
    page = submit(ada, saved, "/undo")
    assert "waits for review again" in page.text
    assert ada.get(here).json()["state"] == "review"


def test_a_job_is_edited_and_deleted_over_http(service: RunningService) -> None:
    with httpx.Client(base_url=service.url, timeout=120.0) as client:
        assert client.put("/v1/jobs/flange", json=JOB).status_code == 201
        assert client.get("/v1/jobs/flange").json()["settings"]["height_mm"] == 4.0
        assert client.put("/v1/jobs/flange", json={**JOB, "height_mm": 5.0}).status_code == 200
        assert client.get("/v1/jobs/flange").json()["settings"]["height_mm"] == 5.0
        assert client.delete("/v1/jobs/flange").status_code == 204
        assert client.get("/v1/jobs/flange").status_code == 404
        assert client.delete("/v1/jobs/flange").status_code == 404
        assert "flange" not in [job["name"] for job in client.get("/v1/jobs").json()]
        # gone for good, and not just away for a moment
        photo = {"photo": ("a.png", b"\x89PNG\r\n\x1a\n")}
        assert client.post("/v1/parts", files=photo, data={"job": "flange"}).status_code == 422


def test_a_job_is_edited_and_deleted_on_the_page(
    people: tuple[httpx.Client, httpx.Client], service: RunningService
) -> None:
    ada, bob = people
    assert ada.put("/v1/jobs/bracket", json=JOB).status_code in (200, 201)
    assert "jobs/edit/bracket" in ada.get("/jobs").text
    page = ada.get("/jobs/edit/bracket")
    assert "height_mm = 4.0" in html.unescape(page.text)
    stale = bob.get("/jobs/edit/bracket")
    text = 'format = "A9"\nfont = ["gothic"]\nheight_mm = 6.0\n\n[line.lot]\nformat = "AA9"\n'
    assert "Saved" in submit(ada, page, "/bracket", text=text, action="save").text
    settings = ada.get("/v1/jobs/bracket").json()["settings"]
    assert (settings["height_mm"], settings["line"]) == (6.0, {"lot": {"format": "AA9"}})
    assert submit(bob, stale, "/bracket", text=text, action="save").status_code == 409
    for wrong in ("height_mm = ", "height_mm = -1", "lexicon = '/etc/passwd'", "x = " + "[" * 5000):
        refused = submit(ada, ada.get("/jobs/edit/bracket"), "/bracket", text=wrong, action="save")
        assert refused.status_code == 422, wrong
    unsure = submit(ada, ada.get("/jobs/edit/bracket"), "/bracket", action="delete")
    assert unsure.status_code == 422
    assert "is deleted" in submit(ada, unsure, "/bracket", action="delete", sure="1").text
    assert ada.get("/v1/jobs/bracket").status_code == 404
