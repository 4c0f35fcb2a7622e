"""The device of the OPC UA server: its nodes, its users, and the requests that it accepts."""

from __future__ import annotations

import hmac
import math
from collections.abc import Callable, Mapping
from datetime import datetime
from typing import Any

from asyncua.crypto.permission_rules import User, UserRole
from asyncua.server.user_managers import UserManager

from pipeline.common.version import program_version
from pipeline.service.inputs.opcua_model import Model, ua


async def build_device(
    server: Any, model: Model, *, name: str, methods: Mapping[str, Callable[..., Any]]
) -> tuple[dict[str, Any], Any]:
    """Put the device into DeviceSet.

    Args:
        server: with the model loaded.
        model: of the specification.
        name: of the device.
        methods: Scan, ScanStart, ScanStop, TriggerPart and TriggerJob.

    Returns:
        Its variables by name, and the generator of its events.
    """
    kinds, own = ua.VariantType, model.reader

    def named(namespace: int, one: str) -> tuple[Any, Any]:
        return ua.NodeId(f"reader.{one}", own), ua.QualifiedName(one, namespace)

    def argument(one: str, kind: Any, rank: Any = ua.ValueRank.Scalar) -> Any:
        return ua.Argument(Name=one, DataType=kind, ValueRank=rank)

    device = await model.device_set.add_object(
        ua.NodeId("reader", own), ua.QualifiedName(name, own), objecttype=model.ocr_reader.nodeid
    )
    nodes: dict[str, Any] = {}
    for namespace, one, value in (
        (model.autoid, "DeviceName", name),
        (model.autoid, "DeviceInfo", ""),
        (model.autoid, "AutoIdModelVersion", "1.01"),
        (model.autoid, "DeviceStatus", ua.Variant(0, kinds.Int32)),
        (model.autoid, "LastScanData", ""),
        (model.autoid, "LastScanTimestamp", ua.Variant(None, kinds.DateTime)),
        (model.di, "Manufacturer", ua.LocalizedText("tactile-marks")),
        (model.di, "Model", ua.LocalizedText("camera and whisker array")),
        (model.di, "SoftwareRevision", program_version()),
        (model.di, "RevisionCounter", ua.Variant(-1, kinds.Int32)),
        *(
            (model.di, one, "")
            for one in ("SerialNumber", "DeviceManual", "DeviceRevision", "HardwareRevision")
        ),
    ):
        nodes[one] = await device.get_child(ua.QualifiedName(one, namespace))
        await nodes[one].write_value(value)
    for one, first in (("LastPartId", ""), ("LastDecision", ""), ("LastConfidence", 0.0)):
        nodes[one] = await device.add_variable(*named(own, one), first)
    text, number = ua.NodeId(kinds.String.value), ua.NodeId(kinds.Double.value)
    settings = argument("Settings", ua.NodeId(3010, model.autoid))
    status = argument("Status", ua.NodeId(3013, model.autoid))
    results = argument("Results", ua.NodeId(3002, model.autoid), ua.ValueRank.OneDimension)
    plain = [argument(one, text) for one in ("PartId", "Text", "Decision")]
    plain += [argument("Confidence", number), argument("Source", text)]
    called = [argument(one, text) for one in ("PartName", "JobName")]
    for namespace, one, inputs, outputs in (
        (model.autoid, "Scan", [settings], [results, status]),
        (model.autoid, "ScanStart", [settings], [status]),
        (model.autoid, "ScanStop", [], []),
        (own, "TriggerPart", called[:1], plain),
        (own, "TriggerJob", called, plain),
    ):
        await device.add_method(*named(namespace, one), methods[one], inputs, outputs)
    events = await server.get_event_generator(model.ocr_event, device)
    events.event.DeviceName = name
    # the node set has no values to take them from
    events.event.data_types |= {"DeviceName": kinds.String, "ScanResult": kinds.ExtensionObject}
    return nodes, events


class Users(UserManager):
    """Users of the server, by name and password; each may read, subscribe and call, but not write.

    Attributes:
        denied: the user name that was refused last.
    """

    def __init__(self, passwords: Mapping[str, str]) -> None:
        self._passwords = dict(passwords)
        self.denied = ""

    def get_user(
        self, _server: Any, username: str | None = None, password: str | None = None, certificate: Any = None
    ) -> Any:
        """The user, or None if the name or password is wrong."""
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
    duration, cycles = getattr(settings, "Duration", None), getattr(settings, "Cycles", None)
    if not isinstance(duration, float | int) or not 0.0 <= duration < math.inf or cycles not in (0, 1):
        return False
    return endless or duration > 0.0 or cycles == 1 or bool(getattr(settings, "DataAvailable", False))


def bad(code: str) -> Any:
    """The status code of that name."""
    return ua.StatusCode(ua.UInt32(getattr(ua.StatusCodes, code)))


def variant(value: str | int | float | datetime) -> Any:
    """A value with the type of OPC UA that its nodes have."""
    kinds = {str: "String", int: "Int32", float: "Double", datetime: "DateTime"}
    return ua.Variant(value, getattr(ua.VariantType, kinds[type(value)]))
