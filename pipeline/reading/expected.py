"""Expected texts of parts."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from glyphs.errors import FileError
from pipeline.common.settings import SettingsError
from pipeline.formats.truth import PartTexts, load_truth

if TYPE_CHECKING:
    from recognition.language.grammar import Grammar


def load_expected(value: str, grammar: Grammar | None = None) -> str | PartTexts:
    """The value of `--verify`: a text of every part, or texts by part from a table (.csv, .xlsx or an existing file).

    Raises:
        FileError: the table is missing, or a text in it does not fit the grammar.
        SettingsError: the text is empty or does not fit the grammar.
    """

    def broken(text: str) -> str:
        return "" if grammar is None else "; ".join(grammar.objections(text))

    if not value.lower().endswith((".csv", ".xlsx")) and not os.path.isfile(value):
        if not value.strip():
            hint = "give the text that the part should read, or a CSV table"
            raise SettingsError("--verify is empty", hint=hint)
        if broken(value):
            raise SettingsError(f"--verify is {value!r}, but {broken(value)}", hint="correct it or --format")
        return value.strip()
    path = Path(value)
    table = load_truth(path)
    for part, text in table.items():
        if not text:
            raise FileError(path, f"gives no text for {part}", "give it, or leave the part out")
        if broken(text):
            raise FileError(path, f"{part} should read {text!r}, but {broken(text)}", "correct one of them")
    return table
