"""Convert a part to OPC 30010: OcrScanResult and the status of a scan.

CodeType   RAW:STRING           ScanData  the serial as a string
Quality    confidence in whole percent, rounded down: only full confidence gives 100
Position   bounding box of the characters in the frame that was read, in micrometres: the specification's pixels are
           those of a camera, and whiskers have none. PositionX and PositionY are its least x and y, and Rotation is
           the rotation of the line in degrees
Timestamp  time of the reading  Font      font that matched best
ImageId    null                 Location and DecodingTime are left out
"""

from __future__ import annotations

import math
from datetime import UTC
from typing import Any

from pipeline.common.reading_records import ReadingRecord
from pipeline.common.records import PartRecord, PartState
from pipeline.service.inputs.opcua_model import ua
from pipeline.service.inputs.trigger import NO_READING, LineDecision, decision_of

SUCCESS, NO_IDENTIFIER, DECODING_ERROR, MATCH_ERROR = 0, 8, 11, 12
DEVICE_NOT_READY, DEVICE_FAULT = 17, 20
CODE_TYPE = "RAW:STRING"
_UM_PER_MM = 1000.0
_INT32 = 2**31 - 1


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
    """Convert a part to an OcrScanResult; load the model first (`opcua_model`)."""
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
