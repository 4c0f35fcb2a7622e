from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from starlette.testclient import TestClient

from pipeline.common.part_id import new_part_id
from pipeline.common.records import PartState
from pipeline.common.settings import Limits
from pipeline.formats.synth import SynthSpec, write_part
from pipeline.reading.triage import ReadPart
from pipeline.workers.machine import Machine
from tests.support.service_fixtures import FORMAT, Served, inline_service, is_problem
from tests.support.store_samples import PLAN, reading

CLEAN = "clean"
WEBHOOK = {"url": "http://127.0.0.1:9/none"}


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    folder = tmp_path_factory.mktemp("service")
    with inline_service(folder, webhook=WEBHOOK) as both:
        yield both


@pytest.fixture
def client(served: Served) -> TestClient:
    return served[1]


def truth(parts: Path) -> str:
    return (parts / f"{CLEAN}.txt").read_text()


def photo(parts: Path) -> dict[str, tuple[str, bytes]]:
    return {"photo": (f"{CLEAN}.png", (parts / f"{CLEAN}.png").read_bytes())}


def height_map(parts: Path) -> dict[str, tuple[str, bytes]]:
    return {"scan": (f"{CLEAN}.npz", (parts / f"{CLEAN}.npz").read_bytes())}


def test_several_photographs_of_a_part_are_one_reading(client: TestClient, parts: Path) -> None:
    files = [*photo(parts).items(), ("photo", ("again.png", (parts / f"{CLEAN}.png").read_bytes()))]
    part = client.post("/v1/parts", files=files).json()
    assert (part["state"], part["text"], part["reading"]["photos"]) == ("accepted", truth(parts), 2)
    history = client.get(f"{part['links']['self']}/history").json()
    kept = [one["name"] for one in history["evidence"] if one["kind"] == "photo"]
    assert kept == [f"{CLEAN}.png", "again.png"]
    refused = client.post("/v1/parts", files=[*photo(parts).items()] * 13)
    assert refused.status_code == 422
    assert refused.json()["detail"] == "there are 13 photos; 12 of a part are allowed"


def test_a_serial_outside_the_format_is_saved_only_when_it_is_meant(served: Served) -> None:
    service, client = served
    part_id = new_part_id()
    service.store.add_part(part_id=part_id, name="odd", state=PartState.REVIEW)
    said = {"action": "correct", "text": "KX4O7251", "who": "Anna"}
    asked = client.post(f"/v1/parts/{part_id}/review", json=said)
    assert asked.status_code == 422
    assert f"it does not fit the format {FORMAT}" in asked.json()["detail"]
    assert service.store.story(part_id).reviews == ()
    meant = client.post(f"/v1/parts/{part_id}/review", json={**said, "outside_format": True})
    assert (meant.status_code, meant.json()["text"]) == (200, "KX4O7251")
    # on the page: asked once, and saved when it is sent again
    service.store.add_part(part_id=(again := new_part_id()), name="odd", state=PartState.REVIEW)
    form = {"text": "AB1", "who": "Anna"}
    asked = client.post(f"/review/{again}", data=form)
    assert asked.status_code == 422
    assert f"AB1: it does not fit the format {FORMAT}" in asked.text
    assert 'name="outside" value="AB1"' in asked.text
    changed = client.post(f"/review/{again}", data={**form, "text": "AB2", "outside": "AB1"})
    assert changed.status_code == 422
    saved = client.post(f"/review/{again}", data={**form, "outside": "AB1"}, follow_redirects=False)
    assert (saved.status_code, service.store.part(again).text) == (303, "AB1")


def test_names_and_reviews_hold_nothing_hidden(served: Served, parts: Path) -> None:
    service, client = served
    service.store.add_part(part_id=(part_id := new_part_id()), name="odd", state=PartState.REVIEW)
    said = {"action": "correct", "text": "KX40", "who": "Anna", "note": "two\nlines"}
    for name in ("KX4\u202e15", "a\x1b[31m", "zero\u200bwidth"):
        refused = client.post("/v1/parts", files=photo(parts), data={"name": name})
        assert (refused.status_code, "name" in refused.json()["detail"]) == (422, True)
        for field in ("text", "who", "note"):
            hidden = client.post(f"/v1/parts/{part_id}/review", json={**said, field: name})
            assert hidden.status_code == 422
    assert client.post(f"/v1/parts/{part_id}/review", json=said).status_code == 200


def test_a_full_queue_refuses_at_once(served: Served, parts: Path) -> None:
    service, client = served
    service.pool.full = True  # type: ignore[attr-defined]
    try:
        answer = client.post("/v1/parts", files=photo(parts))
    finally:
        service.pool.full = False  # type: ignore[attr-defined]
    assert answer.status_code == 503
    assert answer.headers["Retry-After"] == "3"
    assert answer.headers["content-type"] == "application/problem+json"


@pytest.mark.parametrize(
    ("files", "status", "says"),
    [
        ({}, 422, "neither photo nor scan"),
        ({"photo": ("x.png", b"no picture")}, 415, "not a picture"),
        ({"photo": ("x.heic", b"\0\0\0\x18ftypheic" + bytes(200))}, 415, "PNG, JPEG, BMP, TIFF, WebP or GIF"),
        ({"photo": ("x.png", b"\x89PNG\r\n\x1a\n and then nothing")}, 422, "x.png"),
        ({"photo": ("x.png", b"")}, 422, "empty"),
        ({"scan": ("x.exe", b"MZ")}, 415, "height map"),
        ({"scan": ("../../etc/x.npz", b"PK\x03\x04")}, 422, "x.npz"),
        ({"scan": ("x.h5", b"\x89HDF\r\n\x1a\n" + bytes(100))}, 422, "x.h5"),
        ({"scan": ("x.npz", b"rubbish")}, 422, "x.npz"),
    ],
)
def test_what_cannot_be_read_is_told_by_its_name(
    served: Served, files: dict[str, tuple[str, bytes]], status: int, says: str
) -> None:
    service, client = served
    before = client.get("/v1/parts").json()
    answer = client.post("/v1/parts", files=files) if files else client.post("/v1/parts", data={"name": "x"})
    assert client.get("/v1/parts").json() == before
    assert answer.status_code == status, answer.text
    assert says in answer.json()["detail"]
    assert "/etc" not in answer.text
    assert "work-" not in answer.text
    assert not list(service.evidence.incoming.iterdir())


def test_an_upload_over_the_limit_is_refused_before_it_is_read(tmp_path: Path) -> None:
    with inline_service(tmp_path, machine=Machine(upload_bytes=1_000_000)) as (service, client):
        told = client.post("/v1/parts", files={"photo": ("x.png", bytes(2_000_000))})
        assert is_problem(told, 413, "1 MB")

        def chunks() -> Iterator[bytes]:
            yield b'--x\r\nContent-Disposition: form-data; name="photo"; filename="x.png"\r\n\r\n'
            for _ in range(40):
                yield bytes(100_000)

        untold = client.post(
            "/v1/parts", content=chunks(), headers={"Content-Type": "multipart/form-data; boundary=x"}
        )
        assert is_problem(untold, 413, "1 MB")
        assert not list(service.evidence.incoming.iterdir())


@pytest.mark.parametrize("declared", [True, False])
def test_settings_over_the_limit_are_no_fault_of_the_program(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, capsys: pytest.CaptureFixture[str], declared: bool
) -> None:
    body = b'{"format": "' + bytes(6_000_000) + b'"}'
    with inline_service(tmp_path, machine=Machine(upload_bytes=1_000_000)) as (_, client):
        answer = client.put("/v1/jobs/left", content=body if declared else iter([body]))
        assert answer.status_code == 413
    assert "Traceback" not in caplog.text + capsys.readouterr().out


def test_a_photograph_of_too_many_pixels_is_refused_unseen(tmp_path: Path, parts: Path) -> None:
    with inline_service(tmp_path, machine=Machine(files=Limits(photo_pixels=1000))) as (_, client):
        answer = client.post("/v1/parts", files=photo(parts))
        assert answer.status_code == 422
        assert "1,000" in answer.json()["detail"]


@pytest.mark.parametrize("as_form", [{"data": {"nmae": "P17"}}, {"files": {"picture": ("a.png", b"x")}}])
def test_an_unknown_field_of_a_form_is_named_with_the_known_ones(
    tmp_path: Path, as_form: dict[str, Any]
) -> None:
    with inline_service(tmp_path) as (service, client):
        files = {"photo": ("a.png", b"picture"), **as_form.get("files", {})}
        for form in (as_form, {**as_form, "files": files}):
            refused = client.post("/v1/parts", **form)
            assert (refused.status_code, refused.headers["content-type"]) == (422, "application/problem+json")
            unknown = "nmae" if "data" in as_form else "picture"
            known = "photo, scan, name, expected, database, job, touch"
            assert refused.json()["detail"] == f"there is no form field '{unknown}'; there are {known}"
        golden = client.post("/v1/golden", files={"scan": ("a.h5", b"x")}, data={"refernce": "true"})
        assert (golden.status_code, "scan, reference" in golden.json()["detail"]) == (422, True)
        assert service.store.parts() == ()


@pytest.mark.parametrize(
    ("form", "says"),
    [
        ({"files": [("scan", ("a.npz", b"x"))] * 2}, "the field scan comes 2 times; send it once"),
        ({"data": {"name": ["P1", "P2"]}}, "the field name comes 2 times; send it once"),
        ({"data": {"photo": "part.png"}}, "photo is text, not a file; with curl write -F photo=@FILE"),
        ({"data": {"scan": "part.npz"}}, "scan is text, not a file; with curl write -F scan=@FILE"),
    ],
)  # fmt: skip
def test_a_form_that_would_be_read_in_part_is_refused(
    served: Served, form: dict[str, Any], says: str
) -> None:
    service, client = served
    before = service.store.parts()
    for sent in (form, {**form, "files": [*form.get("files", ()), ("photo", ("a.png", b"x"))]}):
        refused = client.post("/v1/parts", **sent)
        assert (refused.status_code, refused.json()["detail"]) == (422, says)
    assert service.store.parts() == before


@pytest.mark.parametrize(
    ("method", "address", "sent", "says"),
    [
        ("GET", "/v1/parts?nmae=P17", {}, "there is no parameter 'nmae'; /docs lists them"),
        ("GET", "/v1/parts.csv?limit=3", {}, "there is no parameter 'limit'; /docs lists them"),
        ("GET", "/parts?state=foo", {}, "state: input should be 'touch_needed', 'accepted', "),
        ("GET", "/parts?first=2026-13-45", {}, "first: input should be a valid date"),
        ("GET", "/jobs/new", {}, "part is missing; add it"),
        ("POST", "/v1/parts", {"data": {"name": "P\x01"}}, "name is empty or has a character that is not allowed"),
        ("POST", "/v1/parts/X/review", {"content": b"{no"}, "the body is not JSON (Expecting property name"),
        ("POST", "/v1/parts/X/review", {"json": {"action": "confirm", "nte": ""}}, "there is no field 'nte'; /docs"),
    ],
)  # fmt: skip
def test_an_invalid_value_is_named_as_the_sender_knows_it(
    client: TestClient, method: str, address: str, sent: dict[str, Any], says: str
) -> None:
    headers = {"Content-Type": "application/json"} if "content" in sent else {}
    refused = client.request(method, address, headers=headers, **sent)
    assert (refused.status_code, refused.json()["detail"][: len(says)]) == (422, says)


def test_a_database_is_chosen_by_name(tmp_path: Path, parts: Path) -> None:
    from glyphs.fonts.outlines import load_font
    from pipeline.formats.glyph_database import GlyphDatabase, save_database

    (tmp_path / "databases").mkdir()
    save_database(GlyphDatabase({"gothic": load_font("gothic")}), tmp_path / "databases" / "press-7.glyphs")
    with inline_service(tmp_path) as (_, client):
        assert [d["name"] for d in client.get("/v1/databases").json()] == ["press-7"]
        part = client.post("/v1/parts", files=height_map(parts), data={"database": "press-7"}).json()
        assert part["text"] == truth(parts)
        assert part["database"] == part["reading"]["database"] == "press-7"
        missing = client.post("/v1/parts", files=height_map(parts), data={"database": "../press-7"})
        assert missing.status_code == 422
        assert "press-7" in missing.json()["detail"]


@pytest.mark.parametrize(("touch", "state"), [(None, "review"), ("plan", "touch_needed")])
def test_without_a_stage_a_person_gets_what_the_camera_is_unsure_of(
    tmp_path: Path, parts: Path, touch: str | None, state: str
) -> None:
    with inline_service(tmp_path, webhook=WEBHOOK) as (service, client):
        unsure = ReadPart((reading(source="vision", decision="review"),), plan=PLAN)
        service.pool.instead = lambda *_: unsure  # type: ignore[attr-defined]
        asked = {} if touch is None else {"touch": touch}
        part = client.post("/v1/parts", files=photo(parts), data=asked).json()
        assert part["state"] == state
        assert part["plan"]["region_mm"]
        assert service.store.undelivered() == 1
        kinds = [e.kind for e in service.store.story(part["id"]).events]
        assert kinds == ["received", "read", "touch_needed", *(["not_felt"] if state == "review" else [])]
        assert [p.id for p in service.store.queue()] == ([part["id"]] if state == "review" else [])
        if touch == "plan":  # whoever has a stage may still send what it felt
            service.pool.instead = None  # type: ignore[attr-defined]
            felt = client.post(f"/v1/parts/{part['id']}/scan", files=height_map(parts))
            assert (felt.status_code, felt.json()["reading"]["source"]) == (200, "fused")


def test_touch_that_felt_another_part_than_the_camera_saw_is_not_accepted(
    tmp_path: Path, parts: Path
) -> None:
    other = write_part(SynthSpec(format="AA99", seed=22), tmp_path / "other", 0, photos=False)
    unsure = ReadPart((reading(source="vision", decision="review"),), plan=PLAN)
    with inline_service(tmp_path / "s") as (service, client):
        waiting = []
        for _ in range(2):
            service.pool.instead = lambda *_: unsure  # type: ignore[attr-defined]
            waiting.append(client.post("/v1/parts", files=photo(parts), data={"touch": "plan"}).json()["id"])
        service.pool.instead = None  # type: ignore[attr-defined]
        felt = {"scan": ("other.npz", (tmp_path / "other.npz").read_bytes())}
        part = client.post(f"/v1/parts/{waiting[0]}/scan", files=felt).json()
        assert (part["state"], part["text"]) == ("review", other)
        apart = f"camera reads {truth(parts)}, touch {other}: are they of one part?"
        assert part["reading"]["messages"][0] == apart
        # without its photograph nothing says whether it is the same part
        for kept in service.store.story(waiting[1]).evidence:
            service.evidence.path(kept.sha256).unlink(missing_ok=True)
        refused = client.post(f"/v1/parts/{waiting[1]}/scan", files=felt)
        assert refused.status_code == 409
        assert "photographs" in refused.json()["detail"]


def test_the_description_of_the_interface_is_of_the_routes_for_programs(client: TestClient) -> None:
    told = client.get("/openapi.json").json()
    assert "HTTPValidationError" not in told["components"]["schemas"]
    assert "/review" not in told["paths"]


def test_the_web_server_leaves_the_libraries_that_read_parts_to_its_workers() -> None:
    code = "import sys, pipeline.service.app; print({'numba', 'scipy', 'cv2', 'onnxruntime'} & sys.modules.keys())"
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ended.stdout == "set()\n"
