"""`read --experts templates` reads by the shapes of the font that is named, and opens no network."""

from __future__ import annotations

import json
from pathlib import Path

from tests.contract.front_doors import environment, run_process


def test_a_part_is_read_where_networks_cannot_be_opened(height_map: Path, tmp_path: Path) -> None:
    broken = tmp_path / "broken"
    broken.mkdir()
    (broken / "onnxruntime.py").write_text("raise ImportError('networks are not for this test')\n", "utf-8")
    known = environment()
    known["PYTHONPATH"] = f"{broken}:{known.get('PYTHONPATH', '')}".rstrip(":")
    table = tmp_path / "read.jsonl"
    asked = ("--font", "gothic", "--format", "A9", "--height-mm", "4", "--jobs", "1", "--out", table)
    alone = run_process("read", height_map, *asked, "--experts", "templates", env=known)
    assert alone.status == 0, alone.err
    assert json.loads(table.read_text("utf-8").splitlines()[0])["text"] == "K7"
