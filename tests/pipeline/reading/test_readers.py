"""The reader of some settings, kept as long as the files that they name stay as they are."""

from __future__ import annotations

import shutil
from pathlib import Path

import matplotlib
import pytest

from pipeline.common.settings import ReadSettings
from pipeline.reading.readers import reader_of
from tests.support.certificates import written

FONTS = Path(matplotlib.get_data_path()) / "fonts" / "ttf"


@pytest.mark.parametrize("edited", ["lexicon", "font", "certificate"])
def test_a_reader_is_made_anew_when_a_file_of_its_settings_changes(edited: str, tmp_path: Path) -> None:
    lexicon, font, certificate = tmp_path / "known.txt", tmp_path / "die.ttf", tmp_path / "c.json"
    lexicon.write_text("AB12\n", encoding="utf-8")
    shutil.copy(FONTS / "DejaVuSans.ttf", font)
    named = ReadSettings(format=("AA99",), lexicon=lexicon, font=(str(font),))
    settings = named.model_copy(update={"certificate": written(certificate, named)})
    before = reader_of(settings)
    assert reader_of(settings) is before
    assert before.settings.certified is not None

    if edited == "lexicon":
        lexicon.write_text("AB12\nCD34\n", encoding="utf-8")
    elif edited == "font":
        shutil.copy(FONTS / "DejaVuSansMono.ttf", font)
    else:
        written(certificate, ReadSettings(format=("A9",)))  # what it was made with, too, is others' now
    after = reader_of(settings)
    assert after is not before
    assert reader_of(settings) is after
    if edited == "lexicon":
        assert [bool(reader.grammar.objections("CD34")) for reader in (before, after)] == [True, False]
    if edited == "certificate":
        assert after.settings.certified is not None
        assert after.settings.certified.sources == ()
