"""Digests of an edition's parts: what changes one, what does not, and that the edition is what it was."""

from __future__ import annotations

import numpy as np
import pytest

from glyphs.camera.photo import Photo
from glyphs.soiling.soil import Soil
from glyphs.surface.maps import HeightMap
from pipeline.benchmark.exam.specimens import Specimen
from tests.benchmarks.edition_digest import (
    STEPS,
    arithmetic,
    digest,
    digest_of,
    digests_file,
    listed,
    listed_with,
    parts_of,
    rounded,
)

SMALL = {
    "marks-exam-1-40": ("first-0-0000", "first-0.9-0001", "dotted-0.9-0000"),
    "marks-exam-2-96": ("kept-out-0-weld-0000", "kept-out-0.6-mud-0001"),
}
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


def _digest(values: dict[str, np.ndarray]) -> str:
    return digest(rounded(_specimen(values)), "B4")


@pytest.mark.parametrize("kind", KINDS)
def test_one_step_of_one_sample_is_another_part(kind: str) -> None:
    values = _values()
    values[kind][3, 4] += STEPS.get(kind, 1)
    assert _digest(values) != _digest(_values())


def test_noise_well_below_a_step_changes_nothing() -> None:
    """The last bits of float32 heights around 0.1 mm: some 1e-8 mm, of steps of 1e-4."""
    noisy = _values()
    rng = np.random.default_rng(2)
    for name, step in STEPS.items():
        noisy[name] = noisy[name] + 0.1 * step * rng.uniform(-1.0, 1.0, noisy[name].shape)
    assert _digest(noisy) == _digest(_values())


@pytest.mark.parametrize("edition", SMALL)
def test_the_list_has_parts_of_the_edition(edition: str) -> None:
    assert set(SMALL[edition]) <= set(listed(digests_file(edition))) <= set(parts_of(edition)[1])


@pytest.mark.parametrize(
    ("edition", "part"), [(name, part) for name, parts in SMALL.items() for part in parts]
)
def test_the_edition_is_what_it_was(edition: str, part: str) -> None:
    """Fails when a soil, a die, an amount or the numbering of parts was changed without listing the parts anew."""
    path = digests_file(edition)
    if listed_with(path) != arithmetic():
        pytest.skip(f"listed with {listed_with(path)}; other arithmetic rounds a sample the other way")
    assert digest_of(edition, part) == listed(path)[part]
