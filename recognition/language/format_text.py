"""Formats of serials as text, for settings and the command line.

More than one may be given, and all must hold:

    AA999999, mask:AA 9999   A: capital, a: small letter, 9: digit, *: capital or digit, blank: word gap, others:
                             themselves; \\ makes the next character stand for itself
    re:[A-Z]{2}\\d{4,6}       regular expression for the whole serial without blanks
    sets:AB,0-9,0-9          characters per place; \\ makes the next one stand for itself
    fields:MFR/SER AA9999    text elements and GS1 identifiers by name, see `recognition.language.elements`
    vin                      vehicle identification number; its check digit must hold if it is of North America or China
    vin-na                   vehicle identification number with the check digit of 49 CFR 565.15
    check:luhn               only a check digit
    ...+check=RULE           and a check digit, see `recognition.language.check_digits`
    ...+exclude=IOQ          without these characters, except where a mask: has them literally
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

from glyphs.fonts.serials import FormatError
from recognition.language.check_digits import CheckDigit
from recognition.language.elements import elements_format
from recognition.language.expression import MOST_CHARACTERS, too_many_characters

_FIELDS = {"mask": "format", "re": "expression", "fields": "expression", "sets": "sets"}
"""The field of a grammar that each kind of format sets."""


def parts_of(texts: Iterable[str]) -> dict[str, Any]:
    """The fields of a `recognition.language.grammar.Grammar`, combined from several texts. Raises FormatError."""
    fields: dict[str, Any] = {}
    checks: list[CheckDigit] = []
    exclude = ""
    for text in texts:
        body, options = _options(text)
        kind, value = _kind(body)
        if kind == "check":
            checks.append(CheckDigit.parse(value))
        elif (field := _FIELDS[kind]) in fields:
            name = {"format": "mask", "expression": "re"}.get(field, field)
            raise FormatError(f"the format has two of {name}", hint="give each kind once")
        else:
            fields[field] = _sets(value) if field == "sets" else value
        if kind == "fields":
            fields["elements"] = value
            fields["expression"], more = elements_format(value)
            checks.extend(more)
        checks.extend(CheckDigit.parse(option) for key, option in options if key == "check")
        exclude += "".join(option for key, option in options if key == "exclude")
    return {**fields, "checks": tuple(checks), "exclude": exclude}


_OPTION = re.compile(r"(?P<body>.*)\+(?P<key>check|exclude)=(?P<value>[^+]+)", re.DOTALL)


def _options(text: str) -> tuple[str, list[tuple[str, str]]]:
    options = []
    while (match := _OPTION.fullmatch(text)) is not None:
        text = match["body"]
        options.append((match["key"], match["value"].strip()))
    return text, options[::-1]


def _kind(body: str) -> tuple[str, str]:
    kind, colon, value = body.partition(":")
    if body.lower() in ("vin", "vin-na"):
        return "check", body.lower()
    if not colon or kind not in ("mask", "re", "sets", "check", "fields"):
        if not body:
            raise FormatError(
                "the format is empty",
                hint="write for example AA999999, or re:, sets:, fields:, vin, vin-na or check:",
            )
        return "mask", body
    if not value:
        raise FormatError(f"nothing follows {body!r}", hint="write what the serial must be, or leave it out")
    return kind, value


def _sets(text: str) -> tuple[str, ...]:
    sets, here = [], ""
    tokens = re.findall(r"\\.|[^\\]-[^\\,]|.", text)
    for token in tokens:
        if token == ",":
            sets.append(here)
            here = ""
        elif len(token) == 3:
            if token[0] > token[2]:
                raise FormatError(f"the range {token} in {text!r} runs backwards", hint="swap its ends")
            if ord(token[2]) - ord(token[0]) >= MOST_CHARACTERS:
                raise too_many_characters(text)
            here += "".join(chr(k) for k in range(ord(token[0]), ord(token[2]) + 1))
        else:
            here += token[-1]
    sets.append(here)
    for k, chars in enumerate(sets, start=1):
        if not chars or not chars.isprintable() or " " in chars:
            raise FormatError(
                f"place {k} of {text!r} has no character, or a blank",
                hint="write one set for each place, separated by commas",
            )
    return tuple("".join(dict.fromkeys(chars)) for chars in sets)
