"""Data types of OPC 30010 that an OCR reader needs: their published ids, fields and order."""

from __future__ import annotations

from typing import Any

from pipeline.service.line.opcua_library import ua_types

STATUSES = (
    *("SUCCESS", "MISC_ERROR_TOTAL", "MISC_ERROR_PARTIAL", "PERMISSON_ERROR", "PASSWORD_ERROR"),
    *("REGION_NOT_FOUND_ERROR", "OP_NOT_POSSIBLE_ERROR", "OUT_OF_RANGE_ERROR", "NO_IDENTIFIER"),
    *("MULTIPLE_IDENTIFIERS", "READ_ERROR", "DECODING_ERROR", "MATCH_ERROR", "CODE_NOT_SUPPORTED"),
    *("WRITE_ERROR", "NOT_SUPPORTED_BY_DEVICE", "NOT_SUPPORTED_BY_TAG", "DEVICE_NOT_READY"),
    *("INVALID_CONFIGURATION", "RF_COMMUNICATION_ERROR", "DEVICE_FAULT", "TAG_HAS_LOW_BATTERY"),
)
_ENUMS = (
    ("DeviceStatusEnumeration", 3003, ("Idle", "Error", "Scanning", "Busy")),
    ("LocationTypeEnumeration", 3009, ("NMEA", "LOCAL", "WGS84", "NAME")),
    ("AutoIdOperationStatusEnumeration", 3013, STATUSES),
)
# name, id of the type, id of its binary encoding, fields; an own type by its number, ? where optional
_STRUCTURES: tuple[tuple[str, int, int, tuple[tuple[str, str | int], ...]], ...] = (
    (
        "ScanDataEpc",
        3024,
        5036,
        (("PC", "UInt16"), ("UId", "ByteString"), ("XPC_W1", "UInt16"), ("XPC_W2", "UInt16")),
    ),
    (
        "Position",
        3004,
        5007,
        tuple((n, "Int32") for n in ("PositionX", "PositionY", "SizeX", "SizeY", "Rotation")),
    ),
    (
        "LocalCoordinate",
        3019,
        5028,
        (
            *(("X", "Double"), ("Y", "Double"), ("Z", "Double"), ("Timestamp", "UtcTime")),
            *(("DilutionOfPrecision", "Double"), ("UsefulPrecision", "Int32")),
        ),
    ),
    (
        "WGS84Coordinate",
        3027,
        5046,
        (
            *(("N/S Hemisphere", "String"), ("Latitude", "Double"), ("E/W Hemisphere", "String")),
            *(("Longitude", "Double"), ("Altitude", "Double"), ("Timestamp", "UtcTime")),
            *(
                ("DilutionOfPrecision", "Double"),
                ("UsefulPrecisionLatLon", "Int32"),
                ("UsefulPrecisionAlt", "Int32"),
            ),
        ),
    ),
    (
        "ScanSettings",
        3010,
        5015,
        (
            ("Duration", "Duration"),
            ("Cycles", "Int32"),
            ("DataAvailable", "Boolean"),
            ("LocationType?", 3009),
        ),
    ),
)
_UNIONS: tuple[tuple[str, int, int, tuple[tuple[str, str | int], ...]], ...] = (
    ("Location", 3008, 5013, (("NMEA", "String"), ("Local", 3019), ("WGS84", 3027), ("Name", "String"))),
    (
        "ScanData",
        3020,
        5030,
        (("ByteString", "ByteString"), ("String", "String"), ("Epc", 3024), ("Custom", "BaseDataType")),
    ),
)
_SCAN_RESULT = (("CodeType", "String"), ("ScanData", 3020), ("Timestamp", "UtcTime"), ("Location?", 3008))
_OCR_RESULT = (
    *(("ImageId", "NodeId"), ("Quality", "Byte"), ("Position", 3004)),
    *(("Font?", "String"), ("DecodingTime?", "UtcTime")),
)


async def add_data_types(server: Any, autoid: int) -> None:
    """Add them to a server."""
    ua = ua_types()
    from asyncua.common.structures104 import new_enum

    for name, number, members in _ENUMS:
        await new_enum(server, node_id(autoid, number), qualified(autoid, name), list(members))
    await server.get_node(ua.NodeId(ua.ObjectIds.String)).add_data_type(
        node_id(autoid, 3031), qualified(autoid, "CodeTypeDataType")
    )
    base, union = server.nodes.base_structure_type, server.nodes.base_union_type
    for name, number, encoding, fields in _STRUCTURES:
        await _structure(base, autoid, name, number, encoding, fields)
    for name, number, encoding, fields in _UNIONS:
        await _structure(union, autoid, name, number, encoding, fields, union=True)
    result = await _structure(base, autoid, "ScanResult", 3001, 5002, _SCAN_RESULT)
    await _structure(result, autoid, "OcrScanResult", 3002, 5004, (*_SCAN_RESULT, *_OCR_RESULT))
    # after its subtype was added: abstract types are so for clients, that get no value of just this type
    await result.write_attribute(ua.AttributeIds.IsAbstract, ua.DataValue(ua.Variant(True)))


async def _structure(
    parent: Any,
    autoid: int,
    name: str,
    number: int,
    encoding: int,
    fields: tuple[tuple[str, str | int], ...],
    *,
    union: bool = False,
) -> Any:
    """A structure below its parent; fields inherited stand first, as OPC 10000-3 has it."""
    ua = ua_types()
    from asyncua.common.manage_nodes import create_encoding
    from asyncua.common.structures104 import new_struct_field

    node = await parent.add_data_type(node_id(autoid, number), qualified(autoid, name))
    code = await create_encoding(node, node_id(autoid, encoding), ua.QualifiedName("Default Binary", 0))
    definition = ua.StructureDefinition()
    definition.BaseDataType = parent.nodeid
    definition.DefaultEncodingId = code.nodeid
    definition.Fields = [
        new_struct_field(
            field.rstrip("?"),
            node_id(autoid, kind) if isinstance(kind, int) else ua.NodeId(getattr(ua.ObjectIds, kind)),
            optional=field.endswith("?"),
        )
        for field, kind in fields
    ]
    optional = any(field.endswith("?") for field, _ in fields)
    kinds = ua.StructureType
    definition.StructureType = (
        kinds.Union if union else kinds.StructureWithOptionalFields if optional else kinds.Structure
    )
    await node.write_data_type_definition(definition)
    return node


def node_id(namespace: int, number: int | str) -> Any:
    """The id of a node."""
    return ua_types().NodeId(number, namespace)


def qualified(namespace: int, name: str) -> Any:
    """The name that a node is browsed by."""
    return ua_types().QualifiedName(name, namespace)


def scan_settings_argument(autoid: int) -> Any:
    """The argument Settings of Scan and ScanStart."""
    return _argument("Settings", autoid, 3010)


def scan_outputs(autoid: int) -> list[Any]:
    """The results of Scan."""
    return [_argument("Results", autoid, 3002, array=True), status_output(autoid)]


def status_output(autoid: int) -> Any:
    """The result Status of Scan and ScanStart."""
    return _argument("Status", autoid, 3013)


def plain_argument(name: str, kind: Any) -> Any:
    """An argument of a type that every client knows."""
    ua = ua_types()
    return ua.Argument(Name=name, DataType=ua.NodeId(kind.value), ValueRank=ua.ValueRank.Scalar)


def _argument(name: str, autoid: int, number: int, *, array: bool = False) -> Any:
    ua = ua_types()
    rank = ua.ValueRank.OneDimension if array else ua.ValueRank.Scalar
    return ua.Argument(Name=name, DataType=node_id(autoid, number), ValueRank=rank)
