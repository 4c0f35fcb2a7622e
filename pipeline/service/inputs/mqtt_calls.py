"""Triggers and releases that come by MQTT: a call in, its answer out.

trigger  {"name": "P17", "job": "left", "expected": "KX407251"}, or only a name  -->  the short result
touch    {"part": "P17"}, a name or an id, or only that                          -->  the same
anything else                                                                    -->  {"error": ...}
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import Awaitable, Mapping
from typing import TYPE_CHECKING, Any

from glyphs.plain_text import has_hidden
from pipeline.common.line_decision import short_result
from pipeline.common.records import PartRecord
from pipeline.service.inputs.trigger import ANSWER_S, answer_of, in_words
from pipeline.service.web.problem import Problem

if TYPE_CHECKING:
    from pipeline.service.intake import Intake

_MOST_BYTES = 2000
_FIELDS = {"name", "part", "job", "expected"}


class MqttCalls:
    """Triggers and releases, carried out by the intake."""

    def __init__(self, intake: Intake) -> None:
        self._intake = intake
        self._running: set[asyncio.Future[Any]] = set()

    async def answer(self, call: str, payload: bytes) -> bytes:
        answer: dict[str, Any] = {"call": call}
        try:
            answer |= _fields_of(payload)
            part = await answer_of(self._carry_out(call, answer), self._running, within_s=ANSWER_S)
            answer |= short_result(part)
        except Exception as error:
            answer["error"] = in_words(error)
        return json.dumps(answer, ensure_ascii=False, separators=(",", ":")).encode("utf-8", "replace")

    def _carry_out(self, call: str, content: Mapping[str, str]) -> Awaitable[PartRecord]:
        name, expected = content.get("name", ""), content.get("expected", "")
        if call == "touch":
            return self._intake.release(content.get("part", name), within_s=ANSWER_S)
        return self._intake.trigger(name, content.get("job", ""), expected=expected, within_s=ANSWER_S)


def _fields_of(payload: bytes) -> dict[str, str]:
    if len(payload) > _MOST_BYTES:
        raise Problem(413, f"a call has at most {_MOST_BYTES} bytes")
    try:
        text = payload.decode("utf-8").strip("\0\r\n ")
        content: dict[str, str] = json.loads(text) if text.startswith("{") else {"name": text}
    except ValueError as error:
        raise Problem(422, 'a call is a name, or JSON such as {"name": "P17"}') from error
    if not content.keys() <= _FIELDS or not all(isinstance(value, str) for value in content.values()):
        raise Problem(422, "the fields of a call are name, part, job and expected; their values are texts")
    if any(map(has_hidden, content.values())):
        raise Problem(422, "a call must not have hidden characters")
    return content
