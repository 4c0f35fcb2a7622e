"""The Python client, against a real web server that plays the service."""

from __future__ import annotations

import contextlib
import json
import socket
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import uvicorn
from starlette.applications import Starlette
from starlette.datastructures import UploadFile
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route

from pipeline.common.reading_records import to_json
from pipeline.common.records import (
    EventRecord,
    EvidenceKind,
    EvidenceRecord,
    PartState,
    ReviewAction,
    ReviewRecord,
)
from pipeline.service.client import Client, ServiceError
from tests.support.line_fakes import NOW, part, reading, serving
from tests.support.waiting import free_port

ID = "01KB0000000000000000000017"
PART = part()
LINKS = {"links": {"self": f"/v1/parts/{ID}"}, "something": "that later versions say"}


HISTORY = {
    "events": [to_json(EventRecord(NOW, "received", {"bytes": 7}))],
    "readings": [to_json(reading())],
    "reviews": [to_json(ReviewRecord(ReviewAction.CORRECT, "A", "B", "Anna", at=NOW))],
    "evidence": [to_json(EvidenceRecord(EvidenceKind.PHOTO, "ab" * 32, 7, at=NOW))],
}


class Service:
    """The service's interface, without a service; `refuse` answers instead, once each."""

    def __init__(self) -> None:
        self.requests: list[dict[str, Any]] = []
        self.refuse: list[Response] = []
        self.made: dict[str, str] = {}
        self.app = Starlette(routes=[Route("/{path:path}", self._take, methods=["GET", "POST"])])

    async def _take(self, request: Request) -> Response:
        note: dict[str, Any] = {"headers": dict(request.headers), "query": dict(request.query_params)}
        self.requests.append(note)
        kind, body = request.headers.get("content-type", ""), await request.body()
        if self.refuse:
            return self.refuse.pop(0)
        if kind.startswith("multipart"):
            form = await request.form()
            sent = [(key, one) for key, one in form.multi_items() if isinstance(one, UploadFile)]
            keys = [key if not n else f"{key}-{n}" for n, (key, _) in enumerate(sent) if key == "photo"]
            keys += [key for key, _ in sent if key != "photo"]
            pairs = zip(keys, sent, strict=True)
            note["files"] = {key: (one.filename, await one.read()) for key, (_, one) in pairs}
            note["fields"] = {key: one for key, one in form.items() if isinstance(one, str)}
        elif kind == "application/json":
            note["json"] = json.loads(body)
        return self._answer(request.method, request.url.path.removeprefix("/v1/parts"), note)

    def _answer(self, method: str, path: str, note: dict[str, Any]) -> Response:
        if (method, path) == ("POST", ""):
            key = note["headers"]["idempotency-key"]
            status = 200 if key in self.made else 201
            self.made[key] = ID
            fields = note["fields"]
            return JSONResponse(
                to_json(part(fields.get("name", ""), expected=fields.get("expected", ""))) | LINKS, status
            )
        if path.startswith(f"/{ID}/pictures/"):
            return Response(b"\x89PNG " + path.rpartition("/")[2].encode(), media_type="image/png")
        reviewed = part(text="KX407252", state=PartState.REVIEWED)
        answers: dict[str, Any] = {
            "": [to_json(PART) | LINKS],
            **{f"/{ID}{way}": to_json(PART) | LINKS for way in ("", "/scan", "/touch")},
            f"/{ID}/review": to_json(reviewed) | LINKS,
            f"/{ID}/history": HISTORY,
        }
        return JSONResponse(answers[path]) if path in answers else problem(404, f"there is no part {path!r}")


def problem(status: int, detail: str, **headers: str) -> Response:
    body = {"type": "about:blank", "title": "Refused", "status": status, "detail": detail}
    return JSONResponse(body, status, {k.replace("_", "-"): v for k, v in headers.items()})


@pytest.fixture(scope="module")
def service() -> Iterator[tuple[Service, str]]:
    made = Service()
    with serving(made.app) as url:
        yield made, url


@pytest.fixture
def fresh(service: tuple[Service, str]) -> tuple[Service, str]:
    service[0].requests.clear()
    service[0].refuse.clear()
    return service


@pytest.fixture
def photo(tmp_path: Path) -> Path:
    path = tmp_path / "part-ä.png"
    path.write_bytes(b"a photograph")
    return path


def test_a_part_is_read_from_files(fresh: tuple[Service, str], photo: Path, tmp_path: Path) -> None:
    service, url = fresh
    scan = tmp_path / "part.h5"
    scan.write_bytes(b"a scan")
    with Client(url, token="tm_secret") as client:
        made = client.read(
            photo=photo, scan=str(scan), name="P17", expected="KX407251", job="housing-left", touch="stage"
        )
    assert made == part("P17", expected="KX407251")
    (request,) = service.requests
    assert request["files"] == {"photo": ("part-ä.png", b"a photograph"), "scan": ("part.h5", b"a scan")}
    fields = {"name": "P17", "expected": "KX407251", "job": "housing-left", "touch": "stage"}
    assert request["fields"] == fields
    assert request["headers"]["authorization"] == "Bearer tm_secret"
    assert len(request["headers"]["idempotency-key"]) >= 32


def test_several_photographs_are_sent_as_one_part_and_bytes_without_a_token(
    fresh: tuple[Service, str], photo: Path
) -> None:
    service, url = fresh
    with Client(url) as client:
        client.read(photo=[photo, b"another lamp"], database="plant", idempotency_key="mine-1")
    (request,) = service.requests
    photos = {"photo": ("part-ä.png", b"a photograph"), "photo-1": ("photo", b"another lamp")}
    assert (request["files"], request["fields"]) == (photos, {"database": "plant", "touch": "asked"})
    assert request["headers"]["idempotency-key"] == "mine-1"
    assert "authorization" not in request["headers"]


def test_every_call_gives_records(fresh: tuple[Service, str], photo: Path) -> None:
    service, url = fresh
    with Client(url) as client:
        assert client.part(ID) == PART
        assert client.add_scan(ID, photo) == PART
        assert client.touch(ID) == PART
        assert client.read(photo, expected="KX407251").expected == "KX407251"
        assert client.parts(state=PartState.ACCEPTED, text="KX", before=ID, limit=7) == (PART,)
        assert client.picture(ID, "edges") == b"\x89PNG edges"
        reviewed = client.review(
            ID, action=ReviewAction.CORRECT, text="KX407252", who="Anna", before="KX407251"
        )
        assert (reviewed.text, reviewed.state) == ("KX407252", PartState.REVIEWED)
        history = client.history(ID)
    assert history.events[0].data == {"bytes": 7}
    assert history.readings == (reading(),)
    assert history.reviews[0].who == "Anna"
    assert history.evidence[0].kind is EvidenceKind.PHOTO
    assert service.requests[4]["query"] == {"state": "accepted", "text": "KX", "before": ID, "limit": "7"}
    assert service.requests[6]["json"] == {
        "action": "correct",
        "text": "KX407252",
        "who": "Anna",
        "note": "",
        "before": "KX407251",
    }


def test_a_refusal_says_why(fresh: tuple[Service, str], photo: Path) -> None:
    service, url = fresh
    with Client(url) as client:
        with pytest.raises(ServiceError, match="404: there is no part") as caught:
            client.part("01KB0000000000000000000099")
        assert caught.value.status == 404
        assert caught.value.problem["title"] == "Refused"
        for answer, words in (
            (problem(401, "a token is needed"), "401: a token is needed"),
            (problem(422, "photo.png: is damaged"), "422: photo.png: is damaged"),
            (Response("<html>", 413), "413: Request Entity Too Large"),
            (JSONResponse([1], 400), "400: Bad Request"),
            (
                Response(status_code=308, headers={"location": "https://x/"}),
                "308: the service has moved to https://x/",
            ),
            (Response("<html>hello", 200), "not understood"),
            (JSONResponse({"hello": 1}, 200), "not understood"),
        ):
            service.refuse.append(answer)
            with pytest.raises(ServiceError, match=words):
                client.read(photo)
    assert len(service.requests) == 8  # nothing of this is tried again


def test_what_cannot_be_sent_is_said_before(fresh: tuple[Service, str], tmp_path: Path) -> None:
    service, url = fresh
    with Client(url) as client:
        with pytest.raises(ValueError, match="photograph"):
            client.read()
        with pytest.raises(FileNotFoundError):
            client.read(tmp_path / "none.png")
        for wrong in ("", "../tokens", "a/b", "a?b", "ä"):
            with pytest.raises(ServiceError, match="not a part's id"):
                client.part(wrong)
    assert not service.requests


def test_a_busy_service_is_asked_again_after_the_time_it_tells(
    fresh: tuple[Service, str], photo: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    service, url = fresh
    slept: list[float] = []
    monkeypatch.setattr(time, "sleep", slept.append)
    busy = problem(503, "as many parts wait as may", retry_after="3")
    service.refuse = [busy, busy, Response(status_code=502)]
    with Client(url) as client:
        client.read(photo)
        keys = {request["headers"]["idempotency-key"] for request in service.requests}
        assert len(keys) == 1
        assert len(service.requests) == 4
        assert service.requests[-1]["files"]["photo"][1] == b"a photograph"  # from its beginning again
        slept_for_read = list(slept)
        # what is done once only is asked again where it was refused, not where nobody knows
        service.refuse = [busy]
        client.touch(ID)
        service.refuse = [Response(status_code=502)]
        with pytest.raises(ServiceError, match="502"):
            client.touch(ID)
    assert len(slept_for_read) == 3
    assert all(3.0 <= s <= 3.75 for s in slept_for_read[:2])  # as told, and up to a quarter more
    assert 1.0 <= slept_for_read[2] <= 1.25


def test_patience_has_an_end(fresh: tuple[Service, str], photo: Path) -> None:
    service, url = fresh
    service.refuse = [problem(503, "as many parts wait as may", retry_after="100")] * 3
    begun = time.monotonic()
    with Client(url, patience_s=5.0) as client, pytest.raises(ServiceError, match="503: as many parts wait"):
        client.read(photo)
    assert time.monotonic() - begun < 5.0  # it would not be over in time, so it is not waited for
    assert len(service.requests) == 1
    with Client(f"http://127.0.0.1:{free_port()}", patience_s=0.0) as client:
        with pytest.raises(ServiceError, match="not reached") as caught:
            client.part(ID)
        assert caught.value.status == 0


@contextlib.contextmanager
def losing(target: str, losses: Callable[[int], bool]) -> Iterator[str]:
    """A door before the service that loses answers: the request arrives, its answer does not."""
    port = int(target.rsplit(":", 1)[1])
    door = socket.create_server(("127.0.0.1", 0))
    count = 0

    def pump(source: socket.socket, sink: socket.socket) -> None:
        with contextlib.suppress(OSError):
            while data := source.recv(65536):
                sink.sendall(data)
        with contextlib.suppress(OSError):
            sink.shutdown(socket.SHUT_WR)

    def serve() -> None:
        nonlocal count
        while True:
            try:
                caller, _ = door.accept()
            except OSError:
                return
            count += 1
            inside = socket.create_connection(("127.0.0.1", port))
            threading.Thread(target=pump, args=(caller, inside), daemon=True).start()
            if losses(count):
                inside.recv(1)  # the service has answered
                caller.shutdown(socket.SHUT_RDWR)
                caller.close()
            else:
                threading.Thread(target=pump, args=(inside, caller), daemon=True).start()

    threading.Thread(target=serve, daemon=True).start()
    try:
        yield f"http://127.0.0.1:{door.getsockname()[1]}"
    finally:
        door.close()


def test_a_lost_answer_makes_no_second_part(fresh: tuple[Service, str], photo: Path) -> None:
    service, url = fresh
    service.made.clear()
    with losing(url, lambda count: count <= 2) as door, Client(door) as client:
        assert client.read(photo, name="P17") == part("P17")
    assert len(service.requests) == 3
    assert len(service.made) == 1


def test_what_is_done_once_only_is_not_sent_again_when_its_answer_is_lost(fresh: tuple[Service, str]) -> None:
    service, url = fresh
    with losing(url, lambda count: count == 1) as door, Client(door) as client:
        with pytest.raises(ServiceError, match="not reached"):
            client.review(ID, action=ReviewAction.CONFIRM, text="KX407251", who="Anna")
        assert len(service.requests) == 1
        assert client.part(ID) == PART  # and it goes on


def test_a_service_that_is_started_anew_is_waited_for(photo: Path) -> None:
    port = free_port()
    door = f"http://127.0.0.1:{port}"
    made: list[Any] = []

    def ask() -> None:
        with Client(door, patience_s=20.0) as client:
            made.append(client.read(photo))
            made.append(client.touch(ID))

    asking = threading.Thread(target=ask)
    asking.start()
    time.sleep(0.3)
    server = uvicorn.Server(uvicorn.Config(Service().app, host="127.0.0.1", port=port, log_level="error"))
    running = threading.Thread(target=server.run)
    running.start()
    asking.join(30.0)
    server.should_exit = True
    running.join(10.0)
    assert len(made) == 2


def test_neither_redirects_nor_proxies_get_the_token(
    fresh: tuple[Service, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    service, url = fresh
    monkeypatch.setenv("HTTP_PROXY", f"http://127.0.0.1:{free_port()}")
    monkeypatch.delenv("NO_PROXY", raising=False)
    service.refuse.append(Response(status_code=307, headers={"location": f"{url}/v1/parts/{ID}"}))
    with Client(url, token="tm_secret") as client:
        with pytest.raises(ServiceError, match="moved"):
            client.part(ID)
        assert len(service.requests) == 1
        assert client.part(ID) == PART


def test_threads_may_share_a_client(fresh: tuple[Service, str]) -> None:
    _, url = fresh
    made: list[Any] = []
    with Client(url) as client:
        threads = [
            threading.Thread(target=lambda n=n: made.append(client.read(b"x", name=f"P{n}")))  # type: ignore[misc]
            for n in range(8)
        ]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(30.0)
    assert sorted(record.name for record in made) == [f"P{n}" for n in range(8)]


def test_a_missing_library_is_named_with_its_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    import importlib
    import sys

    from glyphs.errors import MissingExtraError
    from pipeline.service.inputs import opcua_device
    from pipeline.service.outputs.mqtt import MqttSender
    from pipeline.service.settings import MqttSettings

    for module, extra, make in (
        ("httpx", "service", lambda: Client("http://127.0.0.1")),
        ("paho.mqtt.client", "mqtt", lambda: MqttSender(MqttSettings(url="mqtt://127.0.0.1"))),
        ("asyncua", "opcua", lambda: importlib.reload(opcua_device)),
    ):
        with monkeypatch.context() as without:
            without.setitem(sys.modules, module, None)
            with pytest.raises(MissingExtraError, match=rf"pip install 'tactile-marks\[{extra}\]'"):
                make()
