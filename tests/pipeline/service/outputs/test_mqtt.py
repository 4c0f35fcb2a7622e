"""Publishing over MQTT, against a real mosquitto."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import signal
from collections.abc import AsyncIterator, Callable, Iterator
from pathlib import Path
from random import Random

import paho.mqtt.client as paho
import pytest
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties

from pipeline.common.reading_records import to_json
from pipeline.common.records import Delivery, PartRecord, PartState
from pipeline.service.inputs.mqtt_calls import MqttCalls
from pipeline.service.outputs.dispatch import DeliveryError, Dispatcher, Pace
from pipeline.service.outputs.mqtt import MqttSender
from pipeline.service.settings import MqttSettings
from pipeline.service.tasks import end_tasks
from pipeline.service.web.problem import Problem
from tests.support.line_broker import Broker, GuardedBroker, Listener, certificates
from tests.support.line_fakes import Outbox, part, reading, until
from tests.support.waiting import free_port, wait_until

pytestmark = pytest.mark.anyio

FAST = Pace(look_s=0.02, first_wait_s=0.02, longest_wait_s=0.2, longest_rest_s=0.2)


@pytest.fixture
def make_broker(tmp_path: Path) -> Iterator[Callable[..., Broker]]:
    with contextlib.ExitStack() as stack:

        def make(*settings: str) -> Broker:
            broker = Broker(tmp_path, *settings)
            stack.callback(broker.kill)
            broker.start()
            return broker

        yield make


@pytest.fixture
def broker(make_broker: Callable[..., Broker]) -> Broker:
    return make_broker()


@pytest.fixture
def listen(broker: Broker) -> Iterator[Callable[[], Listener]]:
    with contextlib.ExitStack() as stack:
        yield lambda: stack.enter_context(contextlib.closing(Listener(broker.port)))


@pytest.fixture
def listener(listen: Callable[[], Listener]) -> Listener:
    return listen()


def sender_to(url: str, timeout_s: float = 10.0, **settings: str) -> MqttSender:
    return MqttSender(MqttSettings.model_construct(url=url, **settings), timeout_s=timeout_s)  # type: ignore[arg-type]


def one_delivery(part_id: str = "PART1", number: int = 1) -> Delivery:
    return Delivery(number, "mqtt", part_id, {"id": part_id, "text": f"TEXT{number}"})


@contextlib.asynccontextmanager
async def looked_after(sender: MqttSender) -> AsyncIterator[None]:
    """A sender that has nothing to send, as a dispatcher looks after it."""

    async def ping() -> None:
        while True:
            with contextlib.suppress(DeliveryError):
                await sender.ping()
            await asyncio.sleep(0.02)

    pinging = asyncio.create_task(ping())
    try:
        yield
    finally:
        await end_tasks([pinging])


async def test_a_result_is_published_and_the_status_follows(
    broker: Broker, listener: Listener, listen: Callable[[], Listener]
) -> None:
    sender = sender_to(f"mqtt://127.0.0.1:{broker.port}/plant/line-4")
    await asyncio.gather(*(sender.send(one_delivery(f"PART{n}", n)) for n in range(50)))
    await sender.close()
    wait_until(lambda: len(listener.results()) == 50 and len(listener.statuses("plant/line-4")) == 2)
    topics = {topic for topic, _, _ in listener.messages}
    assert {f"plant/line-4/parts/PART{n}/result" for n in range(50)} < topics
    assert listener.statuses("plant/line-4") == ["online", "offline"]
    assert {"id": "PART7", "text": "TEXT7", "delivery_id": 7} in listener.results()
    wait_until(lambda: "PART7/result" in broker.log)
    line = next(line for line in broker.log.splitlines() if "PART7/result" in line)
    assert "Received PUBLISH" in line
    assert "q1, r0" in line
    # who comes later finds the status, and no results of yesterday
    late = listen()
    wait_until(lambda: len(late.messages) == 1)
    assert late.messages == [("plant/line-4/status", b"offline", True)]


async def test_a_short_payload_has_few_fields_and_a_candidate_while_a_person_is_awaited(
    broker: Broker, listener: Listener
) -> None:
    sender = sender_to(f"mqtt://127.0.0.1:{broker.port}/plant", payload="short")
    accepted = to_json(part())
    in_review = to_json(part(state=PartState.REVIEW, reading=reading("KX40", decision="review")))
    in_review |= {"text": "", "candidate": "KX40"}
    for number, record in enumerate((accepted, in_review)):
        await sender.send(Delivery(number, "mqtt", "PART1", record))
    await sender.send(Delivery(3, "mqtt", "PART1", {"alert": "drift", "state": "raised"}))
    await sender.close()
    wait_until(lambda: len(listener.results()) == 2)
    first, second = listener.results()
    assert first == {
        "id": part().id, "name": "P17", "state": "accepted", "decision": "ACCEPT", "text": "KX407251",
        "candidate": "", "confidence": 0.9984, "source": "fused", "delivery_id": 0,
    }  # fmt: skip
    assert (second["decision"], second["text"], second["candidate"]) == ("REVIEW", "", "KX40")
    wait_until(lambda: any(topic == "plant/alerts/drift" for topic, *_ in listener.messages))


class Line:
    """Calls that a controller makes; they come back as parts that say what was asked for."""

    async def trigger(self, name: str, job: str = "", *, expected: str = "", **_: object) -> PartRecord:
        if name == "nobody":
            raise Problem(422, "there is no photograph of nobody")
        return part(name, text=f"{job}/{expected}")

    async def release(self, name: str, **_: object) -> PartRecord:
        return part(name, text="FELT")


async def test_triggers_and_releases_come_by_mqtt_and_are_answered(
    broker: Broker, listener: Listener
) -> None:
    settings = MqttSettings.model_construct(url=f"mqtt://127.0.0.1:{broker.port}/plant", triggers=True)
    caller = paho.Client(paho.CallbackAPIVersion.VERSION2, protocol=paho.MQTTv5)
    caller.connect("127.0.0.1", broker.port)
    caller.loop_start()
    caller.publish("plant/trigger", b"of yesterday", qos=1, retain=True).wait_for_publish()
    sender = MqttSender(settings, MqttCalls(Line()).answer)  # type: ignore[arg-type]

    def answers(topic: str = "plant/answer") -> list[dict[str, str]]:
        return [json.loads(body) for at, body, _ in listener.messages if at == topic]

    async with looked_after(sender):
        await until(lambda: "plant/touch" in broker.log)
        reply = Properties(PacketTypes.PUBLISH)
        reply.ResponseTopic, reply.CorrelationData = "plc/7", b"17"
        for call, content in (
            ("trigger", b"P17\r\n"),
            ("trigger", b'{"name": "P18", "job": "left", "expected": "KX4"}'),
            ("touch", b'{"part": "P19"}'),
            ("trigger", b"nobody"),
            ("trigger", b'{"name": 7}'),
            ("trigger", b"[" * 5000),
        ):
            caller.publish(f"plant/{call}", content, qos=1)
        caller.publish("plant/touch", b"P20", qos=1, properties=reply)
        await until(lambda: len(answers()) == 6 and len(answers("plc/7")) == 1)
    await sender.close()
    caller.disconnect()
    caller.loop_stop()
    told = {(answer.get("name", ""), answer.get("text", ""), answer.get("error", "")) for answer in answers()}
    assert {("P17", "/", ""), ("P18", "left/KX4", ""), ("P19", "FELT", "")} < told
    assert {error for *_, error in told if error} == {
        "there is no photograph of nobody",
        "the fields of a call are name, part, job and expected; their values are texts",
        "a call has at most 2000 bytes",
    }
    assert [answer["text"] for answer in answers("plc/7")] == ["FELT"]


async def test_another_sender_that_ends_leaves_the_status_online(
    broker: Broker, listener: Listener, listen: Callable[[], Listener]
) -> None:
    url = f"mqtt://127.0.0.1:{broker.port}"
    stays, goes = sender_to(url), sender_to(url)
    async with looked_after(stays):
        await until(lambda: listener.statuses()[-1:] == ["online"])
        await goes.send(one_delivery())
        await goes.close()
        late = listen()  # finds what is retained
        await until(lambda: late.statuses()[-1:] == ["online"])
        assert late.statuses()[-1] == "online"
    await stays.close()


async def test_the_last_will_tells_of_a_service_that_died(broker: Broker, listener: Listener) -> None:
    sender = sender_to(f"mqtt://127.0.0.1:{broker.port}")
    await sender.send(one_delivery())
    assert sender._connection is not None
    raw = sender._connection._client.socket()
    assert raw is not None
    raw.shutdown(2)  # as a machine that loses its power: no goodbye
    await until(lambda: listener.statuses()[:2] == ["online", "offline"], why="for the will")
    await sender.send(one_delivery(number=2))  # and it comes back by itself
    await until(lambda: listener.statuses() == ["online", "offline", "online"])
    await sender.close()


async def test_a_broker_killed_again_and_again_loses_nothing_and_keeps_the_order(
    outbox: Outbox, broker: Broker, listener: Listener
) -> None:
    parts, each = 5, 40

    class WhileSeen:
        """Sends only while the listener listens: it has no session, so what is acknowledged before it cannot see."""

        def __init__(self, sender: MqttSender) -> None:
            self._sender = sender

        async def ping(self) -> bool:
            return await self._sender.ping()

        async def send(self, delivery: Delivery) -> None:
            if not listener.subscribed.is_set():
                raise DeliveryError("nobody listens", away=True)
            await self._sender.send(delivery)

        async def close(self) -> None:
            await self._sender.close()

    sender = sender_to(f"mqtt://127.0.0.1:{broker.port}", timeout_s=5.0)
    dispatcher = Dispatcher(outbox, {"mqtt": WhileSeen(sender)}, rng=Random(4), pace=FAST)
    dispatcher.start()
    for step in range(each):
        for index in range(parts - 1):
            outbox.put(index, f"N{step}", "mqtt")
        dispatcher.wake()
        if step % 20 == 10:
            left = outbox.undelivered()
            await until(lambda left=left: outbox.undelivered() < left)
            broker.kill()  # in the middle of sending
            listener.subscribed.clear()
        # and something is left to be sent, should all have arrived before
        outbox.put(parts - 1, f"N{step}", "mqtt")
        if step % 20 == 10:
            failed = len(outbox.postponed)
            await until(lambda failed=failed: len(outbox.postponed) > failed)
            await asyncio.to_thread(broker.start)
        await asyncio.sleep(0.002)
    await until(lambda: outbox.undelivered() == 0, why="for everything to arrive")
    await dispatcher.stop()
    wanted = [f"N{step}" for step in range(each)]

    def seen(index: int) -> list[object]:
        return [result["text"] for result in listener.results() if int(result["id"]) == index]

    with contextlib.suppress(AssertionError):
        wait_until(lambda: all(set(seen(index)) == set(wanted) for index in range(parts)))
    lost = {index: set(wanted) - set(seen(index)) for index in range(parts)}
    assert not any(lost.values()), f"lost: {lost}"
    for index in range(parts):
        numbers = [wanted.index(str(text)) for text in seen(index)]
        assert numbers == sorted(numbers), "an older result after a newer one"
    assert outbox.postponed


async def test_a_broker_that_hangs_is_given_up_and_nothing_old_comes_later(
    broker: Broker, listener: Listener
) -> None:
    sender = sender_to(f"mqtt://127.0.0.1:{broker.port}", timeout_s=0.5)
    await sender.send(one_delivery(number=1))
    broker.kill(signal.SIGSTOP)
    try:
        for number in (2, 3):
            with pytest.raises(DeliveryError) as caught:
                await sender.send(one_delivery(number=number))
            assert caught.value.away
    finally:
        broker.kill(signal.SIGCONT)
    await sender.send(one_delivery(number=4))
    await sender.send(one_delivery(number=5))
    await sender.close()
    wait_until(lambda: bool(listener.results()) and listener.results()[-1]["delivery_id"] == 5)
    numbers = [int(str(r["delivery_id"])) for r in listener.results()]
    # what the broker had in its socket when it hung may come, but before what was sent afterwards
    assert numbers == sorted(numbers)
    assert {1, 4, 5} <= set(numbers)


async def test_nobody_there_is_told_at_once() -> None:
    sender = sender_to(f"mqtt://127.0.0.1:{free_port()}")
    with pytest.raises(DeliveryError, match="cannot be reached") as caught:
        await sender.send(one_delivery())
    assert caught.value.away
    await sender.close()
    with pytest.raises(DeliveryError, match="closed"):
        await sender.send(one_delivery())


def test_user_and_password_are_checked_and_never_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(GuardedBroker, "password", "s3cr:et/")
    broker = GuardedBroker(tmp_path)

    async def run() -> None:
        sender = sender_to(f"mqtt://marks:s3cr%3Aet%2F@127.0.0.1:{broker.port}")
        await sender.send(one_delivery())
        await sender.close()
        for wrong in ("marks:wr0ng@", ""):
            other = sender_to(f"mqtt://{wrong}127.0.0.1:{broker.port}")
            with pytest.raises(DeliveryError, match="refuses") as caught:
                await other.send(one_delivery())
            assert "wr0ng" not in str(caught.value)
            await other.close()

    broker.start()
    try:
        with caplog.at_level(logging.DEBUG):
            asyncio.run(run())
    finally:
        broker.kill()
    assert "s3cr" not in caplog.text


async def test_over_tls_the_brokers_certificate_is_checked(
    make_broker: Callable[..., Broker], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    certificate, key = certificates(tmp_path, "broker")
    stranger, _ = certificates(tmp_path, "stranger")
    broker = make_broker(f"allow_anonymous true\ncertfile {certificate}\nkeyfile {key}\n")
    url = f"mqtts://127.0.0.1:{broker.port}"
    monkeypatch.setenv("SSL_CERT_FILE", str(certificate))
    sender = sender_to(url)
    await sender.send(one_delivery())
    await sender.close()
    for trusted in (tmp_path / "none.pem", stranger):
        monkeypatch.setenv("SSL_CERT_FILE", str(trusted))
        wrong = sender_to(url)
        with pytest.raises(DeliveryError, match="certificate"):
            await wrong.send(one_delivery())
        await wrong.close()
    plain = sender_to(f"mqtt://127.0.0.1:{broker.port}", timeout_s=2.0)
    with pytest.raises(DeliveryError):
        await plain.send(one_delivery())
    await plain.close()
