"""The Python client, against a real web server and the service's own interface."""

from __future__ import annotations

import contextlib
import socket
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest
import uvicorn
from starlette.responses import JSONResponse, Response

from pipeline.common.part_id import new_part_id
from pipeline.common.records import EvidenceKind, PartRecord, PartState, ReviewAction
from pipeline.common.settings import ReadSettings
from pipeline.reading.part_job import RECORDING, PartJob
from pipeline.reading.part_pictures import Picture
from pipeline.reading.triage import ReadPart
from pipeline.service.app import Service
from pipeline.service.client import Client, ServiceError
from tests.support.line_fakes import reading, serving
from tests.support.service_fixtures import inline_service
from tests.support.store_samples import PLAN
from tests.support.waiting import free_port

READ = reading()
EDGES = Picture(EvidenceKind.EDGES_PICTURE, "edges.png", b"\x89PNG edges", "image/png", {})


def read(job: PartJob, *_: object) -> ReadPart:
    """A reading, whatever the files hold; one named so is unsure until it is felt."""
    if job.files.name == "unsure" and not job.earlier:
        return ReadPart((replace(READ, source="vision", decision="review"),), plan=PLAN)
    (job.folder / RECORDING).write_bytes(b"felt")
    return ReadPart((READ,), (EDGES,))


class Door:
    """Before a service; notes the heads of requests, and answers with `refuse` instead, once each."""

    def __init__(self, app: Any) -> None:
        self._app = app
        self.heads: list[dict[str, str]] = []
        self.refuse: list[Response] = []

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        self.heads.append({key.decode(): value.decode() for key, value in scope["headers"]})
        if not self.refuse:
            return await self._app(scope, receive, send)
        while (await receive()).get("more_body"):
            pass
        return await self.refuse.pop(0)(scope, receive, send)


@dataclass(frozen=True)
class Doors:
    """A service that is called through a door."""

    service: Service
    door: Door
    url: str

    @property
    def made(self) -> tuple[PartRecord, ...]:
        """Parts of the service, newest first."""
        return self.service.store.parts()


def problem(status: int, detail: str, **headers: str) -> Response:
    body = {"type": "about:blank", "title": "Refused", "status": status, "detail": detail}
    return JSONResponse(body, status, {k.replace("_", "-"): v for k, v in headers.items()})


@pytest.fixture(scope="module")
def opened(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Doors]:
    folder = tmp_path_factory.mktemp("service")
    settings = {"stage": {"device": folder}, "reading": ReadSettings()}
    with inline_service(folder / "s", instead=read, **settings) as (service, client):
        door = Door(client.app)
        with serving(door) as url:
            yield Doors(service, door, url)


@pytest.fixture
def doors(opened: Doors) -> Doors:
    opened.door.heads.clear()
    opened.door.refuse.clear()
    return opened


@pytest.fixture
def photo(tmp_path: Path) -> Path:
    path = tmp_path / "part-ä.png"
    path.write_bytes(b"\x89PNG\r\n\x1a\n a photograph")
    return path


def test_a_part_is_read_from_files(doors: Doors, photo: Path, tmp_path: Path) -> None:
    (tmp_path / "jobs").mkdir()
    doors.service.jobs.save("housing-left", {"format": "AA999999"})
    scan = tmp_path / "part.h5"
    scan.write_bytes(b"\x89HDF\r\n\x1a\n a scan")
    with Client(doors.url, token="tm_secret") as client:
        made = client.read(
            photo=photo, scan=str(scan), name="P17", expected="KX407251", job="housing-left", touch="stage"
        )
        assert client.part(made.id) == made == doors.made[0]
        assert client.parts(state=PartState.ACCEPTED, text="KX", name="P17", limit=7) == (made,)
        assert client.parts(before=made.id, name="P17") == ()
        assert client.picture(made.id, "edges") == EDGES.content
    assert (made.name, made.expected, made.job, made.text) == ("P17", "KX407251", "housing-left", READ.text)
    photographed, scanned, _ = doors.service.store.evidence(made.id)
    assert (photographed.kind, photographed.name) == (EvidenceKind.PHOTO, "part-ä.png")
    assert (scanned.kind, scanned.name) == (EvidenceKind.SCAN, "part.h5")
    assert doors.door.heads[0]["authorization"] == "Bearer tm_secret"
    assert len(doors.door.heads[0]["idempotency-key"]) >= 32


def test_several_photographs_are_sent_as_one_part_and_bytes_without_a_token(
    doors: Doors, photo: Path
) -> None:
    with Client(doors.url) as client:
        made = client.read(photo=[photo, photo.read_bytes()], idempotency_key="mine-1")
    names = [kept.name for kept in doors.service.store.evidence(made.id) if kept.kind is EvidenceKind.PHOTO]
    assert names == ["part-ä.png", "photo"]
    (head,) = doors.door.heads
    assert (head["idempotency-key"], "authorization" in head) == ("mine-1", False)


def test_a_part_is_felt_scanned_and_reviewed(doors: Doors, photo: Path) -> None:
    with Client(doors.url) as client:
        assert client.read(photo, name="unsure").state is PartState.TOUCH_NEEDED
        felt = client.touch(doors.made[0].id)
        assert (felt.state, felt.text) == (PartState.ACCEPTED, READ.text)
        assert client.add_scan(felt.id, b"\x89HDF\r\n\x1a\n a scan").text == READ.text
        said = {"action": ReviewAction.CORRECT, "text": "KX407252", "who": "Anna", "note": "worn"}
        reviewed = client.review(felt.id, before=READ.text, **said)
        assert (reviewed.text, reviewed.state) == ("KX407252", PartState.REVIEWED)
        with pytest.raises(ServiceError, match="409: "):
            client.review(felt.id, before=READ.text, **said)
        history = client.history(felt.id)
    assert [one.source for one in history.readings] == ["vision", "fused", "fused"]
    assert (history.reviews[0].who, history.reviews[0].note) == ("Anna", "worn")


def test_a_refusal_says_why(doors: Doors, photo: Path) -> None:
    door, url = doors.door, doors.url
    with Client(url) as client:
        with pytest.raises(ServiceError, match="404: there is no part") as caught:
            client.part("01KB0000000000000000000099")
        assert caught.value.status == 404
        assert caught.value.problem["title"] == "Not Found"
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
            door.refuse.append(answer)
            with pytest.raises(ServiceError, match=words):
                client.read(photo)
    assert len(door.heads) == 8  # nothing of this is tried again


def test_what_cannot_be_sent_is_said_before(doors: Doors, tmp_path: Path) -> None:
    door, url = doors.door, doors.url
    with Client(url) as client:
        with pytest.raises(ValueError, match="photograph"):
            client.read()
        with pytest.raises(FileNotFoundError):
            client.read(tmp_path / "none.png")
        for wrong in ("", "../tokens", "a/b", "a?b", "ä"):
            with pytest.raises(ServiceError, match="not a part's id"):
                client.part(wrong)
    assert not door.heads


def test_a_busy_service_is_asked_again_after_the_time_it_tells(
    doors: Doors, photo: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    door, url = doors.door, doors.url
    slept: list[float] = []
    monkeypatch.setattr(time, "sleep", slept.append)
    busy = problem(503, "as many parts wait as may", retry_after="3")
    door.refuse = [busy, busy, Response(status_code=502)]
    with Client(url) as client:
        client.read(photo)
        assert len({head["idempotency-key"] for head in door.heads}) == 1
        assert len(door.heads) == 4
        slept_for_read = list(slept)
        # what is done once only is asked again where it was refused, not where nobody knows
        unsure = client.read(photo, name="unsure")
        door.refuse = [busy]
        client.touch(unsure.id)
        door.refuse = [Response(status_code=502)]
        with pytest.raises(ServiceError, match="502"):
            client.touch(unsure.id)
    assert len(slept_for_read) == 3
    assert all(3.0 <= s <= 3.75 for s in slept_for_read[:2])  # as told, and up to a quarter more
    assert 1.0 <= slept_for_read[2] <= 1.25


def test_patience_has_an_end(doors: Doors, photo: Path) -> None:
    door, url = doors.door, doors.url
    door.refuse = [problem(503, "as many parts wait as may", retry_after="100")] * 3
    begun = time.monotonic()
    with Client(url, patience_s=5.0) as client, pytest.raises(ServiceError, match="503: as many parts wait"):
        client.read(photo)
    assert time.monotonic() - begun < 5.0  # it would not be over in time, so it is not waited for
    assert len(door.heads) == 1
    with Client(f"http://127.0.0.1:{free_port()}", patience_s=0.0) as client:
        with pytest.raises(ServiceError, match="not reached") as caught:
            client.part(new_part_id())
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


def test_a_lost_answer_makes_no_second_part(doors: Doors, photo: Path) -> None:
    before = len(doors.made)
    with losing(doors.url, lambda count: count <= 2) as lost, Client(lost) as client:
        assert client.read(photo, name="P17").text == READ.text
    assert len(doors.door.heads) == 3
    assert len(doors.made) == before + 1


def test_what_is_done_once_only_is_not_sent_again_when_its_answer_is_lost(doors: Doors, photo: Path) -> None:
    with Client(doors.url) as client:
        part = client.read(photo)
    with losing(doors.url, lambda count: count == 1) as lost, Client(lost) as client:
        with pytest.raises(ServiceError, match="not reached"):
            client.review(part.id, action=ReviewAction.CONFIRM, text=part.text, who="Anna")
        assert len(doors.door.heads) == 2
        assert client.part(part.id).state is PartState.REVIEWED  # and it goes on


def test_a_service_that_is_started_anew_is_waited_for(doors: Doors, photo: Path) -> None:
    port = free_port()
    made: list[Any] = []

    def ask() -> None:
        with Client(f"http://127.0.0.1:{port}", patience_s=20.0) as client:
            made.append(client.read(photo))

    asking = threading.Thread(target=ask)
    asking.start()
    time.sleep(0.3)
    server = uvicorn.Server(
        uvicorn.Config(doors.door, host="127.0.0.1", port=port, log_level="error", lifespan="off")
    )
    running = threading.Thread(target=server.run)
    running.start()
    asking.join(30.0)
    server.should_exit = True
    running.join(10.0)
    assert len(made) == 1


def test_neither_redirects_nor_proxies_get_the_token(doors: Doors, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HTTP_PROXY", f"http://127.0.0.1:{free_port()}")
    monkeypatch.delenv("NO_PROXY", raising=False)
    doors.door.refuse.append(Response(status_code=307, headers={"location": f"{doors.url}/v1/parts"}))
    with Client(doors.url, token="tm_secret") as client:
        with pytest.raises(ServiceError, match="moved"):
            client.parts()
        assert len(doors.door.heads) == 1
        client.parts()


def test_threads_may_share_a_client(doors: Doors, photo: Path) -> None:
    with Client(doors.url) as client, ThreadPoolExecutor(8) as pool:
        made = list(pool.map(lambda n: client.read(photo, name=f"P{n}").name, range(8)))
    assert made == [f"P{n}" for n in range(8)]


def test_a_missing_library_is_named_with_its_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    import importlib
    import sys

    from glyphs.errors import MissingExtraError
    from pipeline.service.inputs import opcua_server
    from pipeline.service.outputs.mqtt import MqttSender
    from pipeline.service.settings import MqttSettings

    for module, extra, make in (
        ("httpx", "service", lambda: Client("http://127.0.0.1")),
        ("paho.mqtt.client", "mqtt", lambda: MqttSender(MqttSettings(url="mqtt://127.0.0.1"))),
        ("asyncua", "opcua", lambda: importlib.reload(opcua_server)),
    ):
        with monkeypatch.context() as without:
            without.setitem(sys.modules, module, None)
            with pytest.raises(MissingExtraError, match=rf"pip install 'tactile-marks\[{extra}\]'"):
                make()
