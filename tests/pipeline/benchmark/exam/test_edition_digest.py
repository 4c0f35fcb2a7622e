"""Digests of an edition's parts: what changes one, what does not, and how far apart two machines are."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest

from glyphs.camera.photo import Photo
from glyphs.errors import FileError
from glyphs.soiling.soil import Soil
from glyphs.surface.maps import HeightMap
from pipeline.benchmark.exam.editions import design_named
from pipeline.benchmark.exam.specimens import Specimen
from pipeline.workers.executors import Executor
from tests.benchmarks import edition_digest
from tests.benchmarks.edition_digest import (
    STEPS,
    Task,
    arithmetic,
    digest,
    digests_file,
    listed,
    listed_with,
    made,
    main,
    rounded,
)

EDITION = "marks-exam-1-48"
SMALL = ("dotted-0-rust-0000", "first-0.3-caked-0000", "first-0.9-casting-0000")
TINY = """
parts = 2
[part]
font = "gothic"
format = "9"
height_mm = 2
soil = "rust"
severity = [0, 0.5]
"""
KINDS = (*STEPS, "pixels")


def _values() -> dict[str, np.ndarray]:
    """Every array of a part, on multiples of the steps, so that a little noise crosses no rounding edge."""
    rng = np.random.default_rng(1)
    values = {name: rng.integers(1, 900, (12, 15)) * step for name, step in STEPS.items()}
    return {**values, "pixels": rng.integers(0, 250, (12, 15, 3)).astype(np.uint8)}


def _specimen(values: dict[str, np.ndarray], truth: str = "B4") -> Specimen:
    soil = Soil(values["soft_mm"], values["hardness_mpa"], values["friction"])
    height_map = HeightMap(values["z_mm"].astype(np.float32), 0.1)
    return Specimen("one", truth, height_map, soil, lambda: Photo(values["pixels"]), None)


def _digest(values: dict[str, np.ndarray], truth: str = "B4") -> str:
    return digest(rounded(_specimen(values, truth)), truth)


@pytest.mark.parametrize("kind", KINDS)
def test_one_step_of_one_sample_is_another_part(kind: str) -> None:
    values = _values()
    values[kind][3, 4] += STEPS.get(kind, 1)
    assert _digest(values) != _digest(_values())


def test_other_words_or_another_shape_are_another_part() -> None:
    arrays = rounded(_specimen(_values()))
    assert digest(arrays, "B4") == digest(dict(reversed(arrays.items())), "B4")
    assert digest(arrays, "B4") != digest(arrays, "B8")
    turned = {**arrays, "z_mm": arrays["z_mm"].reshape(15, 12)}
    assert digest(turned, "B4") != digest(arrays, "B4")
    less = {name: values for name, values in arrays.items() if name != "friction"}
    assert digest(less, "B4") != digest(arrays, "B4")


def test_noise_well_below_a_step_changes_nothing() -> None:
    """The last bits of float32 heights around 0.1 mm: some 1e-8 mm, of steps of 1e-4."""
    noisy = _values()
    rng = np.random.default_rng(2)
    for name, step in STEPS.items():
        noisy[name] = noisy[name] + 0.1 * step * rng.uniform(-1.0, 1.0, noisy[name].shape)
    assert _digest(noisy) == _digest(_values())


def test_at_a_rounding_edge_noise_moves_a_sample_by_one_step_and_no_more() -> None:
    low, high = _values(), _values()
    for values, off in ((low, 0.49), (high, 0.51)):
        values["z_mm"][3, 4] = (500 + off) * STEPS["z_mm"]
    assert _digest(low) != _digest(high)
    apart = rounded(_specimen(low))["z_mm"] - rounded(_specimen(high))["z_mm"]
    assert np.abs(apart).max() == 1


@pytest.fixture
def tiny(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """A design of two parts, made in this process."""
    monkeypatch.setattr(edition_digest, "WorkPool", lambda _: nullcontext(Executor()))
    path = tmp_path / "tiny.toml"
    path.write_text(TINY, encoding="utf-8")
    return str(path)


def test_a_second_run_makes_the_same(tiny: str, capsys: pytest.CaptureFixture[str]) -> None:
    main(tiny, write=True)
    edition_digest._parts.cache_clear()
    main(tiny)
    assert "2 of 2 listed parts are the same" in capsys.readouterr().out
    assert listed_with(digests_file(tiny)) == arithmetic()


def test_what_differs_and_what_is_gone_is_named(tiny: str, capsys: pytest.CaptureFixture[str]) -> None:
    main(tiny, write=True)
    path = digests_file(tiny)
    part, found = next(iter(listed(path).items()))
    path.write_text(path.read_text("utf-8").replace(found, 12 * "0") + "gone 123\n", encoding="utf-8")
    with pytest.raises(SystemExit):
        main(tiny)
    out = capsys.readouterr().out
    assert f"{part}: {found}, listed as {12 * '0'}" in out
    assert "gone: listed, and not a part" in out
    assert "1 of 2" in out


def test_against_a_folder_says_the_largest_difference(
    tiny: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "kept"
    main(tiny, write=True, keep=folder)
    for path, steps in zip(sorted(folder.iterdir()), (3, 7), strict=True):
        with np.load(path) as kept:
            arrays = dict(kept)
        arrays["z_mm"][0, 0] += steps
        arrays["pixels"] = arrays["pixels"][1:]
        np.savez(path, allow_pickle=False, **arrays)
    main(tiny, against=folder)
    said = capsys.readouterr().out.rpartition("differences at most: ")[2]
    assert "z_mm 0.0007" in said
    assert "soft_mm 0," in f"{said.strip()},"
    assert "pixels inf" in said


def test_no_list_is_said(tiny: str) -> None:
    with pytest.raises(FileError, match="--write"):
        main(tiny)


def test_the_list_has_every_part_once() -> None:
    parts = [item.part for item in edition_digest._parts(EDITION)[1]]
    assert list(listed(digests_file(EDITION))) == parts
    assert len(parts) == 48 == sum(section.parts for section in design_named(EDITION).all_sections())


@pytest.mark.parametrize("part", SMALL)
def test_the_edition_is_what_it_was(part: str) -> None:
    """Fails when a soil, a die, an amount or the numbering of parts was changed without listing the parts anew."""
    path = digests_file(EDITION)
    if listed_with(path) != arithmetic():
        pytest.skip(f"listed with {listed_with(path)}; other arithmetic rounds a sample the other way")
    numbers = {item.part: k for k, item in enumerate(edition_digest._parts(EDITION)[1])}
    assert made(Task(EDITION, numbers[part])).digest == listed(path)[part]
