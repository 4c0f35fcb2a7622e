"""The demonstration, cut down to one part."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.cli.demonstration import DEMO_PARTS
from pipeline.cli.main import main


def test_the_demonstration_leaves_a_page_that_stands_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("pipeline.cli.demonstration.DEMO_PARTS", DEMO_PARTS[:1])
    out = tmp_path / "demo"
    assert main(["demo", "--out", str(out)]) == 0
    shown = capsys.readouterr().out
    assert str(out / "overview.html") in shown
    assert str(out / "overview.png") in shown
    assert DEMO_PARTS[0].text in shown
    page = (out / "overview.html").read_text(encoding="utf-8")
    assert 'src="data:image/png;base64,' in page
    assert page.count("src=") == page.count('src="data:')
    assert "://" not in page
    assert f"<code>{DEMO_PARTS[0].text}</code>" in page
    assert {p.suffix for p in out.iterdir()} == {".npz", ".h5", ".png", ".html"}


def test_the_demonstration_shows_faces_polarity_and_turn() -> None:
    assert len({p.face for p in DEMO_PARTS}) >= 3
    assert {p.raised for p in DEMO_PARTS} == {False, True}
    assert any(p.rotation_deg for p in DEMO_PARTS)
    assert len({p.font for p in DEMO_PARTS}) >= 3
