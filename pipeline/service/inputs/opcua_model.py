"""The part of OPC 30010 (AutoID) that an OCR reader needs, loaded from `opcua_autoid.xml`.

http://opcfoundation.org/UA/DI/       TopologyElementType <- ComponentType <- DeviceType;  Objects/DeviceSet
http://opcfoundation.org/UA/AutoID/   AutoIdDeviceType <- OcrReaderDeviceType;  AutoIdScanEventType <- OcrScanEventType
                                      ScanSettings, ScanResult <- OcrScanResult, ScanData, Position, Location ...

asyncua is untyped here: its modules do not export their names as strict type checking wants it, and the types of a
companion specification come into being only while a server runs.

Raises:
    MissingExtraError: on import, asyncua is not installed.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from glyphs.errors import MissingExtraError

try:
    from asyncua import ua as _untyped
except ImportError as error:
    raise MissingExtraError("OPC UA", "asyncua", "opcua") from error

ua: Any = _untyped
DI_URI = "http://opcfoundation.org/UA/DI/"
AUTOID_URI = "http://opcfoundation.org/UA/AutoID/"
READER_URI = "urn:tactile-marks:reader"
NODE_SET = Path(__file__).with_name("opcua_autoid.xml")
