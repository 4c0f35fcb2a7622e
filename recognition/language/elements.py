r"""Text elements and application identifiers as formats: markings whose fields carry identifiers.

    fields:SER                        SER KB740215            ATA Spec 2000, MIL-STD-130
    fields:MFR/SER AA999999           MFR 0AB12/SER KB740215  several in a line; a mask narrows a value
    fields:(01)(17)(21)AA999999       (01)09501101530003(17)271231(21)KB740215   GS1, in its human-readable form

GS1: General Specifications 3.2; fields of type X..20 take only A-Z, 0-9 and - . / unless a mask allows others. Text
elements: lengths of the DoD Guide to Uniquely Identifying Items (part number 32, serial 30, lot 20, UII 50, DUNS 9,
CAGE 5).
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from re import _parser  # type: ignore[attr-defined]  # from 3.11 on, as in `expression`

from glyphs.fonts.serials import FormatError, allowed_characters
from recognition.language.check_digits import CheckDigit
from recognition.language.code_text import fields_of

_CAGE = r"[0-9A-HJ-NP-Z]{5}"
_PART, _SERIAL, _LOT, _UNIQUE = (
    r"[A-Z0-9\-./]{1,32}",
    r"[A-Z0-9\-]{1,30}",
    r"[A-Z0-9\-]{1,20}",
    r"[A-Z0-9\-./]{1,50}",
)
_DAY = r"(?:0[1-9]|1[0-2])(?:0[1-9]|[12]\d|3[01])"
_SHORT_DAY = r"(?:0[1-9]|1[0-2])(?:0\d|[12]\d|3[01])"
_OWN, _LONGER = r"[A-Z0-9\-./]{1,20}", r"[A-Z0-9\-./]{1,30}"


ELEMENTS = {
    "MFR": _CAGE,  # manufacturer, CAGE code
    "SPL": _CAGE,  # supplier, CAGE code
    "CAG": _CAGE,  # enterprise, CAGE code
    "DUN": r"\d{9}",  # enterprise, DUNS number
    "EUC": r"[A-Z0-9\-]{1,13}",  # enterprise, GS1 company prefix
    "SER": _SERIAL,  # serial number within the enterprise
    "SEQ": _SERIAL,  # serial number within the part number
    "UCN": _SERIAL,  # unique component identification number
    "USN": _UNIQUE,  # universal serial number: enterprise and serial
    "UST": _UNIQUE,  # universal serial tracking number
    "UID": _UNIQUE,  # unique item identifier
    "PNR": _PART,  # part number
    "PNO": _PART,  # original part number
    "LOT": _LOT,  # lot
    "LTN": _LOT,  # lot
    "BAT": _LOT,  # batch
    "BII": _LOT,  # batch
    "DMF": r"(?:19|20)\d\d" + _DAY,  # date of manufacture, YYYYMMDD
    "EXP": r"(?:19|20)\d\d" + _DAY,  # expiry date, YYYYMMDD
    "00": r"\d{18}",  # logistic unit, SSCC
    "01": r"\d{14}",  # article, GTIN
    "10": _OWN,  # batch or lot
    "11": r"\d\d" + _SHORT_DAY,  # production date, YYMMDD
    "13": r"\d\d" + _SHORT_DAY,  # packaging date, YYMMDD
    "15": r"\d\d" + _SHORT_DAY,  # best before, YYMMDD
    "17": r"\d\d" + _SHORT_DAY,  # expiry date, YYMMDD
    "21": _OWN,  # serial number
    "240": _LONGER,  # additional part number
    "241": _LONGER,  # customer's part number
    "250": _LONGER,  # second serial number
    "8003": r"0\d{13}[A-Z0-9\-./]{0,16}",  # returnable asset, GRAI
    "8004": _LONGER,  # individual asset, GIAI
}
"""Supported fields of formats: identifier, and regular expression of the value."""
CHECKED = ("00", "01")
"""Fields whose value ends with a GS1 check digit."""
_BRACKETED = re.compile(r"\((\d{2,4})\)([^(]*)")
_BETWEEN = re.compile(r"/(?=[A-Z]{3}(?:[ /]|$))")


def elements_format(text: str) -> tuple[str, tuple[CheckDigit, ...]]:
    """Regular expression and check digits of the text after `fields:`. Raises FormatError."""
    expression, checks = "", []
    place: int | None = 1
    for k, (key, value) in enumerate(_identifiers(text)):
        if key not in ELEMENTS:
            raise FormatError(
                f"there is no element {key!r} in 'fields:{text}'", hint=f"there are {', '.join(ELEMENTS)}"
            )
        begins = f"({key})" if key.isdigit() else f"{'/' if k else ''}{key}"
        pattern = _of_mask(value) if value else ELEMENTS[key]
        fixed = _fixed_length(pattern)
        if key in CHECKED:
            if place is None or fixed is None:
                raise FormatError(
                    f"the check digit of ({key}) has no fixed place in 'fields:{text}'",
                    hint=f"write ({key}) before fields of variable length, as GS1 does",
                )
            first = place + len(begins)
            checks.append(CheckDigit("gs1", first, first + fixed - 1))
        place = None if place is None or fixed is None else place + len(begins) + fixed
        expression += re.escape(begins) + f"(?:{pattern})"
    return expression, tuple(checks)


def named_fields(text: str) -> dict[str, str]:
    """Return the named fields of a marking, "MFR 0AB12/SER KB7402"; empty without names."""
    return {field.key: field.value for field in fields_of(text) if field.key in ELEMENTS}


def names_before_gaps(text: str) -> frozenset[int]:
    """Places of a text without blanks at which the name of a text element ends: "MFR0AB12/SERKB74" -> 2, 11."""
    names = [re.match(r"[A-Z]{3}(?=.)", text), *re.finditer(r"(?<=/)[A-Z]{3}(?=.)", text)]
    return frozenset(name.end() - 1 for name in names if name is not None and name[0] in ELEMENTS)


def _identifiers(text: str) -> Sequence[tuple[str, str]]:
    text = text.strip()
    if text.startswith("("):
        pieces = _BRACKETED.findall(text)
        if "".join(f"({key}){value}" for key, value in pieces) != text:
            raise FormatError(f"'fields:{text}' cannot be parsed", hint="write (01)(21) or (21)AA9999")
        return [(key, value.strip()) for key, value in pieces]
    return [(piece[:3], piece[3:].strip()) for piece in _BETWEEN.split(text)]


def _of_mask(mask: str) -> str:
    sets = [chars for chars in allowed_characters(mask) if chars != " "]
    return "".join(re.escape(c) if len(c) == 1 else "[" + re.escape(c) + "]" for c in sets)


def _fixed_length(pattern: str) -> int | None:
    least, most = _parser.parse(pattern).getwidth()
    return int(least) if least == most else None
