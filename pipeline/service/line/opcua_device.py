"""The device of the OPC UA server: its nodes, who may call it, and what it may be asked."""

from __future__ import annotations

import hmac
import math
from collections.abc import Callable, Mapping
from typing import Any

from pipeline.service.line.opcua_library import ua_types
from pipeline.service.line.opcua_model import Model
from pipeline.service.line.opcua_types import (
    node_id,
    plain_argument,
    qualified,
    scan_outputs,
    scan_settings_argument,
    status_output,
)


async def build_device(
    server: Any, model: Model, *, name: str, version: str, methods: Mapping[str, Callable[..., Any]]
) -> tuple[dict[str, Any], Any]:
    """Put the device into DeviceSet.

    Args:
        server: with the model built into it.
        model: of the specification.
        name: of the device.
        version: of the software.
        methods: Scan, ScanStart, ScanStop, TriggerPart and TriggerJob.

    Returns:
        Its variables by name, and the generator of its events.
    """
    ua = ua_types()
    kinds, own = ua.VariantType, model.reader
    device = await model.device_set.add_object(
        node_id(own, "reader"), qualified(own, name), objecttype=model.ocr_reader.nodeid
    )
    nodes: dict[str, Any] = {}
    for namespace, names in (
        (model.autoid, ("DeviceName", "DeviceInfo", "DeviceStatus", "LastScanData", "LastScanTimestamp")),
        (model.di, ("Manufacturer", "Model", "SoftwareRevision")),
    ):
        for one in names:
            nodes[one] = await device.get_child(qualified(namespace, one))
    for one, value, kind in (
        ("LastPartId", "", kinds.String),
        ("LastDecision", "", kinds.String),
        ("LastConfidence", 0.0, kinds.Double),
    ):
        nodes[one] = await device.add_variable(
            node_id(own, f"reader.{one}"), qualified(own, one), value, varianttype=kind
        )
    await nodes["DeviceName"].write_value(name)
    await nodes["Manufacturer"].write_value(ua.LocalizedText("tactile-marks"))
    await nodes["Model"].write_value(ua.LocalizedText("camera and whisker array"))
    await nodes["SoftwareRevision"].write_value(version)
    settings, status = scan_settings_argument(model.autoid), status_output(model.autoid)
    plain = [plain_argument(one, kinds.String) for one in ("PartId", "Text", "Decision")]
    plain += [plain_argument("Confidence", kinds.Double), plain_argument("Source", kinds.String)]
    called = [plain_argument(one, kinds.String) for one in ("PartName", "JobName")]
    for namespace, one, inputs, outputs in (
        (model.autoid, "Scan", [settings], scan_outputs(model.autoid)),
        (model.autoid, "ScanStart", [settings], [status]),
        (model.autoid, "ScanStop", [], []),
        (own, "TriggerPart", called[:1], plain),
        (own, "TriggerJob", called, plain),
    ):
        await device.add_method(
            node_id(own, f"reader.{one}"), qualified(namespace, one), methods[one], inputs, outputs
        )
    events = await server.get_event_generator(model.ocr_event, device)
    events.event.DeviceName = name
    return nodes, events


class Users:
    """Who may call: those named, with their passwords; all of them may read, subscribe and call, none may write.

    Attributes:
        denied: the name that was refused last.
    """

    def __init__(self, passwords: Mapping[str, str]) -> None:
        self._passwords = dict(passwords)
        self.denied = ""

    def get_user(
        self, _server: Any, username: str | None = None, password: str | None = None, certificate: Any = None
    ) -> Any:
        """The user, or None for one who may not."""
        from asyncua.crypto.permission_rules import User, UserRole

        if self._passwords:
            wanted = self._passwords.get(username or "", "")
            same = hmac.compare_digest(wanted.encode(), (password or "").encode("utf-8", "replace"))
            if not wanted or not same:
                self.denied = username or ""
                return None
        return User(role=UserRole.User, name=username)


def settings_fit(arguments: tuple[Any, ...], *, endless: bool) -> bool:
    """Whether ScanSettings ask for what there is: one cycle, ended by it, by time, or not at all where allowed."""
    settings = arguments[0].Value if len(arguments) == 1 else None
    duration = getattr(settings, "Duration", None)
    cycles = getattr(settings, "Cycles", None)
    if not isinstance(duration, float | int) or not isinstance(cycles, int):
        return False
    if not 0.0 <= duration < math.inf or cycles not in (0, 1):
        return False
    return endless or duration > 0.0 or cycles == 1 or bool(getattr(settings, "DataAvailable", False))


def bad(code: str) -> Any:
    """The status code of that name."""
    ua = ua_types()
    return ua.StatusCode(ua.UInt32(getattr(ua.StatusCodes, code)))
