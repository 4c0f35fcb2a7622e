r"""Text elements and application identifiers as formats: markings whose fields carry identifiers.

    fields:SER                        SER KB740215            ATA Spec 2000, MIL-STD-130
    fields:MFR/SER AA999999           MFR 0AB12/SER KB740215  several in a line; a mask narrows a value
    fields:(01)(17)(21)AA999999       (01)09501101530003(17)271231(21)KB740215   GS1, as it is written for people

They become a regular expression, a check digit where one is prescribed, and the blanks that stand after names.
GS1: General Specifications 3.2; of the characters of X..20 the usual ones, a mask names others. Text elements: the
lengths of the DoD Guide to Uniquely Identifying Items (part number 32, serial 30, lot 20, UII 50, DUNS 9, CAGE 5).
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

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


@dataclass(frozen=True)
class Element:
    """Contents of a field.

    Attributes:
        pattern: regular expression of its value.
        meaning: in words.
        check: check digit of the value; empty if there is none.
    """

    pattern: str
    meaning: str
    check: str = ""


ELEMENTS: dict[str, Element] = {
    "MFR": Element(_CAGE, "manufacturer, CAGE code"),
    "SPL": Element(_CAGE, "supplier, CAGE code"),
    "CAG": Element(_CAGE, "enterprise, CAGE code"),
    "DUN": Element(r"\d{9}", "enterprise, DUNS number"),
    "EUC": Element(r"[A-Z0-9\-]{1,13}", "enterprise, GS1 company prefix"),
    "SER": Element(_SERIAL, "serial number within the enterprise"),
    "SEQ": Element(_SERIAL, "serial number within the part number"),
    "UCN": Element(_SERIAL, "unique component identification number"),
    "USN": Element(_UNIQUE, "universal serial number: enterprise and serial"),
    "UST": Element(_UNIQUE, "universal serial tracking number"),
    "UID": Element(_UNIQUE, "unique item identifier"),
    "PNR": Element(_PART, "part number"),
    "PNO": Element(_PART, "original part number"),
    "LOT": Element(_LOT, "lot"),
    "LTN": Element(_LOT, "lot"),
    "BAT": Element(_LOT, "batch"),
    "BII": Element(_LOT, "batch"),
    "DMF": Element(r"(?:19|20)\d\d" + _DAY, "date of manufacture, YYYYMMDD"),
    "EXP": Element(r"(?:19|20)\d\d" + _DAY, "expiry date, YYYYMMDD"),
    "00": Element(r"\d{18}", "logistic unit, SSCC", "gs1"),
    "01": Element(r"\d{14}", "article, GTIN", "gs1"),
    "10": Element(_OWN, "batch or lot"),
    "11": Element(r"\d\d" + _SHORT_DAY, "production date, YYMMDD"),
    "13": Element(r"\d\d" + _SHORT_DAY, "packaging date, YYMMDD"),
    "15": Element(r"\d\d" + _SHORT_DAY, "best before, YYMMDD"),
    "17": Element(r"\d\d" + _SHORT_DAY, "expiry date, YYMMDD"),
    "21": Element(_OWN, "serial number"),
    "240": Element(_LONGER, "additional part number"),
    "241": Element(_LONGER, "customer's part number"),
    "250": Element(_LONGER, "second serial number"),
    "8003": Element(r"0\d{13}[A-Z0-9\-./]{0,16}", "returnable asset, GRAI"),
    "8004": Element(_LONGER, "individual asset, GIAI"),
}
"""Supported fields of formats, by identifier."""
_BRACKETED = re.compile(r"\((\d{2,4})\)([^(]*)")
_BETWEEN = re.compile(r"/(?=[A-Z]{3}(?:[ /]|$))")


def elements_format(text: str) -> tuple[str, tuple[CheckDigit, ...]]:
    """Regular expression and check digits of the text after `fields:`.

    Raises:
        FormatError: an identifier that is not known, an invalid mask, a check digit whose place is not fixed.
    """
    expression, checks = "", []
    place: int | None = 1
    for k, (key, value) in enumerate(_identifiers(text)):
        element = ELEMENTS.get(key)
        if element is None:
            raise FormatError(
                f"there is no element {key!r} in 'fields:{text}'", hint=f"there are {', '.join(ELEMENTS)}"
            )
        begins = f"({key})" if key.isdigit() else f"{'/' if k else ''}{key}"
        pattern = _of_mask(value) if value else element.pattern
        fixed = _fixed_length(value or element.pattern, is_mask=bool(value))
        if element.check:
            if place is None or fixed is None:
                raise FormatError(
                    f"the check digit of ({key}) has no fixed place in 'fields:{text}'",
                    hint=f"write ({key}) before fields whose length may differ, as GS1 does",
                )
            first = place + len(begins)
            checks.append(CheckDigit(element.check, first, first + fixed - 1))
        place = None if place is None or fixed is None else place + len(begins) + fixed
        expression += re.escape(begins) + f"(?:{pattern})"
    return expression, tuple(checks)


def named_fields(text: str) -> dict[str, str]:
    """Return the named fields of a marking, "MFR 0AB12/SER KB7402"; empty without names."""
    return {field.key: field.value for field in fields_of(text) if field.key in ELEMENTS}


def names_before_gaps(text: str) -> frozenset[int]:
    """Places of a text without blanks at which the name of a text element ends: "MFR0AB12/SERKB74" -> 2, 11."""
    found = [re.match(r"[A-Z]{3}(?=.)", text), *re.finditer(r"(?<=/)[A-Z]{3}(?=.)", text)]
    return frozenset(one.end() - 1 for one in found if one is not None and one[0] in ELEMENTS)


def _identifiers(text: str) -> Sequence[tuple[str, str]]:
    """Each identifier and its mask; empty without one."""
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


def _fixed_length(pattern: str, *, is_mask: bool) -> int | None:
    """Number of characters of a value; None if it is not fixed."""
    if is_mask:
        return sum(chars != " " for chars in allowed_characters(pattern))
    from recognition.language.expression import expression_machine
    from recognition.language.remainders import ALPHANUMERIC

    lengths = expression_machine(pattern, tuple(ALPHANUMERIC)).lengths()
    return next(iter(lengths)) if len(lengths) == 1 else None
