"""The part of OPC 30010 (AutoID) that an OCR reader needs, as nodes, with the companion specification's own ids.

http://opcfoundation.org/UA/DI/       TopologyElementType <- ComponentType <- DeviceType;  Objects/DeviceSet
http://opcfoundation.org/UA/AutoID/   AutoIdDeviceType <- OcrReaderDeviceType;  AutoIdScanEventType <- OcrScanEventType
                                      ScanSettings, ScanResult <- OcrScanResult, ScanData, Position, Location ...

Names, ids and fields are those of the published node sets (AutoID 1.01, DI 1.04); nothing of them is copied but that.
What an OCR reader has no use for is left out: RFID, RTLS, optical code readers, access and diagnostics events,
Images, GetDeviceLocation, locks. A client finds what there is by browsing, as ever with OPC UA.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pipeline.service.line.opcua_library import ua_types
from pipeline.service.line.opcua_types import add_data_types, node_id, qualified

DI_URI = "http://opcfoundation.org/UA/DI/"
AUTOID_URI = "http://opcfoundation.org/UA/AutoID/"
READER_URI = "urn:tactile-marks:reader"


@dataclass(frozen=True)
class Model:
    """What was built.

    Attributes:
        di, autoid, reader: indexes of the namespaces.
        ocr_reader: the type of the device.
        ocr_event: the type of its events.
        device_set: where devices are found.
    """

    di: int
    autoid: int
    reader: int
    ocr_reader: Any
    ocr_event: Any
    device_set: Any


async def build_model(server: Any) -> Model:
    """Build the types into a server that has been initialised."""
    ua = ua_types()
    di = await server.register_namespace(DI_URI)
    autoid = await server.register_namespace(AUTOID_URI)
    reader = await server.register_namespace(READER_URI)
    await add_data_types(server, autoid)
    await server.load_data_type_definitions()
    device = await _device_type(server, di)

    base_event = server.get_node(ua.ObjectIds.BaseEventType)
    scan_event = await base_event.add_object_type(
        node_id(autoid, 1004), qualified(autoid, "AutoIdScanEventType")
    )
    await _property(
        scan_event, node_id(autoid, 6049), qualified(autoid, "DeviceName"), "", ua.VariantType.String
    )
    ocr_event = await scan_event.add_object_type(node_id(autoid, 1005), qualified(autoid, "OcrScanEventType"))
    result = await ocr_event.add_property(
        node_id(autoid, 6041),
        qualified(autoid, "ScanResult"),
        [],
        varianttype=ua.VariantType.ExtensionObject,
        datatype=node_id(autoid, 3002),
    )
    await result.write_value_rank(ua.ValueRank.OneDimension)
    await result.set_modelling_rule(True)

    auto_id = await device.add_object_type(node_id(autoid, 1001), qualified(autoid, "AutoIdDeviceType"))
    ocr_reader = await auto_id.add_object_type(
        node_id(autoid, 1002), qualified(autoid, "OcrReaderDeviceType")
    )
    await _device_members(auto_id, autoid)
    for node in (scan_event, auto_id):
        await node.write_attribute(ua.AttributeIds.IsAbstract, ua.DataValue(ua.Variant(True)))
    for kind, event in ((auto_id, scan_event), (ocr_reader, ocr_event)):
        await kind.add_reference(event, ua.ObjectIds.GeneratesEvent)
    device_set = await server.nodes.objects.add_object(node_id(di, 5001), qualified(di, "DeviceSet"))
    return Model(di, autoid, reader, ocr_reader, ocr_event, device_set)


async def _device_type(server: Any, di: int) -> Any:
    ua = ua_types()
    node = server.nodes.base_object_type
    for number, name in ((1001, "TopologyElementType"), (15063, "ComponentType"), (1002, "DeviceType")):
        node = await node.add_object_type(node_id(di, number), qualified(di, name))
        await node.write_attribute(ua.AttributeIds.IsAbstract, ua.DataValue(ua.Variant(True)))
    text, plain = ua.VariantType.LocalizedText, ua.VariantType.String
    for number, name in ((6003, "Manufacturer"), (6004, "Model")):
        await _property(node, node_id(di, number), qualified(di, name), ua.LocalizedText(""), text)
    for number, name in (
        *((6001, "SerialNumber"), (6005, "DeviceManual"), (6006, "DeviceRevision")),
        *((6007, "SoftwareRevision"), (6008, "HardwareRevision")),
    ):
        await _property(node, node_id(di, number), qualified(di, name), "", plain)
    await _property(node, node_id(di, 6002), qualified(di, "RevisionCounter"), -1, ua.VariantType.Int32)
    return node


async def _device_members(node: Any, autoid: int) -> None:
    ua = ua_types()
    kinds = ua.VariantType
    for number, name, words in (
        (6124, "DeviceName", ""),
        (6026, "DeviceInfo", ""),
        (6193, "AutoIdModelVersion", "1.01"),
    ):
        await _property(node, node_id(autoid, number), qualified(autoid, name), words, kinds.String)
    members: tuple[tuple[int, str, Any, Any, Any], ...] = (
        (6030, "DeviceStatus", 0, kinds.Int32, node_id(autoid, 3003)),
        (6055, "LastScanData", "", kinds.String, ua.NodeId(ua.ObjectIds.BaseDataType)),
        (6096, "LastScanTimestamp", None, kinds.DateTime, ua.NodeId(ua.ObjectIds.UtcTime)),
    )
    for number, name, value, kind, data_type in members:
        member = await node.add_variable(
            node_id(autoid, number), qualified(autoid, name), value, varianttype=kind, datatype=data_type
        )
        await member.set_modelling_rule(True)


async def _property(node: Any, number: Any, name: Any, value: Any, kind: Any) -> None:
    member = await node.add_property(number, name, value, varianttype=kind)
    await member.set_modelling_rule(True)
