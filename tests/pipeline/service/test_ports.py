"""The whole line at once: one service on PostgreSQL, a broker, a webhook and an OPC UA client, real every one."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from asyncua import Client as OpcUaClient
from fastapi import FastAPI, Request

from pipeline.common.records import PartState, ReviewAction
from pipeline.files.synth import SynthSpec, write_part
from pipeline.service.client import Client
from pipeline.service.line.webhook import check_signature
from pipeline.service.process import service_process
from tests.support.line_broker import Broker, Listener
from tests.support.line_fakes import free_port, serving, until_now

SECRET = "between the two of us"
FAR_FROM_NOW_S = 1e9
"""What the signature's time may be off: it is the sender's own clock."""


def test_a_part_goes_out_on_every_line(
    tmp_path: Path,
    find_program: Callable[[str], str],
    empty_stores: Callable[[str, pytest.FixtureRequest], str],
    request: pytest.FixtureRequest,
) -> None:
    store_url = empty_stores("postgresql", request)
    truth = write_part(SynthSpec(format="AA99", seed=2), tmp_path / "P17", 0, photos=True)
    hook, posted = _receiver()
    broker = Broker(tmp_path, find_program("mosquitto"))
    broker.start()
    listener, opcua_port = Listener(broker.port), free_port()
    try:
        with serving(hook) as hook_url:
            options = (
                *(
                    "--store",
                    store_url,
                    "--jobs",
                    "1",
                    "--camera",
                    str(tmp_path),
                    "--stage",
                    str(tmp_path),
                ),
                *("--mqtt", f"mqtt://127.0.0.1:{broker.port}", "--webhook", f"{hook_url}/results"),
                *(
                    "--opcua-port",
                    str(opcua_port),
                    "--format",
                    "AA99",
                    "--font",
                    "gothic",
                    "--height-mm",
                    "5",
                ),
            )
            environment = {**os.environ, "TACTILE_MARKS_SERVICE_WEBHOOK_SECRET": SECRET}
            with (
                service_process(tmp_path / "service", *options, environment=environment) as service,
                Client(service.url) as client,
            ):
                sent = client.read(scan=tmp_path / "P17.npz", name="P17")
                assert (sent.text, sent.state) == (truth, PartState.ACCEPTED)
                asyncio.run(_scanned_over_opcua(opcua_port, "P17", truth))
                told = client.review(sent.id, action=ReviewAction.CORRECT, text="ZZ99", who="Anna")
                assert told.text == "ZZ99"
                # as sent, as triggered over OPC UA, as reviewed
                until_now(lambda: len(posted) >= 3 and len(listener.results()) >= 3, why="for the results")
    finally:
        listener.close()
        broker.kill()
    texts = [truth, truth, "ZZ99"]
    assert sorted(str(body["text"]) for body in posted) == sorted(texts)
    assert sorted(str(body["text"]) for body in listener.results()) == sorted(texts)
    of_part = [body["text"] for body in listener.results() if body["id"] == sent.id]
    assert of_part == [truth, "ZZ99"]


def _receiver() -> tuple[FastAPI, list[dict[str, Any]]]:
    """A web address that takes what is signed with the secret."""
    app, posted = FastAPI(), []

    @app.post("/results")
    async def results(request: Request) -> dict[str, str]:
        body = await request.body()
        stamp = float(request.headers["webhook-timestamp"])
        check_signature(SECRET, request.headers, body, now_s=stamp, tolerance_s=FAR_FROM_NOW_S)
        posted.append(await request.json())
        return {}

    return app, posted


async def _scanned_over_opcua(port: int, name: str, truth: str) -> None:
    async with OpcUaClient(f"opc.tcp://127.0.0.1:{port}/tactile-marks") as client:
        (device,) = await (await client.nodes.objects.get_child("2:DeviceSet")).get_children()
        found = {(await child.read_browse_name()).Name: child for child in await device.get_children()}
        shown = await found["LastScanData"].read_value()
        assert getattr(shown, "String", shown) == truth  # the part that came over HTTP
        answer = await device.call_method(found["TriggerPart"], name)
        assert truth in [str(value) for value in (answer if isinstance(answer, list | tuple) else [answer])]


@pytest.fixture(autouse=True)
def _quiet(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level("ERROR", logger="asyncua")
