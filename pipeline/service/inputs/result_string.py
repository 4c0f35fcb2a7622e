"""The result string: one line of text for a controller, from a format with named fields.

{name};{decision};{text};{confidence:.3f};{source};{id}      P17;ACCEPT;KX407251;0.998;fused;01JD...

Characters of a value that could be mistaken for the format's own punctuation, invisible characters and % itself are
written as %XX (the bytes of their UTF-8, as in web addresses): a serial A;B is sent as A%3BB. A controller whose
serials contain no such characters need not decode; one that decodes %XX gets back exactly what was read.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from string import Formatter

from glyphs.errors import MarksError
from glyphs.plain_text import is_hidden
from pipeline.common.reading_records import ReadingRecord
from pipeline.common.records import PartRecord
from pipeline.common.row import codes_text, fields_text, lines_text
from pipeline.service.inputs.trigger import NO_READING, decision_of

DEFAULT_FORMAT = "{name};{decision};{text};{confidence:.3f};{source};{id}"
# fields of the part, and of its reading
_OF_PART = ("name", "text", "id", "state", "expected", "database", "job")
_OF_READING = ("source", "verdict", "font")
_MADE: dict[str, Callable[[PartRecord, ReadingRecord], str]] = {
    "decision": lambda part, _: decision_of(part).value,
    "lines": lambda _, reading: lines_text(reading.lines),
    "codes": lambda _, reading: codes_text(reading.codes),
    "fields": lambda _, reading: fields_text(reading.fields),
}
TEXT_FIELDS = (*_OF_PART, *_OF_READING, *_MADE)
NUMBER_FIELDS = ("confidence", "height_mm", "rotation_deg", "seconds")
_SPEC = re.compile(r"0?[0-9]{0,2}(\.[0-9]{1,2}f)?")
_LONGEST = 500


class ResultStringError(MarksError):
    """An invalid format of result strings."""


class ResultString:
    """Makes result strings of one format."""

    def __init__(self, template: str = DEFAULT_FORMAT) -> None:
        """Check the format.

        Raises:
            ResultStringError: an unknown field, one written as no number can be, or a control character.
        """
        self.template = template
        if not template or len(template) > _LONGEST:
            raise ResultStringError(
                f"a result format has 1 to {_LONGEST} characters, this one {len(template)}"
            )
        try:
            parsed = list(Formatter().parse(template))
        except ValueError as error:
            raise ResultStringError(f"the result format {template!r} is broken: {error}") from error
        literals = "".join(literal for literal, *_ in parsed)
        if any(map(is_hidden, literals)):
            raise ResultStringError(
                "a result format has no control characters", hint="the line's end is added"
            )
        for _, field, spec, conversion in parsed:
            if field is not None:
                _check_field(field, spec or "", conversion)
        if not any(field for _, field, *_ in parsed):
            raise ResultStringError(f"the result format {template!r} names no field, such as {{text}}")
        self._kept_apart = frozenset(char for char in literals if not char.isalnum()) | {"%"}

    def of(self, part: PartRecord) -> str:
        """The result string of a part, without the line's end."""
        reading = part.reading or NO_READING
        texts = {name: str(getattr(part, name)) for name in _OF_PART}
        texts |= {name: getattr(reading, name) for name in _OF_READING}
        texts |= {name: make(part, reading) for name, make in _MADE.items()}
        texts = {name: self._quoted(text) for name, text in texts.items()}
        numbers = {name: getattr(reading, name) or 0.0 for name in NUMBER_FIELDS}
        return self.template.format(**texts, **numbers)

    def _quoted(self, text: str) -> str:
        return "".join(
            _percent(char) if char in self._kept_apart or is_hidden(char) else char for char in text
        )


def _percent(char: str) -> str:
    return "".join(f"%{byte:02X}" for byte in char.encode("utf-8", "surrogatepass"))


def _check_field(field: str, spec: str, conversion: str | None) -> None:
    known = (*TEXT_FIELDS, *NUMBER_FIELDS)
    if field not in known:  # so no attribute or index can be reached through a format
        raise ResultStringError(f"the result format asks for {field!r}", hint=f"there are {', '.join(known)}")
    if conversion or (spec and (field in TEXT_FIELDS or not _SPEC.fullmatch(spec))):
        raise ResultStringError(
            f"the field {field} cannot be written as {spec or conversion!r}", hint="numbers as .3f"
        )
