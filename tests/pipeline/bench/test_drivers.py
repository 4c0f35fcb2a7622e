"""Stage and converter driven over pseudo-terminals: what is felt, and what is done when something goes wrong."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.bench.bench import Bench, raster_passes
from pipeline.bench.moves import comb_turn_deg
from pipeline.formats.whisker_file import WhiskerFile, write_whisker_file
from recognition.see.levelling import level
from tests.support.bench import FIRMWARE, HEIGHT_MM, PITCH_MM, a_pass, bench_settings, stamped
from tests.support.emulator.bench import EmulatedBench
from tests.support.emulator.boards import EmulatedGrbl, EmulatedMarlin
from tests.support.emulator.world import World, on_plate
from tests.support.waiting import wait_until
from whisker_array.scan.simulated_session import SimulatedSession
from whisker_array.scan.stage_error import StageError
from whisker_array.whisker.array import ALL_DIRECTIONS, PIECE_LINES
from whisker_array.whisker.comb import WhiskerArray
from whisker_array.whisker.defaults import default_whisker
from whisker_array.whisker.touch import default_touch

LIFTED_MM = -30.0 + 5.0
"""Machine z at which tips are carried."""


@contextmanager
def opened(firmware: str = "grbl", **stage: object) -> Iterator[tuple[EmulatedBench, Bench]]:
    with (
        EmulatedBench(stamped(), bench_settings(firmware, **stage), seed=1) as emulated,
        Bench(emulated.settings) as bench,
    ):
        yield emulated, bench


def once(world: World, when: Callable[[World], bool], then: Callable[[], None]) -> None:
    """Do something the first time that the world is so."""

    def watch(now: World) -> None:
        if when(now):
            now.watch = None
            then()

    world.watch = watch


def in_a_pass(world: World) -> bool:
    return world.touching and world.touched


def shape_of(moment: NDArray[np.float32]) -> NDArray[np.float64]:
    """Each line about its mean, by its own spread: without gain and offset."""
    lines = moment.astype(np.float64) - moment.mean(axis=1, keepdims=True)
    return np.asarray(lines / lines.std(axis=1, keepdims=True))


@pytest.mark.parametrize("firmware", FIRMWARE)
def test_passes_in_all_directions_feel_what_the_simulated_stage_feels(firmware: str) -> None:
    part = on_plate(level(stamped()), bench_settings())
    alone = SimulatedSession(
        part,
        touch=bench_settings().fitting().touch,
        array=WhiskerArray(3, PITCH_MM),
        height_mm=HEIGHT_MM,
        sample_pitch_mm=HEIGHT_MM / 80.0,
    )
    with opened(firmware) as (emulated, bench):
        session = bench.session("plate")
        # every direction once; what lies between drivers and directions is the same for both kinds of firmware
        for direction in (0, 90, 180, 270) if firmware == FIRMWARE[0] else (90,):
            felt, true = (one.feel(a_pass(direction)) for one in (session, alone))
            assert not felt.flags.any()
            # of a trace's own spread: noise of 1e-4 of the range, samples averaged over their distance
            off = shape_of(felt.moment_n_mm[0]) - shape_of(true.moment_n_mm[0])
            marked = true.moment_n_mm[0].std(axis=1) > 0.02
            assert marked.any()
            assert np.sqrt((off**2).mean(axis=1))[marked].max() < 0.15
            assert emulated.world.place_mm["Z"] == pytest.approx(LIFTED_MM)
        session.close()


def test_passes_run_at_the_speed_of_the_whiskers_file(tmp_path: Path) -> None:
    usual = bench_settings()
    path = tmp_path / "slow.toml"
    whisker, touch = default_whisker(HEIGHT_MM), default_touch(HEIGHT_MM)
    write_whisker_file(path, WhiskerFile(whisker, touch, HEIGHT_MM, 0.1, 0.05, speed_mm_s=12.0))
    slow = usual.model_copy(update={"comb": usual.comb.model_copy(update={"whisker": path})})
    for settings, speed in ((usual, 10.0 * HEIGHT_MM), (slow, 12.0)):
        fitting = settings.fitting()
        assert fitting.speed_mm_s == speed
        orders = raster_passes(fitting, (2.0, 2.0, 8.0, 8.0), ALL_DIRECTIONS)
        assert {order.speed_mm_s for order in orders} == {speed}


def test_every_whisker_crosses_a_test_piece_and_keeps_its_column() -> None:
    with opened() as (emulated, bench):
        session, region = bench.session(), (6.0, 4.0, 8.0, 5.5)
        passes = raster_passes(session.fitting, region, ALL_DIRECTIONS, each_whisker=True)
        amplifier = emulated.world.amplifier
        for turn in (0, 90, 180, 270):
            of_turn = [order for order in passes if comb_turn_deg(order) == turn]
            assert {order.pushed for order in of_turn} == {False, True}
            low, high = (4.0, 5.5) if of_turn[0].direction.along_x else (6.0, 8.0)
            lines = np.array([order.line_mm for order in of_turn if not order.pushed])
            for of_whisker in lines.T:
                crossed = np.unique(of_whisker[(of_whisker >= low) & (of_whisker <= high)])
                assert crossed == pytest.approx(np.arange(low, high + 1e-6, HEIGHT_MM / PIECE_LINES))
            # gains that a bench does not know show in the moments of land: each stands in the column of its whisker
            felt = session.feel(of_turn[len(lines) // 2])
            land = np.abs(np.median(felt.moment_n_mm[0], axis=1))
            assert land / land.mean() == pytest.approx(
                amplifier.gain_v_per_n_mm / amplifier.gain_v_per_n_mm.mean(), rel=0.01
            )


def test_gains_found_on_bare_land_belong_to_their_whiskers() -> None:
    with opened() as (emulated, bench):
        bench.home()
        amplifier = emulated.world.amplifier
        found = bench.calibrate(a_pass(length_mm=2.0, at_mm=(1.6, 5.0)))
        turned = bench.calibrate(a_pass(180, length_mm=2.0, at_mm=(1.6, 5.0)))
    # land before the first character; levelling leaves it a micrometre or two off, of a preload of 600
    assert found.gain == pytest.approx(amplifier.gain_v_per_n_mm, rel=0.01)
    assert turned.gain == pytest.approx(amplifier.gain_v_per_n_mm, rel=0.01)
    assert found.offset_n_mm == pytest.approx(amplifier.offset_v, abs=1e-3)


def test_nothing_is_sent_beyond_the_travel() -> None:
    with opened() as (emulated, bench):
        bench.home()
        taken = emulated.stage.taken
        with pytest.raises(StageError, match="beyond the stage's travel"):
            bench.session().feel(a_pass(at_mm=(119.0, 5.0)))
        with pytest.raises(StageError, match="over the limit of"):
            bench.session().feel(replace(a_pass(), preload_mm=2.5))
        with pytest.raises(StageError, match="another comb"):
            bench.session().feel(replace(a_pass(), line_mm=(3.0, 5.0, 7.0)))
        assert emulated.stage.taken == taken


def test_without_a_turning_axis_only_x_is_felt() -> None:
    with opened(turn_axis="") as (_, bench):
        session = bench.session()
        session.feel(a_pass(0))
        with pytest.raises(StageError, match="a comb that turns"):
            session.feel(a_pass(90))


@pytest.mark.parametrize("firmware", FIRMWARE)
def test_a_reset_in_the_middle_lifts_and_wants_homing(firmware: str) -> None:
    with opened(firmware) as (emulated, bench):
        session = bench.session()
        once(emulated.world, in_a_pass, emulated.stage.reset_button)
        with pytest.raises(StageError, match="reset in the middle"):
            session.feel(a_pass())
        assert emulated.world.place_mm["Z"] > -30.0
        with pytest.raises(StageError, match="does not know its position"):
            session.feel(a_pass())
        bench.home()
        session.feel(a_pass())


@pytest.mark.parametrize("firmware", FIRMWARE)
def test_an_interrupt_in_the_middle_stops_and_lifts(firmware: str, monkeypatch: pytest.MonkeyPatch) -> None:
    with EmulatedBench(stamped(), bench_settings(firmware), seed=1, pace=0.2) as emulated:
        bench = Bench(emulated.settings)
        session, line = bench.session(), bench.stage.port.line

        def interrupted(*, wait_s: float) -> str | None:
            if in_a_pass(emulated.world):
                monkeypatch.setattr(bench.stage.port, "line", line)
                raise KeyboardInterrupt
            return line(wait_s=wait_s)

        monkeypatch.setattr(bench.stage.port, "line", interrupted)
        with pytest.raises(KeyboardInterrupt), bench:
            session.feel(a_pass())
        assert not emulated.stage.busy
        assert emulated.world.place_mm["Z"] > -30.0
        assert emulated.world.place_mm["X"] < 30.0 + 10.0  # it had not run to the end


def test_late_answers_cost_nothing() -> None:
    with opened() as (emulated, bench):
        session = bench.session()
        said = emulated.stage.terminal.write

        def late(data: bytes) -> None:
            time.sleep(0.03)
            said(data)

        emulated.stage.terminal.write = late  # type: ignore[method-assign]
        assert not session.feel(a_pass()).flags.any()


@pytest.mark.parametrize("firmware", FIRMWARE)
def test_a_silent_controller_is_given_up_and_has_the_lift_already(firmware: str) -> None:
    def falls_silent() -> None:
        emulated.stage.terminal.silent = True

    with EmulatedBench(stamped(), bench_settings(firmware, answer_s=0.3), seed=1) as emulated:
        bench = Bench(emulated.settings)
        session = bench.session()
        once(emulated.world, in_a_pass, falls_silent)
        with pytest.raises(StageError, match=r"has not answered|not ended in time"):
            session.feel(a_pass())
        bench.close()
        assert emulated.world.place_mm["Z"] > -30.0


def test_grbl_tells_of_alarms_and_of_lines_that_it_refuses() -> None:
    with opened() as (emulated, bench):
        bench.home()
        assert isinstance(emulated.stage, EmulatedGrbl)
        with pytest.raises(StageError, match=r"refuses a line \(error:20\)"):
            bench.stage.run(["G2X1Y1I1"], seconds=0.1)
        bench.home()
        with pytest.raises(StageError, match="left the soft limits"):
            bench.stage.run(["G53G1Z7.000F600"], seconds=0.1)
        bench.home()
        # 40 lines are more than the firmware's 128 bytes hold: none is lost
        taken = emulated.stage.taken
        bench.stage.run([f"G53G1X{x}.500Y10.000F3000" for x in range(40)] + ["G4P0.01"], seconds=2.0)
        assert emulated.stage.taken - taken == 41
        assert emulated.world.place_mm["X"] == pytest.approx(39.5)


def test_marlin_gets_spoilt_lines_again() -> None:
    with opened("marlin") as (emulated, bench):
        assert isinstance(emulated.stage, EmulatedMarlin)
        stage, session = emulated.stage, bench.session()
        clean = session.feel(a_pass())

        def spoil() -> None:
            stage.spoil = 1

        once(emulated.world, lambda world: world.touching, spoil)
        again = session.feel(a_pass())
        assert stage.spoil == 0
        # noise alone
        assert np.abs(clean.moment_n_mm - again.moment_n_mm).max() < 0.02
        assert emulated.world.place_mm["Z"] == pytest.approx(LIFTED_MM)


def test_a_marlin_that_is_deaf_to_the_quick_stop_is_halted() -> None:
    with opened("marlin", answer_s=0.3) as (emulated, bench):
        assert isinstance(emulated.stage, EmulatedMarlin)
        bench.home()
        emulated.stage.terminal.silent = True
        with pytest.raises(StageError, match="was halted"):
            bench.stage.stop()
        stage = emulated.stage
        wait_until(lambda: stage.halted)


def test_a_converter_that_loses_samples_or_resets_is_told_of() -> None:
    with opened() as (emulated, bench):
        session = bench.session()
        emulated.daq.lose = 2
        with pytest.raises(StageError, match=r"2 of .* samples are missing"):
            session.feel(a_pass())
        once(emulated.world, in_a_pass, emulated.daq.reset_button)
        with pytest.raises(StageError, match="converter was reset"):
            session.feel(a_pass())
        assert emulated.world.place_mm["Z"] == pytest.approx(LIFTED_MM)
        session.feel(a_pass())


def test_a_pass_at_another_speed_than_ordered_is_refused() -> None:
    with opened() as (emulated, bench):
        session = bench.session()
        emulated.stage._acceleration = 100.0  # the firmware is set otherwise than bench.toml says
        with pytest.raises(StageError, match="set acceleration_mm_s2 as in the firmware"):
            session.feel(a_pass())


def test_a_sync_wire_that_is_off_is_named() -> None:
    with opened() as (emulated, bench):
        sample = emulated.world.sampler
        assert sample is not None
        emulated.world.sampler = lambda begin, end, touching, volts: sample(begin, end, False, volts)
        with pytest.raises(StageError, match="output set 0 times"):
            bench.session().feel(a_pass())


def test_a_port_that_is_not_there_and_one_that_speaks_otherwise() -> None:
    with pytest.raises(StageError, match="cannot be opened at none"):
        Bench(bench_settings())
    with EmulatedBench(stamped(), bench_settings(answer_s=0.3), seed=1) as emulated:
        stage = emulated.settings.stage
        as_marlin = emulated.settings.model_copy(
            update={"stage": stage.model_copy(update={"firmware": "marlin"})}
        )
        with pytest.raises(StageError, match="does not answer like Marlin"):
            Bench(as_marlin)
