"""Split the text of a Data Matrix or QR code into fields, and compare its serial with the one that was read.

    (01)09501101530003(21)KB7402                      GS1 application identifiers
    [)>␞06␝17V0AB12␝1PABC␝SKB7402␞␄                   ISO/IEC 15434, format 06: data identifiers (ANS MH10.8.2)
    [)>␞12␝MFR 0AB12␝SER KB7402␞␄                     format 12 or DD: text elements (ATA Spec 2000, MIL-STD-130)
    MFR 0AB12/SER KB7402                              text elements without an envelope
    https://id.gs1.org/01/09501101530003/21/KB7402    GS1 Digital Link; other addresses: last path segment and query
    SN: KB7402; 4711                                  anything else, split at separators

Control characters appear as their Unicode pictures (U+2400 and up), as `recognition.see.codes` returns them.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from urllib.parse import parse_qsl, unquote, urlsplit

SERIAL_KEYS = frozenset({"21", "S", "SER", "SEQ", "UCN", "SN"})
"""Identifiers of serial fields in GS1, MH10.8.2 and text elements, and a plain "SN"."""
ENDING_KEYS = frozenset({"8003", "8004", "18S", "25S", "UID", "USN", "UST"})
"""Identifiers of a field that ends with a serial, after the issuer and the part number."""
TEXT_ELEMENTS = SERIAL_KEYS | ENDING_KEYS | {
    "BAT", "BII", "CAG", "CNT", "DMF", "DUN", "EUC", "EXP", "LOT", "LTN", "MFR", "PML", "PNO", "PNR", "SPL",
}  # fmt: skip
"""Identifiers of text elements that are recognised without an envelope."""
URL_KEY = "url"
"""Key of a part of a web address that is not known to be a serial."""
_ENVELOPE = re.compile(r"\[\)>(?:␞|<RS>)?(?P<format>0[56]|12|DD)(?:␝|<GS>)(?P<fields>.*)", re.DOTALL)
_SEPARATORS = re.compile(r"[␝␞␄]|<(?:GS|RS|EOT)>")
_AI = re.compile(r"\((\d{2,4})\)")
_DI = re.compile(r"(\d{0,3}[A-Z])(.*)", re.DOTALL)
_ELEMENT = re.compile(r"([A-Z]{3}) (.+)", re.DOTALL)
_BETWEEN_ELEMENTS = re.compile(r"/(?=[A-Z]{3} )|[␝␞␄]")
_LABEL = re.compile(r"(?:s/?n|ser(?:ial)?)[.\s]*(?:no|nr|number)?[.\s]*[:=#]\s*(.+)", re.IGNORECASE)
_QUERY_LABELS = frozenset({"s", "sn", "ser", "serial", "serialnumber", "serial_number", "21"})
_BETWEEN = re.compile(r"[;,|\t\r\n␝␞␄␉␊␍]|<(?:GS|RS|EOT|LF|CR|HT)>")


@dataclass(frozen=True)
class CodeField:
    """One field: its identifier ("SER", "21"; empty if it has none) and its value."""

    key: str
    value: str


def fields_of(text: str) -> tuple[CodeField, ...]:
    """Split a code's text into its fields, in order; the module docstring lists the notations."""
    if (envelope := _ENVELOPE.match(text)) is not None:
        return _envelope_fields(envelope["format"], envelope["fields"])
    if _AI.match(text):
        pieces = _AI.split(text)
        return tuple(CodeField(k, v) for k, v in zip(pieces[1::2], pieces[2::2], strict=True))
    if re.match(r"https?://", text, re.IGNORECASE):
        return _address_fields(text)
    elements = [_ELEMENT.fullmatch(piece) for piece in _BETWEEN_ELEMENTS.split(text) if piece]
    if all(match is not None and match[1] in TEXT_ELEMENTS for match in elements):
        return tuple(CodeField(match[1], match[2]) for match in elements if match is not None)
    pieces = [piece.strip() for piece in _BETWEEN.split(text) if piece.strip()]
    return tuple(
        CodeField("SN", label[1]) if (label := _LABEL.fullmatch(piece)) else CodeField("", piece)
        for piece in pieces
    )


def holds(text: str, serial: str) -> bool | None:
    """Whether a code contains a serial, in fields marked so, or in any; None if all are marked as something else."""
    if serial and _bare(text) == _bare(serial):
        return True
    # a marking may have identifiers, too: "SER KB7402" is the serial KB7402
    serial = _bare(next((field.value for field in fields_of(serial) if field.key in SERIAL_KEYS), serial))
    fields = fields_of(text)
    serials = [f for f in fields if f.key in SERIAL_KEYS | ENDING_KEYS]
    if any(_matches(f, serial) for f in serials or fields):
        return True
    return False if serials or any(not f.key for f in fields) else None


def _matches(field: CodeField, serial: str, *, least_ending: int = 3) -> bool:
    # least_ending: least length of a serial that is looked for at the end of a field; a shorter one matches by chance
    value = _bare(field.value)
    if field.key in ENDING_KEYS and len(serial) >= least_ending:
        return value.endswith(serial)
    return bool(serial) and value == serial


def _bare(text: str) -> str:
    return "".join(text.split())


def _envelope_fields(format: str, fields: str) -> tuple[CodeField, ...]:
    pieces = [piece for piece in _SEPARATORS.split(fields) if piece]
    if format == "05":
        # application identifiers without brackets; only the one of a serial matters here
        return tuple(CodeField(p[:2], p[2:]) if p[:2] == "21" else CodeField("AI", p) for p in pieces)
    pattern = _DI if format == "06" else _ELEMENT
    matches = [(piece, pattern.fullmatch(piece)) for piece in pieces]
    return tuple(
        CodeField("", piece) if match is None else CodeField(match[1], match[2]) for piece, match in matches
    )


def _address_fields(text: str) -> tuple[CodeField, ...]:
    try:
        address = urlsplit(text)
    except ValueError:  # urllib cannot parse it
        return (CodeField("", text),)
    steps = [unquote(step) for step in address.path.split("/") if step]
    query = [
        CodeField("SN" if key.lower() in _QUERY_LABELS else URL_KEY, value)
        for key, value in parse_qsl(address.query)
    ]
    if "01" in steps:
        steps = steps[steps.index("01") :]
        if all(key.isdigit() for key in steps[::2]) and len(steps) % 2 == 0:
            pairs = zip(steps[::2], steps[1::2], strict=True)
            return (*(CodeField(key, value) for key, value in pairs), *query)
    return (*(CodeField(URL_KEY, step) for step in steps[-1:]), *query)
