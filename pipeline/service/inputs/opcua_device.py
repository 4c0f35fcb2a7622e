"""The device of the OPC UA server: its nodes, its users, and the requests that it accepts.

The part of OPC 30010 (AutoID) that an OCR reader needs is loaded from `opcua_autoid.xml`.

http://opcfoundation.org/UA/DI/       TopologyElementType <- ComponentType <- DeviceType;  Objects/DeviceSet
http://opcfoundation.org/UA/AutoID/   AutoIdDeviceType <- OcrReaderDeviceType;  AutoIdScanEventType <- OcrScanEventType
                                      ScanSettings, ScanResult <- OcrScanResult, ScanData, Position, Location ...

asyncua is untyped here: its modules do not export their names as strict type checking wants it, and the types of a
companion specification come into being only while a server runs.

Raises:
    MissingExtraError: on import, asyncua is not installed.
"""

from __future__ import annotations

import hmac
import math
from collections.abc import Callable, Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

from glyphs.errors import MissingExtraError
from pipeline.common.version import program_version

try:
    from asyncua import ua as _untyped
    from asyncua.crypto.permission_rules import User, UserRole
    from asyncua.server.user_managers import UserManager
except ImportError as error:
    raise MissingExtraError("OPC UA", "asyncua", "opcua") from error

ua: Any = _untyped
DI_URI = "http://opcfoundation.org/UA/DI/"
AUTOID_URI = "http://opcfoundation.org/UA/AutoID/"
READER_URI = "urn:tactile-marks:reader"
NODE_SET = Path(__file__).with_name("opcua_autoid.xml")
# texts that are empty at first, which the file of the model cannot say
_EMPTY = (
    *("DeviceInfo", "LastScanData", "LastPartId", "LastDecision"),
    *("SerialNumber", "DeviceManual", "DeviceRevision", "HardwareRevision"),
)


async def set_up_device(server: Any, methods: Mapping[str, Callable[..., Any]]) -> tuple[dict[str, Any], Any]:
    """Load the model, and set up its device.

    Args:
        server: an initialised server.
        methods: Scan, ScanStart, ScanStop, TriggerPart and TriggerJob.

    Returns:
        Its nodes by name, and the generator of its events.
    """
    uris = (DI_URI, AUTOID_URI, READER_URI)
    _, autoid, reader = [await server.register_namespace(uri) for uri in uris]
    await server.import_xml(NODE_SET)
    await server.load_data_type_definitions()
    device = server.get_node(ua.NodeId("reader", reader))
    nodes = {(await node.read_browse_name()).Name: node for node in await device.get_children()}
    words = {
        **dict.fromkeys(_EMPTY, ""),
        "SoftwareRevision": program_version(),
        "Manufacturer": ua.LocalizedText("tactile-marks"),
        "Model": ua.LocalizedText("camera and whisker array"),
    }
    for name, value in words.items():
        await nodes[name].write_value(value)
    for name, method in methods.items():
        server.link_method(nodes[name], method)
    events = await server.get_event_generator(ua.NodeId(1005, autoid), device)
    events.event.DeviceName = await nodes["DeviceName"].read_value()
    # the node set has no values to take them from
    events.event.data_types |= {
        "DeviceName": ua.VariantType.String,
        "ScanResult": ua.VariantType.ExtensionObject,
    }
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
    """Whether ScanSettings are supported: one cycle, ended by itself, by time, or not at all where allowed."""
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
