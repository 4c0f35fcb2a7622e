"""The demonstration: every part is read as stamped, and the page stands alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from matplotlib.figure import Figure

from pipeline.cli.demo import PLATES
from pipeline.cli.main import main
from recognition.decision import picture


def test_the_demonstration_leaves_a_page_that_stands_alone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    first, draw = next(iter(PLATES)), picture.reading_figure

    def drawn(reading: Any, *, title: str) -> Figure:
        """Draw one part in full; the panels of all take longer than their reading."""
        return draw(reading, title=title) if title == first else Figure(figsize=(1.0, 1.0))

    monkeypatch.setattr(picture, "reading_figure", drawn)
    out = tmp_path / "demo"
    assert main(["demo", "--out", str(out)]) == 0
    shown = capsys.readouterr().out
    assert str(out / "overview.html") in shown
    assert str(out / "overview.png") in shown
    page = (out / "overview.html").read_text(encoding="utf-8")
    assert 'src="data:image/jpeg;base64,' in page
    assert page.count("src=") == page.count('src="data:') == len(PLATES)
    assert "://" not in page
    for plate in PLATES.values():
        assert plate["text"] in shown
        assert f"<code>{plate['text']}</code>" in page
    assert {p.suffix for p in out.iterdir()} == {".npz", ".h5", ".png", ".html"}
