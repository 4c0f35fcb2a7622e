"""Predictions on disk: found again, made again where a file is damaged, and never in the way."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest

from glyphs.fonts.outlines import load_font
from recognition.glyph_match import kept_predictions
from recognition.glyph_match.face_library import face_library
from recognition.glyph_match.kept_predictions import Arrays, kept
from recognition.glyph_match.predicted import predict_templates, template_key
from recognition.glyph_match.prototypes import felt_prototypes, lit_prototypes
from recognition.see.view import View
from whisker_array.whisker.touch import default_touch


@pytest.fixture(autouse=True)
def folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Path]:
    monkeypatch.setattr(kept_predictions, "folder_of", lambda function: tmp_path)
    yield tmp_path
    tmp_path.chmod(0o700)


def make() -> Arrays:
    return {"values": np.arange(5.0)}


def never() -> Arrays:
    raise AssertionError("made a second time")


def same(one: object, other: object) -> bool:
    pairs = [
        (getattr(one, f.name), getattr(other, f.name)) for f in fields(one) if f.name not in ("work", "touch")
    ]  # type: ignore[arg-type]
    return all(same(a, b) if isinstance(a, View) else np.array_equal(a, b) for a, b in pairs if a is not None)


def test_what_was_made_is_found_again_and_other_things_are_not() -> None:
    kept(("one", 2, (3.0, np.zeros(2))), make)
    assert np.array_equal(kept(("one", 2, (3.0, np.zeros(2))), never)["values"], np.arange(5.0))
    for other in (
        ("one", 2, (3.0, np.zeros(3))),
        ("one", 2.0, (3.0, np.zeros(2))),
        ("one", 2, 3.0, np.zeros(2)),
    ):
        with pytest.raises(AssertionError, match="second time"):
            kept(other, never)


@pytest.mark.parametrize("damage", [b"", b"nothing", None])
def test_a_damaged_file_is_made_again(folder: Path, damage: bytes | None) -> None:
    kept(("one",), make)
    (path,) = folder.glob("*.npz")
    content = path.read_bytes()
    path.write_bytes(content[:60] + b"\xff" * 40 + content[100:] if damage is None else damage)
    assert np.array_equal(kept(("one",), make)["values"], np.arange(5.0))
    assert np.array_equal(kept(("one",), never)["values"], np.arange(5.0))


def test_without_a_folder_everything_is_made_each_time(monkeypatch: pytest.MonkeyPatch, folder: Path) -> None:
    for nowhere in (None, folder / "missing"):
        monkeypatch.setattr(kept_predictions, "folder_of", lambda function, nowhere=nowhere: nowhere)
        assert np.array_equal(kept(("one",), make)["values"], np.arange(5.0))
        with pytest.raises(AssertionError, match="second time"):
            kept(("one",), never)


def test_what_was_used_longest_ago_is_removed(monkeypatch: pytest.MonkeyPatch, folder: Path) -> None:
    monkeypatch.setattr(kept_predictions, "MOST_BYTES", 1_000)  # room for three
    for k in range(6):
        kept((k,), make)
        kept((0,), make)
    kept((0,), never)
    assert sum(path.stat().st_size for path in folder.iterdir()) <= 1_000


def test_predictions_from_the_disk_are_those_that_were_made(folder: Path) -> None:
    font, touch = load_font("gothic"), default_touch(5.0)

    def predict() -> tuple[object, ...]:
        templates = predict_templates(font, "K7", template_key(font, touch, height_mm=5.0))
        felt, lit = (face_library(sense).map for sense in ("tactile", "vision"))
        return (
            templates,
            templates.view,
            felt_prototypes(templates, felt, ""),
            lit_prototypes(font, "K7", lit),
        )

    made, files = predict(), set(folder.iterdir())
    found = predict()
    assert set(folder.iterdir()) == files
    assert all(same(one, other) for one, other in zip(made, found, strict=True))
