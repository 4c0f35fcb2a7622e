"""What a perturbation changes, and what it leaves."""

from __future__ import annotations

import numpy as np
import pytest

from glyphs.camera.photo import Photo
from glyphs.surface.maps import HeightMap
from pipeline.reading.perturbation import PERTURBATIONS, REMOUNTED, Perturbation, Retake, reverse_order
from recognition.see.virtual_array import VirtualArray
from whisker_array.estimation.edges import edge_map
from whisker_array.simulation.traces import Fidelity

BY_NAME = {p.name: p for p in PERTURBATIONS}
SEED = 7  # odd: brighter and larger
HEIGHT_MM = 2.0


@pytest.fixture(scope="module")
def plate() -> HeightMap:
    """A groove across land."""
    z = np.zeros((60, 80), dtype=np.float32)
    z[:, 38:42] = -0.1
    return HeightMap(z, 0.05)


@pytest.fixture(scope="module")
def photo() -> Photo:
    return Photo(np.full((40, 100), 100, dtype=np.uint8), pitch_mm=0.05, centre_mm=(2.0, 1.0))


def scan_of(plate: HeightMap, name: str, seed: int = SEED):  # type: ignore[no-untyped-def]
    feel = Retake(BY_NAME[name], seed).feel(VirtualArray(fidelity=Fidelity.POINTWISE), soil=None, part_id="p")
    return feel(plate, HEIGHT_MM)


def test_lines_lie_half_a_pitch_beside(plate: HeightMap) -> None:
    before, after = scan_of(plate, "light"), scan_of(plate, "shift")
    for a, b in zip(before.sweeps, after.sweeps, strict=True):
        assert b.plan.line_mm[0, 0] - a.plan.line_mm[0, 0] == pytest.approx(0.5 * before.line_pitch_mm)


def test_the_other_order_is_the_same_edge_map(plate: HeightMap) -> None:
    scan = scan_of(plate, "light")
    back = reverse_order(scan)
    assert [s.plan.direction for s in back.sweeps] == [s.plan.direction for s in reversed(scan.sweeps)]
    one, other = edge_map(scan), edge_map(back)
    for k, direction in enumerate(one.directions):
        layer = other.enhancement[other.directions.index(direction)]
        # the same numbers, added in another order: float32
        assert np.abs(one.enhancement[k] - layer).max() < 1e-4
    assert scan_of(plate, "order").sweeps[0].plan.direction == back.sweeps[0].plan.direction


def test_noise_is_drawn_from_the_seed_and_is_small(plate: HeightMap, photo: Photo) -> None:
    ideal, first, again, other = (
        scan_of(plate, "light"), scan_of(plate, "noise"), scan_of(plate, "noise"), scan_of(plate, "noise", 8),
    )  # fmt: skip
    raw = [s.sweeps[0].moment_n_mm for s in (ideal, first, again, other)]
    assert np.array_equal(raw[1], raw[2])
    assert not np.array_equal(raw[1], raw[3])
    assert not np.array_equal(raw[0], raw[1])
    grain = Retake(BY_NAME["noise"], SEED).photo(photo).pixels.astype(float)
    # 1 % of 255, rounded to whole numbers (variance 1/12), of 4,000 pixels
    assert grain.std() == pytest.approx(np.hypot(2.55, 12**-0.5), rel=0.05)


@pytest.mark.parametrize(("seed", "sign"), [(7, 1.0), (8, -1.0)])
def test_light_and_scale_go_either_way(plate: HeightMap, photo: Photo, seed: int, sign: float) -> None:
    assert set(Retake(BY_NAME["light"], seed).photo(photo).pixels.ravel()) == {round(100 * (1 + 0.06 * sign))}
    scale = Retake(BY_NAME["scale"], seed)
    assert scale.surface(plate).pitch_mm == pytest.approx(0.05 * (1 + 0.01 * sign))
    larger = scale.photo(photo)
    assert larger.shape[1] == round(100 * (1 + 0.01 * sign))
    assert larger.pitch_mm == photo.pitch_mm
    assert larger.centre_mm == pytest.approx((2.0 * (1 + 0.01 * sign), 1.0 + 0.01 * sign))


def test_a_recording_is_perturbed_and_its_lines_stay(plate: HeightMap) -> None:
    """Noisier by as much as it shows in the air, and larger; it is felt alike."""
    scan = scan_of(plate, "noise")
    again = Retake(Perturbation("x", noise=True, scale=0.01), SEED).recorded(scan)
    first, other = scan.sweeps[0], again.sweeps[0]
    assert other.plan.line_mm == pytest.approx(1.01 * first.plan.line_mm)
    assert other.plan.step_mm == pytest.approx(1.01 * first.plan.step_mm)
    assert again.line_pitch_mm == pytest.approx(1.01 * scan.line_pitch_mm)
    added = np.nanstd(other.moment_n_mm - first.moment_n_mm)
    # 1 %: of some ten thousand samples, in float32
    assert added == pytest.approx(np.median(first.air_n_mm.std(axis=-1)), rel=0.01)
    one, felt = edge_map(scan), edge_map(again)
    assert felt.pitch_mm == pytest.approx(1.01 * one.pitch_mm)
    assert felt.enhancement.max() == pytest.approx(one.enhancement.max(), rel=0.1)


def test_what_is_drawn_is_within_its_limits_and_differs() -> None:
    grown = [Retake(REMOUNTED, seed).grown for seed in range(50)]
    assert all(0.99 <= g <= 1.01 for g in grown)
    assert len(set(grown)) == 50
