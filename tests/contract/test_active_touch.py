"""What must have been felt before a part is accepted: lines of both axes, and every character to its edges."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from glyphs import HeightMap, stamp
from pipeline import PartReader, ReadSettings, discover
from recognition import Reader
from tests.contract.front_doors import Command, save_height_map


def test_no_text_is_accepted_before_lines_tell_it_from_its_rivals(tmp_path: Path) -> None:
    # with dirt at the O, lines of one axis say Q and are sure of it; the first three characters are read
    part = stamp(format="AA999999", dirt=0.3, seed=(11, 4))
    assert part.text == "OD628534"
    whole = part.height_map
    np.savez(tmp_path / "part.npz", z_mm=whole.z_mm[:, : whole.shape[1] * 9 // 20], pitch_mm=whole.pitch_mm)
    (found,) = discover([tmp_path / "part.npz"])
    reading = PartReader(
        Reader(format="AA9", fonts=["gothic"], height_mm=5.0), ReadSettings(active=True, budget_s=15.0)
    ).read(found)
    assert reading.decision == "review" or reading.text == "OD6"


def test_an_accepted_part_was_felt_along_both_axes(command: Command, tmp_path: Path) -> None:
    part = save_height_map(tmp_path / "part.npz", "O8", height_mm=5.0)
    done = command(
        "scan", part, "--out", tmp_path / "felt.h5", "--height-mm", "5", "--active", "--format", "A9",
        "--sensors", "ideal",
    )  # fmt: skip
    assert "O8, accepted" in done.out
    lines = done.out.splitlines()
    assert any("  0°" in line or "  180°" in line for line in lines)
    assert any("  90°" in line or "  270°" in line for line in lines)


@pytest.mark.parametrize("cut_heights", [0.1, 0.2])
def test_a_character_that_the_scan_cuts_is_neither_graded_nor_accepted(cut_heights: float) -> None:
    part = stamp("K8", fonts="gothic", height_mm=4.0, seed=3)
    surface, reader = part.height_map, Reader(format="A9", fonts=["gothic"], height_mm=4.0)
    right_mm = part.stamped.boxes_mm[-1][2]
    kept = int((right_mm - cut_heights * 4.0) / surface.pitch_mm)
    whole = reader.read(surface)
    cut = reader.read(HeightMap(surface.z_mm[:, :kept], surface.pitch_mm))
    assert (whole.text, whole.decision) == ("K8", "accept")
    assert whole.characters[-1].grade is not None
    assert cut.decision != "accept"
    assert cut.characters[-1].grade is None
    assert cut.characters[-1].depth is None
    assert any("not felt to the edge: 8 at place 2" in message for message in cut.messages())


@pytest.mark.parametrize("option", ["--stage.device", "--camera.device"])
def test_a_service_does_not_start_without_the_folder_of_its_devices(
    tmp_path: Path, option: str, command: Command
) -> None:
    ended = command(
        "serve", "--port", "0", "--folder", tmp_path / "service", option, tmp_path / "not-there", "--jobs", "1",
        "--tokens", "off",
    )  # fmt: skip
    assert ended.status == 1
    assert "not-there: is no folder" in ended.err
    assert "Traceback" not in ended.err
