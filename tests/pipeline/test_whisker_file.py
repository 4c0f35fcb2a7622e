"""Whiskers on disk: what is written is read, and a file that cannot be used says why."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.problems import FileProblem
from pipeline.whisker_file import WhiskerFile, read_whisker_file, write_whisker_file
from whisker_array.sections import Rectangle, Round
from whisker_array.touch import default_touch
from whisker_array.whisker import LShaped, Straight

lengths = st.floats(0.05, 80.0)


def content(whisker: LShaped | Straight) -> WhiskerFile:
    touch = replace(default_touch(5.0), tip=whisker.tip_model(), whisker=whisker.describe())
    return WhiskerFile(whisker, touch, 5.0, 0.125, 0.0625, 50.0)


def same(one: LShaped | Straight, other: LShaped | Straight) -> bool:
    # angles go through degrees and back
    return np.allclose(
        one.tip_model().compliance_mm_per_n, other.tip_model().compliance_mm_per_n, rtol=1e-9, atol=1e-15
    ) and np.allclose(one.tip_model().moment_arm_mm, other.tip_model().moment_arm_mm, rtol=1e-9, atol=1e-12)


@settings(max_examples=40, deadline=None)
@given(
    l1=st.floats(5.0, 80.0),
    k=st.floats(0.01, 0.5),
    l3=st.floats(-5.0, 20.0),
    beta=st.floats(0.0, 1.2),
    thickness=st.floats(0.05, 1.0),
    ribbon=st.booleans(),
)
def test_an_l_shaped_whisker_comes_back(
    tmp_path_factory: pytest.TempPathFactory,
    l1: float,
    k: float,
    l3: float,
    beta: float,
    thickness: float,
    ribbon: bool,
) -> None:
    section = Rectangle(thickness, 5.0 * thickness) if ribbon else Round(thickness)
    written = content(LShaped(l1, k * l1, l3, beta, section))
    path = tmp_path_factory.mktemp("whisker") / "w.toml"
    write_whisker_file(path, written)
    read = read_whisker_file(path)
    assert isinstance(read.whisker, LShaped)
    assert same(read.whisker, written.whisker)
    for name in ("character_height_mm", "line_pitch_mm", "sample_pitch_mm", "speed_mm_s"):
        assert getattr(read, name) == pytest.approx(getattr(written, name), rel=1e-9)
    for name in ("preload_mm", "tip_radius_mm", "friction"):
        assert getattr(read.touch, name) == pytest.approx(getattr(written.touch, name), rel=1e-9)
    np.testing.assert_allclose(
        read.touch.tip.compliance_mm_per_n, read.whisker.tip_model().compliance_mm_per_n, rtol=1e-12
    )


def test_a_straight_whisker_comes_back(tmp_path: Path) -> None:
    written = content(Straight(30.0, math.radians(25.0), Round(0.3)))
    write_whisker_file(tmp_path / "s.toml", written)
    read = read_whisker_file(tmp_path / "s.toml")
    assert isinstance(read.whisker, Straight)
    assert same(read.whisker, written.whisker)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("l1_mm", "l1_cm", "l1"),
        ("preload_mm = 1.0", "preload_mm = -1.0", "preload_mm"),
        ('kind = "L"', 'kind = "hook"', "kind"),
        ("l1_mm = 30.0", "l1_mm = [", "TOML"),
        ("friction = 0.2", 'friction = "slippery"', "friction"),
    ],
)
def test_a_file_that_cannot_be_used_names_itself_and_the_mend(
    tmp_path: Path, old: str, new: str, said: str
) -> None:
    path = tmp_path / "w.toml"
    write_whisker_file(path, content(LShaped(30.0, 3.0, None, 0.0, Round(0.3))))
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(FileProblem, match=said) as told:
        read_whisker_file(path)
    assert str(path) in str(told.value)


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(FileProblem, match="not there"):
        read_whisker_file(tmp_path / "none.toml")
