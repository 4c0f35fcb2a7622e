"""The examples of the library's page: each is run, and gives what stands below it."""

from __future__ import annotations

import doctest
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[2] / "docs" / "pages" / "reference" / "library.md"


def test_the_examples_of_the_library_give_what_the_page_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "agg")
    done = doctest.testfile(str(PAGE), module_relative=False, optionflags=doctest.IGNORE_EXCEPTION_DETAIL)
    assert done.attempted > 20
    assert done.failed == 0
    assert {file.name for file in tmp_path.iterdir()} == {"edges.png", "part.npz"}
