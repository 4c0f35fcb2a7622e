"""Who is let in, and how little a request may cost that is not."""

from __future__ import annotations

import asyncio
import contextlib
import ipaddress
import ssl
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import uvicorn
from starlette.testclient import TestClient

from pipeline.cli.exit_status import CommandError
from pipeline.cli.serve import listening, tls_context
from pipeline.common.records import PartState, Scope
from pipeline.service.settings import ServiceSettings, TlsSettings
from pipeline.service.web import door
from pipeline.service.web import web_server as web_server_module
from pipeline.service.web.access import COOKIE, is_in
from pipeline.service.web.door import SMALL_BODY
from pipeline.service.web.web_server import Room, patient_protocol
from pipeline.store.store import Store
from tests.support.line_broker import certificates
from tests.support.service_fixtures import Served, inline_service
from tests.support.store_samples import received

pytestmark = pytest.mark.anyio


FORWARDED = {
    "X-Forwarded-For": "203.0.113.9",
    "X-Forwarded-Proto": "https",
    "X-Forwarded-Host": "marks.example",
    "X-Real-IP": "203.0.113.9",
    "Forwarded": "for=203.0.113.9",
    "Via": "1.1 proxy",
}


class Body:
    """A body that tells whether anybody has read it."""

    def __init__(self, n: int) -> None:
        self.n, self.read = n, 0

    def __iter__(self) -> Iterator[bytes]:
        for _ in range(self.n):
            self.read += 1
            yield b"x" * 1000


async def asked(
    app: Any, method: str, path: str, body: Body, *, gone: bool = False, **headers: str
) -> tuple[int, bytes]:
    """Status (0: none) and body of the answer of an ASGI application; the request's body comes piece by piece.

    After its last piece the caller is there, or `gone` though more was to come.
    """
    pieces, sent = iter(body), []

    async def receive() -> dict[str, Any]:
        piece = next(pieces, None)
        if piece is None and gone:
            return {"type": "http.disconnect"}
        return {"type": "http.request", "body": piece or b"", "more_body": piece is not None}

    async def send(message: dict[str, Any]) -> None:
        sent.append(message)

    named = {"host": "127.0.0.1:8417", **{key.replace("_", "-"): value for key, value in headers.items()}}
    scope = {
        "type": "http", "method": method, "path": path, "raw_path": path.encode(), "query_string": b"",
        "headers": [(key.encode(), value.encode()) for key, value in named.items()],
        "client": ("testclient", 50000), "server": ("127.0.0.1", 8417), "scheme": "http", "http_version": "1.1",
        "root_path": "", "asgi": {"version": "3.0"},
    }  # fmt: skip
    await app(scope, receive, send)
    return sent[0]["status"] if sent else 0, b"".join(message.get("body", b"") for message in sent[1:])


@pytest.fixture(scope="module")
def guarded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """A service that asks for tokens."""
    with inline_service(tmp_path_factory.mktemp("guarded"), tokens="on") as both:
        yield both


@pytest.fixture(scope="module")
def open_one(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """A service that asks for none."""
    with inline_service(tmp_path_factory.mktemp("open")) as both:
        yield both


@pytest.fixture(scope="module")
def named(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """A service under host names of a plant."""
    with inline_service(
        tmp_path_factory.mktemp("named"), hosts=("marks.plant.example", "*.plant.example")
    ) as both:
        yield both


@pytest.mark.parametrize("kind", ["application/json", "multipart/form-data; boundary=x", "text/plain"])
@pytest.mark.parametrize(
    ("path", "status"),
    [
        ("/v1/parts", 401),
        ("/v1/parts/X/review", 401),
        ("/v1/jobs/X", 401),
        ("/jobs/new", 303),
        ("/review/X", 303),
    ],
)
def test_no_byte_of_a_body_is_read_without_a_token(
    guarded: Served, path: str, status: int, kind: str
) -> None:
    body = Body(10)
    made = asyncio.run(
        asked(guarded[1].app, "POST", path, body, content_type=kind, authorization="Bearer tm_no")
    )
    assert (made[0], body.read) == (status, 0)


@pytest.mark.parametrize(
    "path", ["/v1/parts/X/review", "/v1/parts/X/touch", "/jobs/new", "/review/X", "/login"]
)
@pytest.mark.parametrize("length", ["", "10000000"])
def test_what_brings_no_files_may_bring_little(open_one: Served, path: str, length: str) -> None:
    body = Body(10_000)
    said = {"content_length": length} if length else {}
    kind = "application/json" if path.startswith("/v1") else "application/x-www-form-urlencoded"
    status, _ = asyncio.run(asked(open_one[1].app, "POST", path, body, content_type=kind, **said))
    assert status in (404, 413) if path.endswith("touch") else status == 413
    assert body.read <= SMALL_BODY // 1000 + 2


@pytest.mark.parametrize(
    ("host", "status"),
    [
        ("127.0.0.1:8417", 200),
        ("LOCALHOST", 200),
        ("[::1]:8417", 200),
        ("marks.plant.example", 200),
        ("line-3.plant.example:80", 200),
        ("reader-pc:8417", 400),
        ("plant.example.evil.example", 400),
        ("127.0.0.1.evil.example", 400),
        ("evil\u202e", 400),
        ("", 400),
    ],
)
def test_a_host_name_that_is_not_in_the_settings_is_refused_by_the_setting_s_name(
    named: Served, host: str, status: int, caplog: pytest.LogCaptureFixture
) -> None:
    answers = [named[1].get(path, headers={"Host": host.encode()}) for path in ("/healthz", "/readyz")]
    assert [answer.status_code for answer in answers] == [status, status]
    for answer in answers if status == 400 else ():
        assert answer.headers["content-type"] == "application/problem+json"
        assert "in the setting hosts" in answer.json()["detail"]
    assert caplog.text.count("is for the host name") == (status == 400)


def test_a_request_of_two_lengths_is_refused_and_its_connection_closed(open_one: Served) -> None:
    both = {"content_length": "1", "transfer_encoding": "chunked"}
    status, _ = asyncio.run(asked(open_one[1].app, "POST", "/v1/parts", Body(1), **both))
    assert status == 400
    refused = open_one[1].post("/v1/parts", content=b"x", headers={"Transfer-Encoding": "chunked"})
    assert (refused.status_code, refused.headers["connection"]) == (400, "close")


def test_the_metrics_are_not_for_everybody_beyond_a_proxy(tmp_path: Path) -> None:
    with inline_service(tmp_path, tokens="on", root_path="/marks") as (service, client):
        known = {"Authorization": f"Bearer {service.store.add_token('anna', [Scope.READ])}"}
        for path in ("/metrics", "/marks/metrics"):
            assert client.get(path).status_code == 200
            assert (
                client.get(path, headers=FORWARDED, follow_redirects=False).status_code == 303
            )  # to sign in
            assert client.get(path, headers={**FORWARDED, **known}).status_code == 200


@pytest.mark.parametrize("name", FORWARDED)
def test_a_proxy_nobody_has_named_does_not_let_the_world_in(
    open_one: Served, guarded: Served, name: str
) -> None:
    through = {name: FORWARDED[name]}
    refused = open_one[1].get("/v1/parts", headers=through)
    assert refused.status_code == 403
    assert "trusted_proxies" in refused.json()["detail"]
    assert open_one[1].get("/review", headers=through).status_code == 403
    # where tokens are asked for, the token decides
    assert guarded[1].get("/v1/parts", headers=through).status_code == 401


def test_a_trusted_proxy_says_where_its_callers_come_from_and_how(tmp_path: Path) -> None:
    with inline_service(tmp_path, tokens="on", trusted_proxies=("127.0.0.0/8",)) as (service, client):
        secret = service.store.add_token("anna", [Scope.READ])
        client = TestClient(client.app, base_url="http://127.0.0.1:8417", client=("127.0.0.9", 1))
        for scheme, secure in (("https", True), ("http", False)):
            headers = {"X-Forwarded-For": "203.0.113.9", "X-Forwarded-Proto": scheme}
            signed = client.post("/login", data={"secret": secret}, headers=headers, follow_redirects=False)
            (cookie,) = (c for c in signed.headers.get_list("set-cookie") if "token" in c.split("=")[0])
            assert ("Secure" in cookie) == secure
            assert "HttpOnly" in cookie
            assert secret not in cookie
    with inline_service(tmp_path / "open", trusted_proxies=("127.0.0.1",)) as (_, client):
        trusted = TestClient(client.app, base_url="http://127.0.0.1:8417", client=("127.0.0.1", 1))
        assert trusted.get("/v1/parts", headers=FORWARDED).status_code == 200
        other = TestClient(client.app, base_url="http://127.0.0.1:8417", client=("127.0.0.2", 1))
        assert other.get("/v1/parts", headers=FORWARDED).status_code == 403


@pytest.mark.parametrize(
    ("said", "status"),
    [
        ({"Sec-Fetch-Site": "cross-site"}, 403),
        ({"Sec-Fetch-Site": "same-site", "Origin": "http://127.0.0.1:8417"}, 403),
        ({"Origin": "http://evil.example"}, 403),
        ({"Origin": "http://127.0.0.1:8417.evil.example"}, 403),
        ({"Origin": "http://["}, 403),
        ({"Origin": "null"}, 403),
        ({"Origin": ""}, 403),
        # a proxy may call the service by another name than the browser calls the proxy
        ({"Sec-Fetch-Site": "same-origin", "Origin": "https://marks.example"}, 303),
        ({"Origin": "http://127.0.0.1:8417"}, 303),
        ({}, 303),  # no browser
    ],
)
def test_a_form_of_another_site_changes_nothing(open_one: Served, said: dict[str, str], status: int) -> None:
    service, client = open_one
    part = received(service.store, PartState.REVIEW)
    form = {"action": "unreadable", "who": "Eve", "before": part.text}
    answer = client.post(f"/review/{part.id}", data=form, headers=said, follow_redirects=False)
    assert answer.status_code == status
    assert len(service.store.story(part.id).reviews) == (status == 303)


def test_made_up_methods_are_counted_as_one(open_one: Served) -> None:
    for k in range(20):
        open_one[1].request(f"MADEUP{k}", "/healthz")
    page = open_one[1].get("/metrics").text
    assert "MADEUP" not in page
    assert 'method="other"' in page


def signed_in(client: TestClient, secret: str) -> str:
    """Sign in by the page; the cookie's value."""
    answer = client.post("/login", data={"secret": secret}, follow_redirects=False)
    assert answer.status_code == 303
    return str(client.cookies[COOKIE])


def status_with(client: TestClient, cookie: str) -> int:
    other = TestClient(client.app, base_url="http://127.0.0.1:8417", cookies={COOKIE: cookie})
    return other.get("/v1/parts").status_code


def test_a_copied_cookie_ends_when_its_owner_signs_out_and_with_the_token(guarded: Served) -> None:
    service, client = guarded
    secret = service.store.add_token("otto", [Scope.READ])
    cookie, other = (
        signed_in(client, secret),
        signed_in(TestClient(client.app, base_url=client.base_url), secret),
    )
    assert secret not in (cookie, other)
    assert [status_with(client, value) for value in (cookie, other)] == [200, 200]
    client.post("/logout", follow_redirects=False)
    assert [status_with(client, value) for value in (cookie, other)] == [401, 200]
    for wrong in (cookie[:-2] + "zz", "otto", secret, "x" * 5_000):
        assert status_with(client, wrong) == 401
    service.store.revoke("otto")
    assert status_with(client, other) == 401


def test_a_session_ends_after_a_shift(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = Store.open(f"sqlite:///{tmp_path}/store.db")
    cookie = store.open_session(store.add_token("anna", [Scope.READ]))
    assert cookie is not None
    assert store.open_session("tm_wrong") is None
    found = store.session_token(cookie)
    assert found is not None
    assert found.name == "anna"
    monkeypatch.setattr("pipeline.store.access.SIGNED_IN_S", 0)
    assert store.session_token(cookie) is None
    store.close()


@pytest.mark.parametrize(
    ("address", "inside"),
    [("10.1.2.3", True), ("::ffff:10.1.2.3", True), ("11.1.2.3", False), ("::1", False), ("unix", False)],
)
def test_an_address_is_in_its_networks_however_it_is_written(address: str, inside: bool) -> None:
    assert is_in(address, (ipaddress.ip_network("10.0.0.0/8"),)) is inside


async def test_app(scope: Any, receive: Any, send: Any) -> None:
    """Answers everything, after it has read it; at /refused at once."""
    if scope["type"] == "lifespan":
        return
    if scope["path"] == "/large":
        await send({"type": "http.response.start", "status": 200, "headers": []})
        for _ in range(100):
            await send({"type": "http.response.body", "body": b"x" * 1_000_000, "more_body": True})
        await send({"type": "http.response.body", "body": b""})
        return
    if scope["path"] == "/refused":
        closing = [(b"content-length", b"2"), (b"connection", b"close")]
        await send({"type": "http.response.start", "status": 401, "headers": closing})
        await send({"type": "http.response.body", "body": b"no"})
        return
    while (await receive()).get("more_body"):
        pass
    await send({"type": "http.response.start", "status": 200, "headers": [(b"content-length", b"2")]})
    await send({"type": "http.response.body", "body": b"ok"})


test_app.__test__ = False  # type: ignore[attr-defined]


@contextlib.asynccontextmanager
async def web_server(tls: tuple[Path, Path] | None = None, **limits: Any) -> Any:
    """Port of a web server of `test_app`."""
    times = {name: limits.pop(name) for name in ("head_s", "write_s") if name in limits}
    certificate, key = tls or (None, None)
    context = tls_context(ServiceSettings(tls=TlsSettings(certificate=certificate, key=key)))
    bound = listening("127.0.0.1", 0, option="--port")
    protocol = patient_protocol(Room(**{"an_address": 100, **limits}), tls=context, **times)
    server = uvicorn.Server(uvicorn.Config(test_app, http=protocol, lifespan="off", log_config=None))
    server.capture_signals = contextlib.nullcontext  # type: ignore[method-assign,assignment]
    running = asyncio.create_task(server.serve(sockets=[bound]))
    while not server.started:
        await asyncio.sleep(0.01)
    try:
        yield bound.getsockname()[1]
    finally:
        server.should_exit = True
        await running


async def _closed(reader: asyncio.StreamReader) -> bool:
    with contextlib.suppress(OSError):
        return await asyncio.wait_for(reader.read(), 20.0) == b""
    return True


REFUSED = b"POST /refused HTTP/1.1\r\nHost: x\r\nContent-Length: 3000000\r\n\r\n"


async def test_who_is_refused_gets_the_answer_however_much_is_still_on_its_way() -> None:
    """As a proxy does, which sends the whole body before it reads."""

    async with web_server() as port:
        for _ in range(20):
            reader, writer = await asyncio.open_connection("127.0.0.1", port)
            writer.write(REFUSED)
            for _ in range(30):
                writer.write(b"x" * 100_000)
                await writer.drain()
            answer = await asyncio.wait_for(reader.read(), 20.0)
            assert answer.startswith(b"HTTP/1.1 401")
            assert answer.endswith(b"\r\n\r\nno")
            writer.close()


async def test_who_never_ends_what_is_refused_is_let_go(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(web_server_module, "LINGER_S", 0.2)

    async with web_server() as port:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(REFUSED)
        with contextlib.suppress(ConnectionError):
            for _ in range(2000):  # the server's end of it is a reset
                writer.write(b"x")
                await writer.drain()
                await asyncio.sleep(0.01)
        assert await asyncio.wait_for(_closed(reader), 20.0)
        assert writer.transport.is_closing()


async def test_who_says_nothing_or_too_little_is_let_go() -> None:
    async with web_server(head_s=0.2) as port:
        silent, _w1 = await asyncio.open_connection("127.0.0.1", port)
        slow, slow_writer = await asyncio.open_connection("127.0.0.1", port)
        good, good_writer = await asyncio.open_connection("127.0.0.1", port)

        async def drip() -> None:
            with contextlib.suppress(OSError):
                slow_writer.write(b"GET / HTTP/1.1\r\nHost: x\r\n")
                while True:
                    await asyncio.sleep(0.02)
                    slow_writer.write(b"a: b\r\n")

        dripping = asyncio.create_task(drip())
        good_writer.write(b"POST / HTTP/1.1\r\nHost: x\r\nContent-Length: 1\r\n\r\n")
        assert await _closed(silent)
        assert await _closed(slow)
        dripping.cancel()
        # the head was whole: its body may take longer, and the next request's head has its own time
        for _ in range(2):
            good_writer.write(b"x")
            assert (await good.readuntil(b"ok")).startswith(b"HTTP/1.1 200")
            await asyncio.sleep(0.3)
            good_writer.write(b"POST / HTTP/1.1\r\nHost: x\r\nContent-Length: 1\r\n\r\n")
        good_writer.close()


async def test_one_address_has_so_many_connections_and_gets_them_back() -> None:
    async with web_server(an_address=3, head_s=30.0) as port:
        held = [await asyncio.open_connection("127.0.0.1", port) for _ in range(3)]
        one_too_many, _ = await asyncio.open_connection("127.0.0.1", port)
        assert await _closed(one_too_many)
        held[0][1].close()
        await held[0][1].wait_closed()
        await asyncio.sleep(0.1)
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(b"GET / HTTP/1.1\r\nHost: x\r\n\r\n")
        assert (await reader.readuntil(b"ok")).startswith(b"HTTP/1.1 200")
    async with web_server(an_address=3, proxies=("127.0.0.1",)) as port:
        many = [await asyncio.open_connection("127.0.0.1", port) for _ in range(10)]
        many[-1][1].write(b"GET / HTTP/1.1\r\nHost: x\r\n\r\n")
        assert (await many[-1][0].readuntil(b"ok")).startswith(b"HTTP/1.1 200")
        for _, writer in many:
            writer.close()


async def test_if_the_server_is_full_the_busiest_caller_loses_its_longest_idle_connection() -> None:
    async with web_server(most=4, head_s=30.0) as port:
        busy = [await asyncio.open_connection("127.0.0.1", port) for _ in range(3)]
        quiet, quiet_writer = await asyncio.open_connection("127.0.0.1", port, local_addr=("127.0.0.2", 0))
        await asyncio.sleep(0.1)
        busy[0][1].write(b"GET / HTTP/1.1\r\n")  # the second one is now idle for longest
        await asyncio.sleep(0.1)
        other, other_writer = await asyncio.open_connection("127.0.0.1", port, local_addr=("127.0.0.3", 0))
        for reader, writer in ((other, other_writer), (quiet, quiet_writer)):
            writer.write(b"GET / HTTP/1.1\r\nHost: x\r\n\r\n")
            assert (await reader.readuntil(b"ok")).startswith(b"HTTP/1.1 200")
        assert await _closed(busy[1][0])
        busy[0][1].write(b"Host: x\r\n\r\n")
        assert (await busy[0][0].readuntil(b"ok")).startswith(b"HTTP/1.1 200")
        for _, writer in (*busy, (quiet, quiet_writer), (other, other_writer)):
            writer.close()


@pytest.mark.parametrize("over_tls", [False, True])
async def test_who_does_not_read_the_answers_is_let_go(tmp_path: Path, over_tls: bool) -> None:
    files = certificates(tmp_path, "service") if over_tls else None
    trusted = ssl.create_default_context(cafile=str(files[0])) if files else None
    async with web_server(files, write_s=0.3) as port:
        _, writer = await asyncio.open_connection("127.0.0.1", port, ssl=trusted, limit=1024)
        began_s = time.monotonic()
        with contextlib.suppress(ConnectionError):
            while time.monotonic() < began_s + 10.0:  # pipelined, and no answer is read
                writer.write(b"GET /large HTTP/1.1\r\nHost: x\r\n\r\n")
                await asyncio.wait_for(writer.drain(), 20.0)
                await asyncio.sleep(0.001)
        assert time.monotonic() < began_s + 9.0


async def test_a_handshake_that_does_not_end_is_ended_and_counts(tmp_path: Path) -> None:
    files = certificates(tmp_path, "service")
    async with web_server(files, head_s=0.3) as port:
        silent, _ = await asyncio.open_connection("127.0.0.1", port)
        rubbish, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(b"GET / HTTP/1.1\r\n\r\n")
        assert await _closed(silent)
        with contextlib.suppress(OSError):
            await asyncio.wait_for(rubbish.read(), 20.0)  # an alert of TLS, and the end
    async with web_server(files, an_address=1, head_s=30.0) as port:
        _, first = await asyncio.open_connection("127.0.0.1", port)
        await asyncio.sleep(0.1)
        second, _ = await asyncio.open_connection("127.0.0.1", port)
        assert await _closed(second)
        first.close()


async def test_what_is_not_http_is_answered_with_a_problem() -> None:
    async with web_server() as port:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(b"TRIGGER P17\r\n\r\n")
        answer = await asyncio.wait_for(reader.read(), 20.0)
        assert answer.startswith(b"HTTP/1.1 400")
        assert b"application/problem+json" in answer
        writer.close()


async def test_over_tls_it_answers_and_has_the_same_patience(tmp_path: Path) -> None:
    certificate, key = certificates(tmp_path, "service")

    async with web_server((certificate, key), an_address=10, head_s=0.5) as port:
        trusted = ssl.create_default_context(cafile=str(certificate))
        reader, writer = await asyncio.open_connection("127.0.0.1", port, ssl=trusted)
        writer.write(b"GET / HTTP/1.1\r\nHost: x\r\n\r\n")
        assert (await reader.readuntil(b"ok")).startswith(b"HTTP/1.1 200")
        silent, _ = await asyncio.open_connection("127.0.0.1", port, ssl=trusted)
        assert await _closed(silent)
        with pytest.raises(ssl.SSLCertVerificationError):
            await asyncio.open_connection("127.0.0.1", port, ssl=ssl.create_default_context())


def test_a_certificate_that_cannot_be_used_is_told_before_anything_begins(tmp_path: Path) -> None:
    from cryptography.hazmat.primitives import serialization

    certificate, key = certificates(tmp_path, "service")
    _, other = certificates(tmp_path, "other")
    locked = tmp_path / "locked.key"
    loaded = serialization.load_pem_private_key(key.read_bytes(), None)
    locked.write_bytes(
        loaded.private_bytes(
            serialization.Encoding.PEM,
            serialization.PrivateFormat.PKCS8,
            serialization.BestAvailableEncryption(b"secret"),
        )
    )
    (tmp_path / "rubbish.crt").write_text("no certificate")
    for cert, private, says in (
        (certificate, other, "cannot be used"),
        (certificate, locked, "password"),
        (certificate, None, "cannot be used"),
        (tmp_path / "rubbish.crt", key, "cannot be used"),
        (tmp_path / "none.crt", key, "No such file"),
        (None, key, "without tls.certificate"),
    ):
        settings = ServiceSettings(folder=tmp_path / "s", tls=TlsSettings(certificate=cert, key=private))
        with pytest.raises(CommandError, match=says):
            tls_context(settings)
    assert tls_context(ServiceSettings(tls=TlsSettings(certificate=certificate, key=key))) is not None
    assert tls_context(ServiceSettings()) is None


BROWSER = {"Accept": "text/html,application/xhtml+xml,application/xml;q=0.9,*/*;q=0.8"}


@pytest.mark.parametrize(
    ("path", "status", "says"),
    [
        ("/nowhere", 404, "there is nothing at /nowhere"),
        ("/v1/parts/X", 404, "there is no part"),
        ("/v1/parts?limit=0", 422, "limit"),
    ],
)
def test_a_browser_is_told_in_a_page_and_a_program_in_a_problem(
    open_one: Served, path: str, status: int, says: str
) -> None:
    page = open_one[1].get(path, headers=BROWSER)
    assert (page.status_code, page.headers["content-type"]) == (status, "text/html; charset=utf-8")
    assert says in page.text.lower()
    assert "To the queue" in page.text
    for accept in ("*/*", "application/json", "application/json, text/html"):
        problem = open_one[1].get(path, headers={"Accept": accept})
        assert (problem.status_code, problem.headers["content-type"]) == (status, "application/problem+json")
        assert says in problem.json()["detail"]
    through = {**BROWSER, "Via": "1.1 proxy"}
    assert "comes through a proxy" in open_one[1].get(path, headers=through).text


def test_an_upload_that_drips_has_an_end(open_one: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(door, "BODY_MOST_S", 0.05)
    head = b'--b\r\nContent-Disposition: form-data; name="photo"; filename="a.png"\r\n\r\n'

    class Dripping(Body):
        def __iter__(self) -> Iterator[bytes]:
            yield head
            while True:
                time.sleep(0.02)
                yield b"x"

    kind = "multipart/form-data; boundary=b"
    status, said = asyncio.run(asked(open_one[1].app, "POST", "/v1/parts", Dripping(0), content_type=kind))
    assert (status, b"took longer than" in said) == (408, True)


def test_a_caller_who_goes_during_an_upload_is_no_fault(
    open_one: Served, caplog: pytest.LogCaptureFixture, capsys: pytest.CaptureFixture[str]
) -> None:
    kind = "multipart/form-data; boundary=b"
    status, _ = asyncio.run(
        asked(open_one[1].app, "POST", "/v1/parts", Body(0), gone=True, content_type=kind)
    )
    logged = caplog.text + capsys.readouterr().out
    assert (status, "499" in logged, "Traceback" in logged) == (0, True, False)
