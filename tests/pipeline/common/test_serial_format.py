"""What a serial may be, from settings and files."""

from __future__ import annotations

from pathlib import Path

import pytest

from glyphs.errors import FileError
from pipeline.common.serial_format import read_lexicon, serial_format
from pipeline.common.settings import ReadSettings, SettingsError
from recognition.language.grammar import Grammar


@pytest.fixture(autouse=True)
def _in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def grammar(**given: object) -> Grammar:
    grammar_of_settings = serial_format(ReadSettings(**given))
    assert grammar_of_settings is not None
    return grammar_of_settings


def test_nothing_said_is_no_grammar() -> None:
    assert serial_format(ReadSettings()) is None


def test_a_mask_is_as_before() -> None:
    assert grammar(format=("AA 99",)) == Grammar(format="AA 99")


def test_all_that_is_given_holds_together() -> None:
    Path("known.txt").write_text(
        "# press 3\nAB 18   # scrapped\n\nAB26\nAB34\nAI18\nCD26\n", encoding="utf-8"
    )
    serials = grammar(format=("AA99+exclude=I", "re:A.*", "check:luhn@3-"), lexicon=Path("known.txt"))
    # by Luhn 1-8, 2-6 and 3-4 are good; CD26 breaks the expression, AI18 has an I
    assert sorted(w for w in ("AB18", "AB26", "AB34", "AI18", "CD26", "AB42") if serials.allows(w)) == [
        "AB18",
        "AB26",
        "AB34",
    ]
    assert not grammar(format=("AA99", "check:luhn@3-")).allows("AB19")
    assert grammar(format=("re:.*+exclude=IOQ",)).allows("K7")
    assert not grammar(format=("re:.*+exclude=IOQ",)).allows("Q7")


def test_what_cannot_be_met_is_told_by_key() -> None:
    Path("known.txt").write_text("AB123\n", encoding="utf-8")
    with pytest.raises(SettingsError, match="format and lexicon cannot be met: no serial meets mask:AA99"):
        grammar(format=("AA99",), lexicon=Path("known.txt"))
    with pytest.raises(SettingsError, match=r"format is \('AA99', 'AA999'\): the format has two of mask"):
        ReadSettings.of(format=("AA99", "AA999"))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "is not there"),
        (b"", "is empty"),
        (b"# nothing\n \n", "holds no serial; write one per line"),
        (b"\xff\xfeA\n", "UTF-8"),
        (b"AB\x0712\n", "printable"),
    ],
)
def test_files_that_are_no_lexicon(content: bytes | None, message: str, tmp_path: Path) -> None:
    path = tmp_path / "known.txt"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(FileError, match=message):
        read_lexicon(path)


def test_a_number_sign_within_a_serial_is_its_own(tmp_path: Path) -> None:
    path = tmp_path / "known.txt"
    path.write_bytes(b"\xef\xbb\xbfA#1\r\nB2 # two\r\n")
    assert read_lexicon(path) == {"A#1", "B2"}
