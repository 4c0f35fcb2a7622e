"""An OPC UA server in the manner of OPC 30010 AutoID: the service as an OCR reader.

Objects/DeviceSet/<name>: OcrReaderDeviceType
  DeviceName, DeviceInfo (last fault, in words), DeviceStatus (Idle, Busy, Scanning), LastScanData, LastScanTimestamp
  Scan(Settings) -> Results, Status         one trigger, answered with its result
  ScanStart(Settings) -> Status             one trigger, answered at once; the result comes as OcrScanEventType
  ScanStop()                                forgets that a scan was started; its part is still read
  TriggerPart, TriggerJob, TouchPart, PartResult     the same in plain types, see docs: how-to/plc
  LastPartId, LastDecision, LastConfidence  of the last part, whatever triggered it; empty while one is read, and ERROR
                                            after a call that has failed

One scan is one part: Cycles above 1, which would repeat the same piece of metal, is refused; Duration is the time that
Scan waits. Parts of other inputs are shown as well (`show`); what a person has decided comes as an event (`tell`).
"""

from __future__ import annotations

import asyncio
import math
from collections import deque
from collections.abc import Awaitable, Callable
from contextvars import ContextVar
from datetime import UTC, datetime
from functools import partial
from typing import TYPE_CHECKING, Any

from glyphs.errors import MarksError
from glyphs.plain_text import has_hidden
from pipeline.common.line_decision import NO_READING, LineDecision, decision_of
from pipeline.common.reading_records import ReadingRecord
from pipeline.common.records import PartRecord, PartState
from pipeline.service.inputs.opcua_server import (
    GuardedServer,
    Users,
    bad,
    set_up_device,
    settings_fit,
    ua,
    variant,
)
from pipeline.service.inputs.trigger import ANSWER_S, in_words
from pipeline.service.settings import host_and_port
from pipeline.service.tasks import end_tasks
from pipeline.service.web.problem import problem_of

if TYPE_CHECKING:
    from pipeline.service.intake import Intake
    from pipeline.service.settings import OpcUaSettings

IDLE, SCANNING, BUSY = 0, 2, 3
# LastDecision after a call that has failed
FAILED = "ERROR"
_LEAVE_S = 0.1
SUCCESS, NO_IDENTIFIER, DECODING_ERROR, MATCH_ERROR = 0, 8, 11, 12
DEVICE_NOT_READY, DEVICE_FAULT = 17, 20
CODE_TYPE = "RAW:STRING"
_UM_PER_MM = 1000.0
_INT32 = 2**31 - 1
# whether the method that has started the scan returns its part; the tasks that the scan starts inherit it
_ANSWERED = ContextVar("answered", default=False)


class OpcUaPort:
    """The OPC UA server, for so many signed-in connections; `port` 0 becomes the real one at the start."""

    title = "OPC UA server"
    trouble = ""

    def __init__(self, settings: OpcUaSettings, intake: Intake, *, connections: int = 16) -> None:
        self.host, self.port = host_and_port(settings.port or "0")
        self._settings, self._intake = settings, intake
        self._connections = connections
        self._server: Any = None
        self._nodes: dict[str, Any] = {}
        self._events: Any = None
        self._scanning: asyncio.Task[PartRecord] | None = None
        self._started: asyncio.Task[PartRecord] | None = None
        self._stopped = False
        self._shown: deque[tuple[str, datetime]] = deque(maxlen=256)
        self._showing = asyncio.Lock()

    async def start(self) -> dict[str, object]:
        server: Any = GuardedServer(Users(self._settings.users), sessions=self._connections)
        await server.init()
        server.set_server_name("tactile-marks")
        await server.set_application_uri("urn:tactile-marks:server")
        server.application_type = ua.ApplicationType.Server
        server.set_endpoint(f"opc.tcp://{self.host}:{self.port}/tactile-marks")
        policy = ua.SecurityPolicyType
        certificate, key = self._settings.certificate, self._settings.key
        if certificate is not None and key is not None:
            await server.load_certificate(certificate)
            await server.load_private_key(key)
            server.set_security_policy(
                [policy.Basic256Sha256_SignAndEncrypt, policy.Aes256Sha256RsaPss_SignAndEncrypt]
            )
        else:
            server.set_security_policy([policy.NoSecurity])
        users, intake = self._settings.users, self._intake
        server.set_identity_tokens([ua.UserNameIdentityToken if users else ua.AnonymousIdentityToken])
        methods: dict[str, Callable[..., Awaitable[Any]]] = {
            "Scan": self._scan,
            "ScanStart": self._scan_start,
            "ScanStop": self._scan_stop,
            "TriggerPart": partial(self._of_part, intake.trigger),
            "TriggerJob": partial(self._of_part, intake.trigger),
            "TouchPart": partial(self._of_part, intake.release),
            "PartResult": partial(self._of_part, intake.look_up, busy=False),
        }
        self._nodes, self._events = await set_up_device(server, methods)
        await server.start()
        self.port = server.bserver.port
        self._server = server
        return {"host": self.host, "port": self.port}

    async def stop(self, *, grace_s: float = 20.0) -> None:
        self._stopped = True
        if self._scanning is not None:
            await end_tasks([self._scanning], grace_s=grace_s)
            await asyncio.sleep(_LEAVE_S)  # its answer is still to be sent
        if self._server is not None:
            await self._server.stop()
            self._server = None

    async def show(self, part: PartRecord) -> None:
        """Show a part that was read, once, and send it as an event unless Scan returns it; none in shadow mode."""
        async with self._showing:  # one part's values and event together
            if (
                self._server is None
                or part.state is PartState.SHADOW
                or (part.id, part.changed_at) in self._shown
            ):
                return
            self._shown.append((part.id, part.changed_at))
            confidence = (part.reading or NO_READING).confidence
            await self._write_last(
                part.changed_at.astimezone(UTC), decision_of(part).value, part.text, part.id, confidence
            )
            if not _ANSWERED.get():
                await self.tell(part)

    async def tell(self, part: PartRecord) -> None:
        if self._server is None:
            return
        decision = decision_of(part)
        self._events.event.ScanResult = [ocr_scan_result(part)]
        self._events.event.Severity = 100 if decision is LineDecision.ACCEPT else 500
        message = f"{decision.value} {part.text} {part.name} {part.id}"
        await self._events.trigger(message=" ".join(message.split()))

    async def _write_last(
        self, source_time: datetime, decision: str, text: str = "", part_id: str = "", confidence: float = 0.0
    ) -> None:
        """One source time for all values, as the specification wants it: clients see what belongs together."""
        for name, value in (
            ("LastScanData", text),
            ("LastScanTimestamp", source_time),
            ("LastPartId", part_id),
            ("LastDecision", decision),
            ("LastConfidence", confidence),
        ):
            await self._write(name, value, source_time=source_time)

    async def _scan(self, _parent: Any, *arguments: Any) -> Any:
        if (refused := await self._refusal(fits=settings_fit(arguments, endless=False))) is not None:
            return refused
        wait_s = arguments[0].Value.Duration / 1000.0 or ANSWER_S
        wait_s = min(wait_s, ANSWER_S)
        call = partial(self._intake.trigger, "", within_s=wait_s)
        part, status = await self._wait(self._begin(call, BUSY, answered=True), wait_s)
        results = [ocr_scan_result(part)] if part is not None else []
        return [ua.Variant(results, ua.VariantType.ExtensionObject, is_array=True), variant(status)]

    async def _scan_start(self, _parent: Any, *arguments: Any) -> Any:
        if (refused := await self._refusal(fits=settings_fit(arguments, endless=True))) is not None:
            return refused
        self._started = self._begin(partial(self._intake.trigger, "", within_s=ANSWER_S), SCANNING)
        return [variant(SUCCESS)]

    async def _scan_stop(self, _parent: Any, *_arguments: Any) -> Any:
        if self._started is None or self._started.done():
            return bad("BadInvalidState")
        self._started = None
        return []

    async def _of_part(
        self, call: Callable[..., Awaitable[PartRecord]], _parent: Any, *arguments: Any, busy: bool = True
    ) -> Any:
        names = ["" if argument.Value is None else argument.Value for argument in arguments]
        fits = len(names) in (1, 2) and not any(
            not isinstance(name, str) or has_hidden(name) for name in names
        )
        if not busy:
            try:
                part: PartRecord | None = await call(*names) if fits else None
            except MarksError as error:
                await self._write("DeviceInfo", in_words(error))
                return bad("BadNotFound")
            if part is None:
                return bad("BadInvalidArgument")
        elif (refused := await self._refusal(fits=fits)) is not None:
            return refused
        else:
            scan = self._begin(partial(call, *names, within_s=ANSWER_S), BUSY)
            part, _ = await self._wait(scan, ANSWER_S)
        if part is None:
            return bad("BadDeviceFailure")
        reading = part.reading or NO_READING
        answer = (part.id, part.text, decision_of(part).value, reading.confidence, reading.source)
        return [variant(value) for value in answer]

    async def _refusal(self, *, fits: bool) -> Any:
        if not fits:
            if self._scanning is None:
                await self._write_last(datetime.now(UTC), FAILED)
            return bad("BadInvalidArgument")
        return bad("BadInvalidState") if self._scanning is not None or self._stopped else None

    def _begin(
        self, call: Callable[[], Awaitable[PartRecord]], status: int, *, answered: bool = False
    ) -> asyncio.Task[PartRecord]:
        self._scanning = task = asyncio.create_task(self._cycle(call, status, answered))
        task.add_done_callback(lambda done: done.cancelled() or done.exception())  # DeviceInfo says it
        return task

    async def _cycle(
        self, call: Callable[[], Awaitable[PartRecord]], status: int, answered: bool
    ) -> PartRecord:
        _ANSWERED.set(answered)
        try:
            await self._write("DeviceStatus", status)
            async with self._showing:
                await self._write_last(datetime.now(UTC), "")
            part = await call()
            await self.show(part)
            await self._write("DeviceInfo", "")
            return part
        except Exception as error:
            problem = problem_of(error)
            await self._write("DeviceInfo", in_words(problem))
            async with self._showing:
                await self._write_last(datetime.now(UTC), FAILED)
            raise problem from error
        finally:
            self._scanning = None
            await self._write("DeviceStatus", IDLE)

    async def _wait(self, scan: asyncio.Task[PartRecord], wait_s: float) -> tuple[PartRecord | None, int]:
        await asyncio.wait({scan}, timeout=wait_s)
        if not scan.done() or scan.cancelled():
            return None, DEVICE_NOT_READY
        if (error := scan.exception()) is not None:
            return None, DEVICE_FAULT if problem_of(error).status == 500 else DEVICE_NOT_READY
        return scan.result(), status_of(scan.result())

    async def _write(
        self, name: str, value: str | int | float | datetime, *, source_time: datetime | None = None
    ) -> None:
        await self._nodes[name].write_value(ua.DataValue(variant(value), SourceTimestamp=source_time))


def status_of(part: PartRecord) -> int:
    """Return the AutoIdOperationStatusEnumeration: SUCCESS only for an accepted part, and never in shadow mode."""
    if part.state is PartState.SHADOW:
        return DEVICE_NOT_READY
    if not part.text:
        return NO_IDENTIFIER
    if part.reading is not None and part.reading.verdict == "refuted":
        return MATCH_ERROR
    return SUCCESS if decision_of(part) is LineDecision.ACCEPT else DECODING_ERROR


def ocr_scan_result(part: PartRecord) -> Any:
    """Convert a part to an OcrScanResult; its type exists once a server has loaded the model.

    CodeType   RAW:STRING           ScanData  the serial as a string
    Quality    confidence in whole percent, rounded down: only full confidence gives 100
    Position   bounding box of the characters in the frame that was read, in micrometres, as whiskers have no pixels.
               PositionX and PositionY are its least x and y, Rotation that of the line in degrees
    """
    reading = part.reading or NO_READING
    data = ua.ScanData()
    data.String = part.text
    return ua.OcrScanResult(
        CodeType=CODE_TYPE,
        ScanData=data,
        Timestamp=(reading.at or part.changed_at).astimezone(UTC),
        ImageId=ua.NodeId(),
        Quality=ua.Byte(min(100, max(0, math.floor(_finite(100.0 * reading.confidence))))),
        Position=ua.Position(**_position(reading)),
        Font=reading.font or None,
    )


def _position(reading: ReadingRecord) -> dict[str, int]:
    boxes = [c.box_mm for c in reading.characters if c.box_mm is not None]
    turned_deg = reading.rotation_deg if boxes else 0.0
    x0, y0 = (min((box[k] for box in boxes), default=0.0) * _UM_PER_MM for k in (0, 1))
    x1, y1 = (max((box[k] for box in boxes), default=0.0) * _UM_PER_MM for k in (2, 3))
    hull = {"PositionX": x0, "PositionY": y0, "SizeX": x1 - x0, "SizeY": y1 - y0, "Rotation": turned_deg}
    return {name: max(-_INT32, min(_INT32, round(_finite(value)))) for name, value in hull.items()}


def _finite(value: float) -> float:
    return value if math.isfinite(value) else 0.0
