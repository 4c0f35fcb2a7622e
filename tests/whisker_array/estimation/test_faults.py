"""Faults of whiskers, bench and wiring: each is named, sound recordings are left alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from glyphs import stamp
from glyphs.fonts.outlines import load_font
from glyphs.stamping.faces import default_die
from glyphs.stamping.stamp import stamp_line
from glyphs.surface.maps import HeightMap, TraceDirection
from tests.factories import extruded
from tests.support.bench_faults import recorded, with_whisker_of, worn
from tests.support.felt import felt
from whisker_array.estimation.edges import edge_map
from whisker_array.estimation.fault_measures import SweepShares
from whisker_array.estimation.faults import Fault, FaultKind, find_faults, find_signal_faults, flag_faults
from whisker_array.estimation.signal_measures import best_order, flag_beyond_part
from whisker_array.scan.scan import Scan, trace_scan
from whisker_array.scan.sweep import Sweep
from whisker_array.simulation.traces import Fidelity, SampleFlag
from whisker_array.whisker.array import ALL_DIRECTIONS, default_plan
from whisker_array.whisker.passes import SweepPlan
from whisker_array.whisker.touch import Touch, default_touch

# ------------------------------------------------------------------------------------------------------------ faults

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


# ------------------------------------------------------------------------------------- signals out of step or missing


def in_time(scan: Scan, change: Callable[[np.ndarray], np.ndarray]) -> Scan:
    """The signals (whiskers, samples) of each sweep changed in the order of time."""

    def of(s: Sweep) -> Sweep:
        signal = np.concatenate([s.air_n_mm, s.moment_n_mm], axis=2)
        passes, whiskers, samples = signal.shape
        new = change(signal.swapaxes(0, 1).reshape(whiskers, -1)).reshape(whiskers, passes, samples)
        n_air, new = s.air_n_mm.shape[2], new.swapaxes(0, 1)
        return replace(s, moment_n_mm=new[..., n_air:], air_n_mm=new[..., :n_air])

    return replace(scan, sweeps=tuple(map(of, scan.sweeps)))


@pytest.mark.parametrize("late", [1, 3, 5, 40, -1, -3])
def test_a_signal_out_of_step_with_the_stage_is_named_and_read_as_if_in_step(ideal: Scan, late: int) -> None:
    sound = faulty(ideal, None)
    scan = in_time(sound, lambda signal: np.roll(signal, late, axis=1))
    (fault,) = find_faults(scan)
    assert (fault.kind, fault.whisker) == (FaultKind.SHIFTED, None)
    assert f"{'later' if late > 0 else 'earlier'} than" in fault.text
    assert f"by {abs(late)} sample" in fault.text
    usable = flag_faults(scan, (fault,))
    for sweep, true in zip(usable.sweeps, sound.sweeps, strict=True):
        known = slice(None, -late) if late > 0 else slice(None)
        assert np.array_equal(sweep.moment_n_mm[..., known], true.moment_n_mm[..., known])
        assert np.array_equal(sweep.flags[..., known], true.flags[..., known])


@pytest.mark.parametrize("held", [2, 3, 4])
def test_a_converter_that_holds_its_values_has_no_doubled_channels(ideal: Scan, held: int) -> None:
    def hold(signal: np.ndarray) -> np.ndarray:
        return signal[:, np.arange(signal.shape[1]) // held * held]

    assert {f.kind for f in find_faults(in_time(faulty(ideal, None), hold))} <= {FaultKind.SHIFTED}


def missing(scan: Scan, *whiskers: int) -> Scan:
    """The scan as it is read from a recording in which some channels hold NaN."""

    def of(s: Sweep) -> Sweep:
        moment, air, flags = s.moment_n_mm.copy(), s.air_n_mm.copy(), s.flags.copy()
        for w in whiskers:
            moment[:, w], air[:, w] = 0.0, 0.0
            flags[:, w] |= np.uint8(SampleFlag.OUT_OF_RANGE)
        return replace(s, moment_n_mm=moment, air_n_mm=air, flags=flags)

    return replace(scan, sweeps=tuple(map(of, scan.sweeps)))


@pytest.mark.parametrize("whisker", range(4))
def test_a_channel_without_a_value_is_a_dead_whisker(ideal: Scan, whisker: int) -> None:
    scan = missing(faulty(ideal, None), whisker)
    (fault,) = find_faults(scan)
    assert (fault.kind, fault.whisker) == (FaultKind.DEAD, whisker)
    assert "has no value" in fault.text
    for sweep in flag_faults(scan, (fault,)).sweeps:
        assert (sweep.flags[:, whisker] & SampleFlag.FAULTY == SampleFlag.FAULTY).all()
        assert not (sweep.flags & SampleFlag.OUT_OF_RANGE).any()


def test_channels_that_are_all_without_a_value_are_no_signal(ideal: Scan) -> None:
    scan = missing(faulty(ideal, None), *range(ideal.n_whiskers))
    (fault,) = find_faults(scan)
    assert (fault.kind, fault.whisker) == (FaultKind.NO_SIGNAL, None)
    assert "no sample of any channel has a value" in fault.text
    assert not any((s.flags & SampleFlag.OUT_OF_RANGE).any() for s in flag_faults(scan, (fault,)).sweeps)


def test_a_single_border_beside_a_faulty_channel_is_no_exchange() -> None:
    """A mark ends between whiskers 0 and 1; only whisker 2 could show that 0 and 1 are where they belong."""
    line_mm = 0.1 * np.arange(24).reshape(4, 6).T
    plan = SweepPlan(TraceDirection.FORWARD_X, line_mm, start_mm=0.0, step_mm=0.1, n_samples=100, n_lead=10)
    share = np.ones((6, 4, 100))
    share[3:, 0, 30:80] = 0.8
    air = 1e-4 * np.random.default_rng(0).standard_normal((6, 4, 16))
    sweep, nowhere = SweepShares(plan, share, air, np.arange(6)), np.zeros(share.shape, dtype=bool)

    def moved(n_sweeps: int) -> list[int]:
        sweeps, beyond = [sweep] * n_sweeps, [nowhere] * n_sweeps
        bad = np.arange(4) == 2
        return best_order(sweeps, beyond, bad, least=0.2, line_pitch_mm=0.1, least_gain=0.003).moved

    assert moved(1) == []
    assert 0 in moved(4)  # the border fits far better


@pytest.mark.parametrize("step", [0.03, 0.075, 0.15])
def test_a_coarse_converter_is_neither_saturated_nor_exchanged(ideal: Scan, step: float) -> None:
    size = step * abs(TOUCH.land_moment_n_mm())
    scan = in_time(faulty(ideal, None), lambda signal: (size * np.rint(signal / size)).astype(np.float32))
    (fault,) = find_faults(scan)
    assert (fault.kind, fault.whisker) == (FaultKind.COARSE, None)
    assert f"steps are {100.0 * step:.1f} %" in fault.text


# ----------------------------------------------------------------------------------------------------- signal faults

SIGNALS = frozenset(
    {
        *(FaultKind.NO_SIGNAL, FaultKind.REVERSED, FaultKind.LIFTED, FaultKind.UNIT),
        *(FaultKind.EXCHANGED, FaultKind.DOUBLED),
    }
)
OF_THE_STAGE = frozenset({FaultKind.HEIGHT, FaultKind.TILTED, FaultKind.BOWED})
ALONG_X = (TraceDirection.FORWARD_X, TraceDirection.BACK_X)
# number of whiskers, severity of the dirt, directions, flags of tips beyond the part
BENCHES = (
    (8, 0.0, ALL_DIRECTIONS, True),
    (8, 0.6, ALL_DIRECTIONS, False),
    (4, 0.3, ALL_DIRECTIONS, False),
    (3, 0.0, ALONG_X, True),
    (3, 0.9, ALL_DIRECTIONS[:2], False),
)


@cache
def sound(
    n_whiskers: int, dirt: float, directions: tuple[TraceDirection, ...], flags: bool, rise_mm: float = 0.0
) -> Scan:
    """A recording with usual sensors of a part with six characters of 5 mm, on a plate that rises."""
    part = stamp("AB4729", dirt=dirt, seed=n_whiskers)
    surface = part.height_map
    tilt = rise_mm * np.linspace(-0.5, 0.5, surface.z_mm.shape[1])
    surface = HeightMap((surface.z_mm + tilt).astype(np.float32), surface.pitch_mm)
    plan = default_plan(
        (0.0, 0.0, *surface.size_mm), character_height_mm=5.0, directions=directions, n_whiskers=n_whiskers
    )
    touch = default_touch(5.0)
    ideal = trace_scan(surface, touch=touch, plan=plan, soil=part.soil, fidelity=Fidelity.POINTWISE)
    scan = recorded(ideal, rng=np.random.default_rng(n_whiskers))
    return scan if flags else changed(scan, lambda s: replace(s, flags=np.zeros_like(s.flags)))


def changed(scan: Scan, change: Callable[[Sweep], Sweep]) -> Scan:
    return replace(scan, sweeps=tuple(change(s) for s in scan.sweeps))


def scaled(scan: Scan, *factors: float) -> Scan:
    """The channels by factors, the last one for all further channels."""
    each = np.array([*factors, *[factors[-1]] * scan.n_whiskers][: scan.n_whiskers], dtype=np.float32)[
        :, None
    ]
    return changed(scan, lambda s: replace(s, moment_n_mm=s.moment_n_mm * each, air_n_mm=s.air_n_mm * each))


def wired(scan: Scan, *order: int) -> Scan:
    """The channels in another order; the flags stay, as they are told from the plan."""
    channels = [*order, *range(len(order), scan.n_whiskers)]
    return changed(
        scan, lambda s: replace(s, moment_n_mm=s.moment_n_mm[:, channels], air_n_mm=s.air_n_mm[:, channels])
    )


WIRINGS: tuple[tuple[str, Callable[[Scan], Scan], set[tuple[FaultKind, int | None]]], ...] = (
    ("all reversed", lambda s: scaled(s, -1.0), {(FaultKind.REVERSED, None)}),
    ("all reversed at half gain", lambda s: scaled(s, -0.5), {(FaultKind.REVERSED, None)}),
    ("one reversed", lambda s: scaled(s, 1.0, -1.0, 1.0), {(FaultKind.REVERSED, 1)}),
    (
        "two reversed",
        lambda s: scaled(s, -1.0, -1.0, 1.0),
        {(FaultKind.REVERSED, 0), (FaultKind.REVERSED, 1)},
    ),
    ("a thousand", lambda s: scaled(s, 1000.0), {(FaultKind.UNIT, None)}),
    ("a thousandth", lambda s: scaled(s, 0.001), {(FaultKind.UNIT, None)}),
    ("pounds inch", lambda s: scaled(s, 1.0 / 113.0), {(FaultKind.UNIT, None)}),
    (
        "a thousand, reversed",
        lambda s: scaled(s, -1000.0),
        {(FaultKind.UNIT, None), (FaultKind.REVERSED, None)},
    ),
    ("one amplifier at ten", lambda s: scaled(s, 1.0, 10.0, 1.0), {(FaultKind.UNIT, 1)}),
    ("one amplifier at a thousandth", lambda s: scaled(s, 1.0, 1e-3, 1.0), {(FaultKind.UNIT, 1)}),
    ("one channel twice", lambda s: wired(s, 0, 0), {(FaultKind.DOUBLED, 0), (FaultKind.DOUBLED, 1)}),
    ("supply off", lambda s: recorded_as(s, FaultKind.NO_SIGNAL), {(FaultKind.NO_SIGNAL, None)}),
    ("air and land exchanged", lambda s: recorded_as(s, FaultKind.LIFTED), {(FaultKind.LIFTED, None)}),
)


def recorded_as(scan: Scan, kind: FaultKind) -> Scan:
    """The recording with lifted samples in place of the touching ones; of LIFTED, touching in place of lifted."""

    def change(s: Sweep) -> Sweep:
        air, n = s.air_n_mm, s.plan.n_samples
        lifted = np.tile(air, (1, 1, n // air.shape[2] + 1))[..., :n]
        touching = s.moment_n_mm[..., 20 : 20 + air.shape[2]]
        return replace(s, moment_n_mm=lifted, air_n_mm=touching if kind is FaultKind.LIFTED else air)

    return changed(scan, change)


def kinds(faults: tuple[Fault, ...]) -> set[tuple[FaultKind, int | None]]:
    return {(f.kind, f.whisker) for f in faults}


@pytest.mark.parametrize(
    ("bench", "change", "expected"),
    [
        pytest.param(BENCHES[(k + shift) % len(BENCHES)], change, expected, id=f"{name}-{shift}")
        for k, (name, change, expected) in enumerate(WIRINGS)
        for shift in (0, 2)
    ],
)
def test_each_wiring_is_named_and_the_stage_is_left_alone(
    bench: tuple[Any, ...], change: Callable[[Scan], Scan], expected: set[tuple[FaultKind, int | None]]
) -> None:
    faults = find_faults(change(sound(*bench)))
    assert kinds(faults) == expected
    assert not any("too high" in f.text or "too low" in f.text for f in faults)


@pytest.mark.parametrize("bench", BENCHES, ids=str)
def test_sound_signals_give_no_alarm(bench: tuple[Any, ...]) -> None:
    scan = sound(*bench)
    assert find_faults(scan) == ()
    assert find_signal_faults(scaled(scan, -0.37), volts=True) == ()


def test_a_tilted_plate_is_no_fault_of_the_signals() -> None:
    faults = find_faults(sound(8, 0.0, ALL_DIRECTIONS, True, rise_mm=0.5))
    assert {f.kind for f in faults} == {FaultKind.TILTED}


def test_volts_are_only_compared_with_each_other() -> None:
    scan = sound(4, 0.3, ALL_DIRECTIONS, False)
    assert kinds(find_signal_faults(scaled(scan, 0.35, -0.35, 0.35), volts=True)) == {(FaultKind.REVERSED, 1)}
    assert kinds(find_signal_faults(scaled(scan, 0.35, 35.0, 0.35), volts=True)) == {(FaultKind.UNIT, 1)}


@settings(max_examples=12, deadline=None)
@given(pair=st.sets(st.integers(0, 5), min_size=2, max_size=2), bench=st.sampled_from(BENCHES[:2]))
def test_exchanged_channels_are_never_another_fault_and_neighbours_are_named(
    pair: set[int], bench: tuple[Any, ...]
) -> None:
    a, b = sorted(pair)
    order = list(range(6))
    order[a], order[b] = b, a
    faults = find_faults(wired(sound(*bench), *order))
    assert not {f.kind for f in faults} & (OF_THE_STAGE | SIGNALS - {FaultKind.EXCHANGED})
    (exchanged,) = [f for f in faults if f.kind is FaultKind.EXCHANGED]
    if b == a + 1 == 1:
        assert "with channels 0 and 1 exchanged" in exchanged.text


def test_lines_that_count_backward_within_each_whisker_are_named() -> None:
    """As where the sign of the position across the passes is wrong and that of across_mm is not."""
    scan = sound(8, 0.0, ALL_DIRECTIONS, False)
    backward = changed(
        scan, lambda s: replace(s, moment_n_mm=s.moment_n_mm[::-1]) if s.plan.direction.along_x else s
    )
    (fault,) = find_faults(backward)
    assert fault.kind is FaultKind.EXCHANGED
    assert "positions across the passes along x in reverse order" in fault.text


@pytest.mark.parametrize("bench", [b for b in BENCHES if not b[3]], ids=str)
def test_tips_beyond_the_part_are_flagged_as_by_the_simulation(bench: tuple[Any, ...]) -> None:
    scan, truth = sound(*bench), sound(*bench[:3], True)
    flagged = flag_faults(scan, find_faults(scan))
    for found, true in zip(flagged.sweeps, truth.sweeps, strict=True):
        outside = (true.flags & SampleFlag.OUTSIDE) != 0
        assert ((found.flags & SampleFlag.OUTSIDE) != 0)[outside].mean() > 0.99
        assert ((found.flags & SampleFlag.OUTSIDE) != 0)[~outside].mean() < 0.001
    assert flag_beyond_part(flagged) is flagged


def test_a_dead_whisker_at_the_end_of_the_comb_is_not_beyond_the_part() -> None:
    scan = sound(3, 0.0, ALONG_X, True)
    on_part = replace(scan, sweeps=tuple(s.of(np.array([0, 1])) for s in scan.sweeps), kind=())
    dead = scaled(on_part, 1.0, 0.0)
    assert kinds(find_faults(dead)) == {(FaultKind.DEAD, 1)}
