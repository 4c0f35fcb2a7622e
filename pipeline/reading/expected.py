"""What parts should bear, and readings held against it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

from glyphs.errors import FileError
from pipeline.common.settings import SettingsError
from pipeline.files.truth import load_truth

if TYPE_CHECKING:
    from recognition.grammar import Grammar
    from recognition.lattice import Lattice
    from recognition.reading import Reading
    from recognition.verify import Verification


@dataclass(frozen=True)
class Expected:
    """The text that each part should bear.

    Attributes:
        text: of every part; empty where `by_part` tells.
        by_part: text by name of the part.
    """

    text: str = ""
    by_part: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))

    def of(self, part: str) -> str | None:
        """The text of a part; None where none is known."""
        if self.text:
            return self.text
        return self.by_part.get(part, self.by_part.get(part.rpartition("/")[2]))

    def not_among(self, parts: Iterable[str]) -> tuple[str, ...]:
        """Parts of the table that are none of these."""
        named = {name for part in parts for name in (part, part.rpartition("/")[2])}
        return tuple(name for name in self.by_part if name not in named)


def load_expected(given: str, grammar: Grammar | None = None) -> Expected:
    """What a command line's `--verify` says: a text, or the name of a CSV table with the columns part and text.

    Args:
        given: a name that ends in .csv, or that there is a file of, is a table's.
        grammar: that every text must be of.

    Raises:
        FileError: no such table, or a text in it that is none of the format.
        SettingsError: an empty text, or one that is none of the format.
    """
    if given.lower().endswith(".csv") or _is_file(given):
        path = Path(given)
        table = load_truth(path)
        for part, text in table.items():
            if not text:
                raise FileError(path, f"gives no text for {part}", "give it, or leave the part out")
            if grammar is not None and (broken := grammar.objections(text)):
                raise FileError(path, f"{part} should bear {text!r}, but {'; '.join(broken)}", "mend one")
        return Expected(by_part=MappingProxyType(table))
    if not given.strip():
        raise SettingsError(
            "--verify is empty", hint="give the text that the part should bear, or a CSV table"
        )
    if grammar is not None and (broken := grammar.objections(given)):
        raise SettingsError(f"--verify is {given!r}, but {'; '.join(broken)}", hint="mend it or --format")
    return Expected(given.strip())


def _is_file(name: str) -> bool:
    try:
        return Path(name).is_file()
    except (OSError, ValueError):
        return False


def verify_reading(
    reading: Reading,
    lattice: Lattice | None,
    text: str,
    *,
    grammar: Grammar | None = None,
    contradicted: bool = False,
) -> tuple[Reading, Verification]:
    """The verdict on an expected text, and the reading with the states of its places for that text.

    Args:
        reading: as read.
        lattice: beliefs made without knowing the text; None where no characters were found.
        text: expected.
        grammar: names the rival.
        contradicted: two senses are sure of different characters: nothing is confirmed.

    Raises:
        VerifyError: a text that cannot be looked for.
    """
    import numpy as np

    from recognition.lattice import Lattice
    from recognition.reading import ReadingFlag
    from recognition.verify import Verdict, verify

    if lattice is None:
        lattice = Lattice((), np.zeros((0, 0)))
    verification = verify(lattice, text, grammar=grammar)
    if contradicted and verification.verdict is Verdict.CONFIRMED:
        verification = replace(verification, verdict=Verdict.UNDECIDED)
    flags = reading.flags
    if contradicted:
        flags |= ReadingFlag.SENSES_DISAGREE
    if verification.verdict is Verdict.REFUTED:
        flags |= ReadingFlag.MISMATCH
    characters = reading.characters
    if verification.places == len(characters):
        states = {check.place: check.state for check in verification.characters if check.place is not None}
        characters = tuple(replace(c, state=states.get(k, c.state)) for k, c in enumerate(characters))
    return replace(reading, characters=characters, flags=flags), verification
