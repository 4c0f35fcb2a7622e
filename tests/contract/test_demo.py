"""The demonstration, cut down to one part."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.contract.front_doors import main


def test_the_demonstration_leaves_a_page_that_stands_alone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "demo"
    assert main(["demo", "--out", str(out)]) == 0
    shown = capsys.readouterr().out
    assert str(out / "overview.html") in shown
    assert str(out / "overview.png") in shown
    assert "KX407251" in shown
    page = (out / "overview.html").read_text(encoding="utf-8")
    assert 'src="data:image/png;base64,' in page
    assert page.count("src=") == page.count('src="data:')
    assert "://" not in page
    assert "<code>KX407251</code>" in page
    assert {p.suffix for p in out.iterdir()} == {".npz", ".h5", ".png", ".html"}
