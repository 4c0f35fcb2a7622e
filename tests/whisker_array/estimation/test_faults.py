"""Faults of whiskers and bench: each is named, sound recordings are left alone, lines left out are felt crosswise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from glyphs.fonts.outlines import load_font
from glyphs.stamping.faces import default_die
from glyphs.stamping.stamp import stamp_line
from glyphs.surface.maps import TraceDirection
from tests.factories import extruded
from tests.support.bench_faults import recorded, with_whisker_of, worn
from tests.support.felt import felt
from whisker_array.estimation.edges import edge_map
from whisker_array.estimation.faults import Fault, FaultKind, find_faults, flag_faults
from whisker_array.scan.scan import Scan
from whisker_array.simulation.traces import Fidelity, SampleFlag
from whisker_array.whisker.touch import Touch, default_touch

TOUCH = default_touch(5.0)
Found = Callable[[FaultKind], tuple[Scan, tuple[Fault, ...]]]
OF_ONE = (
    *(FaultKind.DEAD, FaultKind.NOISY, FaultKind.LOOSE, FaultKind.BENT, FaultKind.WORN, FaultKind.REVERSED),
)


@pytest.fixture(scope="module")
def ideal() -> Scan:
    font = load_font("gothic")
    die, rng = default_die(5.0, font=font), np.random.default_rng(0)
    surface = stamp_line("AB47", font, die, height_mm=5.0, rng=rng).height_map
    return felt(surface, fidelity=Fidelity.POINTWISE)


def faulty(ideal: Scan, kind: FaultKind | None, *, seed: int = 0) -> Scan:
    return recorded(ideal, rng=np.random.default_rng(seed), fault=kind, whisker=1)


@pytest.fixture(scope="module")
def found(ideal: Scan) -> Found:
    """A recording with a fault, and what is found in it; each is made once."""

    @cache
    def made(kind: FaultKind) -> tuple[Scan, tuple[Fault, ...]]:
        scan = faulty(ideal, kind)
        return scan, find_faults(scan)

    return made


@pytest.mark.parametrize("kind", [k for k in FaultKind if k is not FaultKind.WORN])
def test_each_fault_is_named_with_its_whisker_and_nothing_else_is(found: Found, kind: FaultKind) -> None:
    faults = found(kind)[1]
    whiskers = [0, 1] if kind is FaultKind.DOUBLED else [1 if kind in OF_ONE else None]
    assert [(f.kind, f.whisker) for f in faults] == [(kind, whisker) for whisker in whiskers]
    for fault in faults:
        assert kind.value in fault.text
        assert fault.text.endswith(f"({kind.hint})")


def on_grooves(touch: Touch) -> Scan:
    """A test piece: grooves 0.6 mm wide and 0.3 deep, across all whiskers."""
    x = np.arange(0.0, 20.0, 0.03)
    groove = -0.3 * np.clip(2.0 - np.abs((x % 5.0) - 2.5) / 0.15, 0.0, 1.0)
    surface = extruded(groove, rows=667, pitch_mm=0.03)
    both = (TraceDirection.FORWARD_X, TraceDirection.BACK_X)
    return felt(surface, touch=touch, directions=both, fidelity=Fidelity.POINTWISE)


def test_a_worn_tip_is_named_on_a_test_piece_that_is_alike_under_all_whiskers() -> None:
    new = on_grooves(TOUCH)
    assert find_faults(faulty(new, None)) == ()
    blunt = on_grooves(worn(TOUCH, radius_mm=0.3, shorter_mm=0.02))
    (fault,) = find_faults(faulty(with_whisker_of(new, blunt, 2), None))
    assert (fault.kind, fault.whisker) == (FaultKind.WORN, 2)
    assert "inspect its tip" in fault.text


@pytest.mark.parametrize("seed", range(2))
def test_sound_recordings_are_left_alone(ideal: Scan, seed: int) -> None:
    scan = faulty(ideal, None, seed=seed)
    assert find_faults(scan) == ()
    assert flag_faults(scan, ()) is scan


def test_a_stage_too_high_is_not_eight_dead_whiskers(ideal: Scan) -> None:
    silent = recorded(ideal, rng=np.random.default_rng(0), fault=FaultKind.HEIGHT, size=1.9)
    (fault,) = find_faults(silent)
    assert fault.kind is FaultKind.HEIGHT
    assert "hardly touch" in fault.text


def test_the_vibration_is_named_by_its_frequency(found: Found) -> None:
    (fault,) = found(FaultKind.VIBRATION)[1]
    hz = float(fault.text.partition(" at ")[2].partition(" Hz")[0])
    # a pass of half a second tells frequencies 2 Hz apart
    assert hz == pytest.approx(50.0, abs=2.0)


def test_the_height_that_is_wrong_is_told_in_millimetres(found: Found) -> None:
    (fault,) = found(FaultKind.HEIGHT)[1]
    off = float(fault.text.partition("about ")[2].partition(" mm")[0])
    assert off == pytest.approx(0.5 * TOUCH.preload_mm, rel=0.1)  # gains of the whiskers are 3 % wrong
    assert "too high" in fault.text


def test_what_a_dead_whisker_would_have_felt_is_taken_from_crossing_passes(ideal: Scan, found: Found) -> None:
    """Against the same recording with all whiskers alive, under the dead one's lines and where no lines cross."""
    dead, faults = found(FaultKind.DEAD)
    usable = flag_faults(dead, faults)
    for sweep in usable.sweeps:
        assert (sweep.flags[:, 1] & SampleFlag.FAULTY == SampleFlag.FAULTY).all()
        assert not (np.delete(sweep.flags, 1, axis=1) & SampleFlag.FAULTY).any()
    whole, left, hurt = edge_map(faulty(ideal, None)), edge_map(usable), edge_map(dead)
    assert left.shape == whole.shape
    assert left.origin_mm == pytest.approx(whole.origin_mm)
    # known is all but where the dead whisker's own lines cross one another, 5 mm each way
    rows, cols = whole.shape
    lost = (5.0 / whole.pitch_mm + 1) ** 2
    assert whole.valid.mean() - left.valid.mean() < 1.1 * lost / (rows * cols)
    under = np.zeros(whole.shape, dtype=bool)
    under[round(5.2 / whole.pitch_mm) : round(9.8 / whole.pitch_mm)] = True
    under &= left.valid & whole.valid
    ahead = whole.directions.index(TraceDirection.FORWARD_X)
    truth = whole.enhancement[ahead][under]
    assert np.corrcoef(truth, left.enhancement[ahead][under])[0, 1] > 0.9
    assert abs(np.corrcoef(truth, hurt.enhancement[ahead][under])[0, 1]) < 0.5


def test_spikes_are_left_out_sample_by_sample(ideal: Scan, found: Found) -> None:
    spiked, faults = found(FaultKind.SPIKES)
    usable = flag_faults(spiked, faults)
    flagged = np.concatenate([(s.flags & SampleFlag.FAULTY != 0).ravel() for s in usable.sweeps])
    assert 3e-4 < flagged.mean() < 3e-3  # one in a thousand was made
    sound = edge_map(faulty(ideal, None)).enhancement
    far = [np.abs(edge_map(one).enhancement - sound).max() for one in (spiked, usable)]
    assert far[1] < 0.5 * far[0]


def test_few_directions_leave_lines_out_without_inventing_them(found: Found) -> None:
    dead, _ = found(FaultKind.DEAD)
    along = replace(dead, sweeps=tuple(s for s in dead.sweeps if s.plan.direction.along_x))
    usable = flag_faults(along, [Fault(FaultKind.DEAD, "", 1)])
    left = edge_map(usable)
    unknown = ~left.valid.any(axis=1)
    assert unknown.sum() * left.pitch_mm == pytest.approx(5.0, abs=0.5)  # the lines of one whisker
    assert (left.enhancement[:, unknown] == 0.0).all()
