"""Fields of the text of a Data Matrix or QR code, and whether one of them is a serial.

    (01)09501101530003(21)KB7402                      GS1 application identifiers
    [)>␞06␝17V0AB12␝1PABC␝SKB7402␞␄                   ISO/IEC 15434, format 06: data identifiers (ANS MH10.8.2)
    [)>␞12␝MFR 0AB12␝SER KB7402␞␄                     format 12 or DD: text elements (ATA Spec 2000, MIL-STD-130)
    MFR 0AB12/SER KB7402                              text elements without an envelope
    https://id.gs1.org/01/09501101530003/21/KB7402    GS1 Digital Link; of other addresses the last step and the query
    SN: KB7402; 4711                                  anything else, between separators

Control characters are written as their pictures (U+2400 and on), as `recognition.views.codes` gives them.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from urllib.parse import parse_qsl, unquote, urlsplit

SERIAL_KEYS = frozenset({"21", "S", "SER", "SEQ", "UCN", "SN"})
"""Identifiers of a field that is a serial: of GS1, of MH10.8.2, of text elements, and a plain "SN"."""
ENDING_KEYS = frozenset({"8003", "8004", "18S", "25S", "UID", "USN", "UST"})
"""Identifiers of a field that ends with a serial, after the issuer and the part number."""
TEXT_ELEMENTS = SERIAL_KEYS | ENDING_KEYS | {
    "BAT", "BII", "CAG", "CNT", "DMF", "DUN", "EUC", "EXP", "LOT", "LTN", "MFR", "PML", "PNO", "PNR", "SPL",
}  # fmt: skip
"""Identifiers that are known for such where no envelope says that they are."""
URL_KEY = "url"
"""Name of an unnamed piece of an address."""
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
    """One field: what it is ("SER", "21"; empty where nothing says so), and what it holds."""

    key: str
    value: str


def fields_of(text: str) -> tuple[CodeField, ...]:
    """The fields of a code's text, in their order; see above for the ways of writing them."""
    if (found := _ENVELOPE.match(text)) is not None:
        return _envelope_fields(found["format"], found["fields"])
    if _AI.match(text):
        pieces = _AI.split(text)
        return tuple(CodeField(k, v) for k, v in zip(pieces[1::2], pieces[2::2], strict=True))
    if re.match(r"https?://", text, re.IGNORECASE):
        return _of_address(text)
    elements = [_ELEMENT.fullmatch(piece) for piece in _BETWEEN_ELEMENTS.split(text) if piece]
    if all(one is not None and one[1] in TEXT_ELEMENTS for one in elements):
        return tuple(CodeField(one[1], one[2]) for one in elements if one is not None)
    pieces = [piece.strip() for piece in _BETWEEN.split(text) if piece.strip()]
    return tuple(
        CodeField("SN", label[1]) if (label := _LABEL.fullmatch(piece)) else CodeField("", piece)
        for piece in pieces
    )


def holds(text: str, serial: str) -> bool | None:
    """Whether a code holds a serial; blanks do not count.

    Where fields say that they are serials, these alone are asked; else any field may be it. None where all fields say
    that they are something else: the code then speaks of the part, but not of its serial.

    Args:
        text: of the code.
        serial: as read.
    """
    if serial and _bare(text) == _bare(serial):
        return True
    # a marking may say its fields, too: "SER KB7402" is the serial KB7402
    serial = _bare(next((field.value for field in fields_of(serial) if field.key in SERIAL_KEYS), serial))
    fields = fields_of(text)
    serials = [f for f in fields if f.key in SERIAL_KEYS | ENDING_KEYS]
    if any(_is(f, serial) for f in serials or fields):
        return True
    return False if serials or any(not f.key for f in fields) else None


def _is(field: CodeField, serial: str, *, least_ending: int = 3) -> bool:
    # least_ending: characters of a serial that a longer field may end with by more than chance.
    value = _bare(field.value)
    if field.key in ENDING_KEYS and len(serial) >= least_ending:
        return value.endswith(serial)
    return bool(serial) and value == serial


def _bare(text: str) -> str:
    return "".join(text.split())


def _envelope_fields(format: str, fields: str) -> tuple[CodeField, ...]:
    pieces = [piece for piece in _SEPARATORS.split(fields) if piece]
    if format == "05":
        # application identifiers without brackets; that of a serial is all that matters here
        return tuple(CodeField(p[:2], p[2:]) if p[:2] == "21" else CodeField("AI", p) for p in pieces)
    pattern = _DI if format == "06" else _ELEMENT
    found = [(piece, pattern.fullmatch(piece)) for piece in pieces]
    return tuple(CodeField("", piece) if one is None else CodeField(one[1], one[2]) for piece, one in found)


def _of_address(text: str) -> tuple[CodeField, ...]:
    try:
        address = urlsplit(text)
    except ValueError:  # as urllib words it: no address that it knows
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
