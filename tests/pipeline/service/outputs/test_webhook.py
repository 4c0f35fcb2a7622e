"""The webhook, posted to a real web server that answers well, badly, slowly or not at all."""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import Awaitable, Callable

import pytest
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import RedirectResponse, Response
from starlette.routing import Route

from pipeline.common.records import Delivery
from pipeline.common.settings import SettingsError
from pipeline.service.outputs.dispatch import DeliveryError, Pace
from pipeline.service.outputs.webhook import WebhookSender, signature
from pipeline.service.settings import WebhookSettings
from tests.support.line_fakes import serving
from tests.support.waiting import free_port

FAST = Pace(look_s=0.02, first_wait_s=0.02, longest_wait_s=0.1, longest_rest_s=0.1)
SECRET = "a secret of the plant"
DELIVERY = Delivery(17, "webhook", "01KB0000000000000000000017", {"text": "KX407251", "name": "Träger"})
Answering = Callable[[Request], Awaitable[Response]]


class Receiver:
    """A web server that keeps what came; `answering` answers."""

    def __init__(self, answering: Answering | None = None) -> None:
        self.came: list[tuple[dict[str, str], bytes]] = []
        self._answering = answering
        self.app = Starlette(routes=[Route("/{path:path}", self._take, methods=["GET", "POST"])])

    async def _take(self, request: Request) -> Response:
        self.came.append((dict(request.headers), await request.body()))
        return await self._answering(request) if self._answering else Response(status_code=204)


def answers(*statuses: int, headers: dict[str, str] | None = None) -> Answering:
    """The statuses one after the other, the last for ever."""
    left = list(statuses)

    async def answer(_: Request) -> Response:
        return Response(status_code=left.pop(0) if len(left) > 1 else left[0], headers=headers)

    return answer


def sender_to(url: str, secret: str = "", **options: float) -> WebhookSender:
    return WebhookSender(WebhookSettings.model_construct(url=url, secret=secret), **options)  # type: ignore[arg-type]


def error_of(url: str, **options: float) -> DeliveryError:
    async def run() -> DeliveryError:
        sender = sender_to(url, **options)
        try:
            with pytest.raises(DeliveryError) as caught:
                await sender.send(DELIVERY)
            return caught.value
        finally:
            await sender.close()

    return asyncio.run(run())


def posted(url: str, secret: str = "") -> None:
    async def run() -> None:
        sender = sender_to(url, secret)
        await sender.send(DELIVERY)
        await sender.send(DELIVERY)
        await sender.close()

    asyncio.run(run())


def test_the_signature_is_that_of_standard_webhooks() -> None:
    # the example of the specification's own libraries
    made = signature(
        "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw",
        webhook_id="msg_p5jXN8AQM9LWM0D4loKWxJek",
        timestamp=1614265330,
        body=b'{"test": 2432232314}',
    )
    assert made == "v1,g0hM9SsE+OTPJTGt/tmIKtSyZlE3uFJELVlNIOLJ1OE="
    with pytest.raises(SettingsError, match="base64"):
        sender_to("http://127.0.0.1", "whsec_no base64!")


def test_a_delivery_is_posted_signed_and_can_be_told_from_others() -> None:
    receiver = Receiver()
    with serving(receiver.app) as url:
        posted(f"{url}/parts?line=4", secret=SECRET)
    assert len(receiver.came) == 2
    for headers, body in receiver.came:
        assert json.loads(body) == {"text": "KX407251", "name": "Träger", "delivery_id": 17}
        assert headers["content-type"] == "application/json"
        sent_id, stamp = headers["webhook-id"], int(headers["webhook-timestamp"])
        assert (sent_id, abs(stamp - time.time()) < 600.0) == (f"{DELIVERY.part_id}-17", True)
        signed = signature(SECRET, webhook_id=sent_id, timestamp=stamp, body=body)
        assert headers["webhook-signature"] == signed


@pytest.mark.parametrize(
    ("status", "away", "lasting"),
    [
        (500, False, False),
        (501, False, False),
        (429, True, False),
        (503, True, False),
        (400, False, True),
        (422, False, True),
        (404, True, True),
        (410, True, True),
        (401, True, True),
        (304, False, False),
    ],
)
def test_an_answer_that_is_not_2xx_is_no_delivery(status: int, away: bool, lasting: bool) -> None:
    with serving(Receiver(answers(status, headers={"retry-after": "7"})).app) as url:
        error = error_of(url)
    assert str(status) in str(error)
    assert (error.away, error.lasting) == (away, lasting)
    assert error.retry_after_s == (7.0 if status in (429, 503) else 0.0)


def test_a_redirect_is_not_followed() -> None:
    elsewhere = Receiver()

    async def redirect(_: Request) -> Response:
        return RedirectResponse(f"{other}/elsewhere", status_code=307)

    with serving(elsewhere.app) as other, serving(Receiver(redirect).app) as url:
        error = error_of(url)
    assert "redirect" in str(error)
    assert error.lasting
    assert not elsewhere.came


def raw_server_error(talk: Callable[[asyncio.StreamWriter], Awaitable[None]]) -> DeliveryError | None:
    """What comes of a delivery to a server that answers as `talk` does."""

    async def run() -> DeliveryError | None:
        async def serve(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
            await reader.readuntil(b'"delivery_id":17}')
            try:
                await talk(writer)
            except OSError:
                pass
            finally:
                writer.close()

        server = await asyncio.start_server(serve, "127.0.0.1", 0)
        port = server.sockets[0].getsockname()[1]
        sender = sender_to(f"http://127.0.0.1:{port}", timeout_s=0.5)
        try:
            await sender.send(DELIVERY)
        except DeliveryError as error:
            return error
        finally:
            await sender.close()
            server.close()
        return None

    return asyncio.run(run())


def test_an_answer_that_does_not_come_is_given_up() -> None:
    async def hang(_: asyncio.StreamWriter) -> None:
        await asyncio.sleep(1.0)

    error = raw_server_error(hang)
    assert error is not None
    assert error.away
    assert "0.5 s" in str(error)


def test_an_answer_without_end_is_not_read_to_it() -> None:
    async def flood(writer: asyncio.StreamWriter) -> None:
        writer.write(b"HTTP/1.1 200 OK\r\ntransfer-encoding: chunked\r\n\r\n")
        while True:
            writer.write(b"10000\r\n" + b"x" * 65536 + b"\r\n")
            await writer.drain()

    assert raw_server_error(flood) is None  # it has said 200


@pytest.mark.parametrize("answer", [b"", b"HTTP/1.1 200 OK\r\n", b"SSH-2.0-OpenSSH\r\n\r\n"])
def test_an_answer_that_breaks_off_or_is_none_is_no_delivery(answer: bytes) -> None:
    async def broken(writer: asyncio.StreamWriter) -> None:
        writer.write(answer)

    error = raw_server_error(broken)
    assert error is not None
    assert error.away


def test_nobody_there_is_told_without_the_password() -> None:
    error = error_of(f"http://user:passw0rd@127.0.0.1:{free_port()}/")
    assert error.away
    assert "cannot be reached" in str(error)
    assert "passw0rd" not in str(error)


def test_only_the_settings_say_how_a_receiver_is_reached(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HTTP_PROXY", f"http://127.0.0.1:{free_port()}")
    monkeypatch.delenv("NO_PROXY", raising=False)
    receiver = Receiver()
    with serving(receiver.app) as url:
        posted(url.replace("http://", "http://user:passw0rd@"))
    headers, _ = receiver.came[0]
    assert headers["authorization"].startswith("Basic ")
    assert "webhook-signature" not in headers  # there is no secret
