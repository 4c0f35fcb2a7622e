"""The part of OPC 30010 (AutoID) that an OCR reader needs, loaded from `opcua_autoid.xml`.

http://opcfoundation.org/UA/DI/       TopologyElementType <- ComponentType <- DeviceType;  Objects/DeviceSet
http://opcfoundation.org/UA/AutoID/   AutoIdDeviceType <- OcrReaderDeviceType;  AutoIdScanEventType <- OcrScanEventType
                                      ScanSettings, ScanResult <- OcrScanResult, ScanData, Position, Location ...

asyncua is untyped here: its modules do not export their names as strict type checking wants it, and the types of a
companion specification come into being only while a server runs.
"""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from glyphs.errors import MissingExtraError

DI_URI = "http://opcfoundation.org/UA/DI/"
AUTOID_URI = "http://opcfoundation.org/UA/AutoID/"
READER_URI = "urn:tactile-marks:reader"
NODE_SET = Path(__file__).with_name("opcua_autoid.xml")


def require_asyncua() -> Any:
    """The module asyncua.

    Raises:
        MissingExtraError: it is not installed.
    """
    try:
        return importlib.import_module("asyncua")
    except ImportError as error:
        raise MissingExtraError("OPC UA", "asyncua", "opcua") from error


def ua_types() -> Any:
    """The module asyncua.ua: types of OPC UA, those of loaded specifications included."""
    return require_asyncua().ua


@dataclass(frozen=True)
class Model:
    """Nodes of the model in a server.

    Attributes:
        di, autoid, reader: indexes of the namespaces.
        ocr_reader: type of the device.
        ocr_event: type of its events.
        device_set: parent of devices.
    """

    di: int
    autoid: int
    reader: int
    ocr_reader: Any
    ocr_event: Any
    device_set: Any


async def load_model(server: Any) -> Model:
    """Load the types into a server that has been initialised."""
    di, autoid, reader = [await server.register_namespace(uri) for uri in (DI_URI, AUTOID_URI, READER_URI)]
    await server.import_xml(NODE_SET)
    await server.load_data_type_definitions()
    ids = ((autoid, 1002), (autoid, 1005), (di, 5001))
    return Model(di, autoid, reader, *(server.get_node(ua_types().NodeId(id, ns)) for ns, id in ids))
