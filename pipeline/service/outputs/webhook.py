"""Post results to a web address, signed by Standard Webhooks (https://www.standardwebhooks.com).

POST <url>
webhook-id: 01JD...-17            the same for every attempt: receivers recognise repetitions by it
webhook-timestamp: 1795000000     seconds, of the attempt
webhook-signature: v1,<base64 of HMAC-SHA256 over "id.timestamp.body">

{"id": "01JD...", "name": "P17", "state": "accepted", "text": "KX407251", ..., "delivery_id": 17}

Any answer 2xx says that it has arrived. Redirects are not followed: a result goes to the address that was given.
"""

from __future__ import annotations

import asyncio
import base64
import binascii
import hashlib
import hmac
import time
from typing import TYPE_CHECKING

from pipeline.common.records import Delivery
from pipeline.common.settings import SettingsError
from pipeline.service.client import retry_after_s
from pipeline.service.outputs.dispatch import DeliveryError, body_of

if TYPE_CHECKING:
    import httpx

    from pipeline.service.settings import WebhookSettings

_ENCODED = "whsec_"
_AGENT = "tactile-marks"
_LATER = frozenset({408, 425, 429, 502, 503, 504})
_ADDRESS_WRONG = frozenset({401, 403, 404, 405, 407, 410})


def signature(secret: str, *, webhook_id: str, timestamp: int, body: bytes) -> str:
    """The header webhook-signature; a secret is any text, or whsec_ and the key in base64 (else SettingsError)."""
    signed = f"{webhook_id}.{timestamp}.".encode() + body
    digest = hmac.new(_key(secret), signed, hashlib.sha256).digest()
    return f"v1,{base64.b64encode(digest).decode()}"


class WebhookSender:
    """Post deliveries to a web address."""

    def __init__(self, settings: WebhookSettings, *, timeout_s: float = 10.0) -> None:
        """`timeout_s`: of one delivery. Raises SettingsError: a whsec_ secret that is no base64."""
        import httpx

        self._url, self._secret, self._timeout_s = settings.url, settings.secret, timeout_s
        if self._secret:
            _key(self._secret)
        # proxies and the like of the environment are ignored: only the settings count
        self._http = httpx.AsyncClient(follow_redirects=False, timeout=timeout_s, trust_env=False)

    async def ping(self) -> bool:
        """Do nothing: a webhook can only be checked by a post."""
        return False

    async def send(self, delivery: Delivery) -> None:
        import httpx

        body, stamp = body_of(delivery), int(time.time())
        webhook_id = f"{delivery.part_id}-{delivery.id}"
        headers = {
            "content-type": "application/json",
            "user-agent": _AGENT,
            "webhook-id": webhook_id,
            "webhook-timestamp": str(stamp),
        }
        if self._secret:
            headers["webhook-signature"] = signature(
                self._secret, webhook_id=webhook_id, timestamp=stamp, body=body
            )
        try:
            # httpx limits each step; a head that trickles in would take for ever, and the body says nothing
            async with (
                asyncio.timeout(self._timeout_s),
                self._http.stream("POST", self._url, content=body, headers=headers) as answer,
            ):
                pass
        except (TimeoutError, httpx.TimeoutException):
            raise DeliveryError(f"no answer within {self._timeout_s:g} s", away=True) from None
        except httpx.TransportError as error:
            raise DeliveryError(f"cannot be reached: {type(error).__name__}: {error}", away=True) from error
        _judge(answer)

    async def close(self) -> None:
        await self._http.aclose()


def _judge(answer: httpx.Response) -> None:
    status, what = answer.status_code, f"answers {answer.status_code}"
    if status in _LATER:
        raise DeliveryError(what, away=True, retry_after_s=retry_after_s(answer.headers))
    if answer.has_redirect_location or status in _ADDRESS_WRONG:
        hint = "check the webhook's address; redirects are not followed"
        raise DeliveryError(what, hint=hint, away=True, lasting=True)
    if not answer.is_success:
        raise DeliveryError(what, lasting=400 <= status < 500)


def _key(secret: str) -> bytes:
    if not secret.startswith(_ENCODED):
        return secret.encode()
    try:
        return base64.b64decode(secret.removeprefix(_ENCODED), validate=True)
    except binascii.Error as error:
        raise SettingsError("a webhook secret that begins with whsec_ must continue in base64") from error
