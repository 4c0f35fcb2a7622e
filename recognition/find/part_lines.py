"""The lines of a part, as they were read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from recognition.find.layouts import Layout
from recognition.recogniser.read_line import ReadLine
from recognition.see.text_line import TextLine


@dataclass(frozen=True, eq=False)
class PartLines:
    """Lines read on a part in every orientation; `candidates` are like the serial's, `longer` has more characters."""

    main: ReadLine | None
    named: Mapping[str, ReadLine] = field(default_factory=lambda: MappingProxyType({}))
    others: tuple[ReadLine, ...] = ()
    candidates: tuple[TextLine, ...] = ()
    layout: Layout | None = None
    longer: ReadLine | None = None
    looks: int = 0
    stopped: str = ""

    @property
    def places(self) -> tuple[TextLine, ...]:
        """Positions of all lines, that of the serial first."""
        lines = (*(() if self.main is None else (self.main,)), *self.named.values(), *self.others)
        return tuple(read.line for read in lines)
