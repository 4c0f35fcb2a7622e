"""Traces of other benches: clocks, polls, channels that begin at other times, overloads, encoders and wiring."""

from __future__ import annotations

import re
import struct
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline import read_scan
from tests.contract.front_doors import Command, Ended

Floats = NDArray[np.float64]
RATE_HZ, SPEED_MM_S, AIR = 500.0, 25.0, 40
WHISKER = """
kind = "L"
l1_mm = 30.0
l2_mm = 2.5
preload_mm = 0.6
tip_radius_mm = 0.05
friction = 0.2
character_height_mm = 5.0
[section]
kind = "ribbon"
thickness_mm = 0.2
width_mm = 1.0
"""
TRACES = """
whisker = "whisker.toml"
moment_unit = "V"
lead_mm = 1.5
part_mm = [0.0, 0.0, 20.0, 20.0]
[columns]
moment = ["w"]
x = "x"
y = "y"
time = "t"
lifted = "up"
pass = "run"
"""


def table() -> dict[str, Floats]:
    """Four passes along x over a groove at 10 mm, 22 mm long, that begin and end 1 mm beyond the part; volts."""
    x = np.concatenate([np.full(AIR, -1.0), np.arange(-1.0, 21.0, SPEED_MM_S / RATE_HZ)])
    volts = np.where(np.arange(x.size) < AIR, 0.2, 0.2 - 0.5 * (1.0 + 0.3 * np.exp(-((x - 10.0) ** 2))))
    noise = np.random.default_rng(2).normal(0.0, 1e-4, 4 * x.size)
    return {
        "t": np.arange(4 * x.size) / RATE_HZ,
        "x": np.tile(x, 4),
        "y": np.repeat(np.arange(4.0), x.size),
        "run": np.repeat(np.arange(4.0), x.size),
        "up": np.tile((np.arange(x.size) < AIR).astype(float), 4),
        "w": np.tile(volts, 4) + noise,
    }


def write(
    folder: Path,
    columns: dict[str, Floats],
    *,
    stamp: Callable[[float], str] = "{:.6f}".format,
    told: str = TRACES,
) -> tuple[Path, Path]:
    """A CSV of the columns, and what stands in it; the time as `stamp` writes it."""
    (folder / "whisker.toml").write_text(WHISKER)
    (folder / "traces.toml").write_text(told)
    lines = [",".join(columns)]
    for row in zip(*columns.values(), strict=True):
        lines.append(
            ",".join(stamp(v) if name == "t" else f"{v:.5f}" for name, v in zip(columns, row, strict=True))
        )
    (folder / "traces.csv").write_text("\n".join(lines) + "\n")
    return folder / "traces.csv", folder / "traces.toml"


def imported(command: Command, folder: Path, file: Path, told: Path) -> Ended:
    return command("import", file, "--traces", told, "--out", folder / "scan.h5")


def groove_mm(command: Command, folder: Path, *, usable: float = 0.99) -> Floats:
    """Where each pass of the calibrated recording has its groove; nearly all of it must have been felt."""
    assert command("calibrate", folder / "scan.h5", "--in-place").status == 0
    (sweep,) = read_scan(folder / "scan.h5").sweeps
    moment = np.abs(np.where(sweep.flags == 0, sweep.moment_n_mm, 0.0))[:, 0]
    felt = (sweep.flags == 0).mean()
    assert felt > usable, f"{felt:.0%} of the samples are usable"
    return np.asarray(sweep.plan.position_mm()[moment.argmax(axis=1)])


def clock(seconds: float) -> str:
    """A time stamp shortly before midnight, and after it."""
    second = (86_390.0 + seconds) % 86_400.0
    day, hour, minute = 1 + (seconds >= 10.0), int(second // 3600), int(second // 60 % 60)
    return f"2024-03-0{day} {hour:02d}:{minute:02d}:{second % 60:09.6f}"


@pytest.mark.parametrize(
    "stamp",
    [
        pytest.param("{:.6f}".format, id="seconds"),
        pytest.param(lambda s: f"{np.floor(100.0 * s + 1e-6) / 100.0:.2f}", id="ticks of 10 ms"),
        pytest.param(lambda s: f"{(86_398.0 + s) % 86_400.0:.4f}", id="seconds of the day, over midnight"),
        pytest.param(clock, id="time stamps over midnight"),
    ],
)
def test_the_rate_is_found_whatever_the_clock(
    command: Command, tmp_path: Path, stamp: Callable[[float], str]
) -> None:
    done = imported(command, tmp_path, *write(tmp_path, table(), stamp=stamp))
    assert done.status == 0, done.err
    assert float(re.findall(r"at ([\d.]+) Hz", done.out)[0]) == pytest.approx(RATE_HZ, rel=0.01)


def test_milliseconds_are_asked_about_and_read_when_told(command: Command, tmp_path: Path) -> None:
    def ms(seconds: float) -> str:
        return f"{1000.0 * seconds:.3f}"

    refused = imported(command, tmp_path, *write(tmp_path, table(), stamp=ms))
    assert refused.status == 1
    assert 'say time_unit = "ms"' in refused.err
    told = 'time_unit = "ms"' + TRACES
    done = imported(command, tmp_path, *write(tmp_path, table(), stamp=ms, told=told))
    assert "at 500 Hz" in done.out


@pytest.mark.parametrize("every", [3, 4, 8])
def test_positions_polled_more_slowly_than_signals_lose_no_samples(
    command: Command, tmp_path: Path, every: int
) -> None:
    columns = table()
    n = columns["x"].size // 4
    within = np.r_[np.arange(AIR), AIR + np.arange(n - AIR) // every * every]
    polled = np.concatenate([k * n + within for k in range(4)])
    columns["x"] = columns["x"][polled]
    done = imported(command, tmp_path, *write(tmp_path, columns))
    assert done.status == 0, done.err
    assert np.abs(groove_mm(command, tmp_path) - 10.0).max() <= 0.1


@pytest.mark.parametrize("by", ["offset", "start time"])
def test_tdms_channels_that_begin_later_are_laid_on_the_same_clock(
    command: Command, tmp_path: Path, by: str
) -> None:
    nptdms = pytest.importorskip("nptdms")
    columns, lag = table(), 15
    start, groups = np.datetime64("2024-03-01T09:30:00", "us"), []
    for name in ("x", "y", "run", "up", "w"):
        late = lag if name == "w" else 0
        late_us = np.timedelta64(round(1e6 * late / RATE_HZ), "us")
        properties = {
            "wf_increment": 1.0 / RATE_HZ,
            "wf_start_offset": late / RATE_HZ if by == "offset" else 0.0,
            "wf_start_time": start + late_us if by == "start time" else start,
        }
        groups.append(nptdms.ChannelObject("daq", name, columns[name][late:], properties=properties))
    _, told = write(tmp_path, columns, told=TRACES.replace('time = "t"\n', ""))
    with nptdms.TdmsWriter(str(tmp_path / "traces.tdms")) as writer:
        writer.write_segment(groups)
    done = imported(command, tmp_path, tmp_path / "traces.tdms", told)
    assert done.status == 0, done.err
    assert "at 500 Hz" in done.out
    assert np.abs(groove_mm(command, tmp_path) - 10.0).max() <= 0.1


def test_tdms_time_stamps_give_the_rate(command: Command, tmp_path: Path) -> None:
    nptdms = pytest.importorskip("nptdms")
    columns = table()
    stamps = np.datetime64("2024-03-01T09:30:00", "us") + (1e6 * columns["t"]).round().astype(
        "timedelta64[us]"
    )
    _, told = write(tmp_path, columns)
    with nptdms.TdmsWriter(str(tmp_path / "traces.tdms")) as writer:
        values = {**columns, "t": stamps}
        writer.write_segment([nptdms.ChannelObject("daq", name, one) for name, one in values.items()])
    done = imported(command, tmp_path, tmp_path / "traces.tdms", told)
    assert "at 500 Hz" in done.out, done.err


def test_calibrate_finds_the_land_of_the_part(command: Command, tmp_path: Path) -> None:
    imported(command, tmp_path, *write(tmp_path, table()))
    done = command("calibrate", tmp_path / "scan.h5")
    assert done.status == 0, done.err
    whisker, gain, offset, _, air, land = done.out.splitlines()[2].split()
    assert float(offset) == pytest.approx(0.2, abs=0.001)
    assert float(gain) != 1.0
    assert (int(whisker), int(air), int(land)) == (0, 4 * AIR, 4 * 30)


def test_calibrate_without_land_is_an_error(command: Command, tmp_path: Path) -> None:
    columns = table()
    columns["y"] += 30.0  # beside the part
    imported(command, tmp_path, *write(tmp_path, columns))
    done = command("calibrate", tmp_path / "scan.h5")
    assert done.status == 1
    assert "no whisker runs in on the part's land" in done.err
    assert not (tmp_path / "scan-calibrated.h5").exists()


def test_calibrate_names_the_whisker_that_feels_nothing(command: Command, tmp_path: Path) -> None:
    columns = table()
    columns["w"] = np.random.default_rng(3).normal(0.2, 1e-4, columns["w"].size)
    imported(command, tmp_path, *write(tmp_path, columns))
    done = command("calibrate", tmp_path / "scan.h5")
    assert done.status == 1
    assert "scan.h5: cannot be calibrated: whisker 0: " in done.err


def with_signals(folder: Path, columns: dict[str, Floats], written: dict[int, str]) -> tuple[Path, Path]:
    """Write the table with other text as the signal in some lines of the file, counted from 1."""
    file, told = write(folder, columns)
    lines = file.read_text().splitlines()
    for number, text in written.items():
        lines[number - 1] = ",".join([*lines[number - 1].split(",")[:-1], text])
    file.write_text("\n".join(lines) + "\n")
    return file, told


OVERLOADS = (
    *("9.9e37", "-9.9E+37", "9.91e37", "9.99999999e+37", "-1e30", "1e39", "3.4028235e38"),
    *("OVLD", "OL", "-OL", "O.L", "Overrange", "Inf", "-inf", "NaN", "#N/A", "1.#INF", "--"),
)


def test_overloads_are_missing_samples_lifted_or_not(command: Command, tmp_path: Path) -> None:
    lines = {40 * k + 5: text for k, text in enumerate(OVERLOADS)}  # that of line 5 is in the air
    done = imported(command, tmp_path, *with_signals(tmp_path, table(), lines))
    assert done.status == 0, done.err
    assert "missing samples (empty, or an overload): " in done.out
    assert np.abs(groove_mm(command, tmp_path, usable=0.98) - 10.0).max() <= 0.1
    assert "+0.2000" in command("calibrate", tmp_path / "scan.h5").out  # the offset, V


@pytest.mark.parametrize("column", ["x", "t"])
def test_an_overload_in_place_of_a_position_or_time_is_named_with_its_line(
    command: Command, tmp_path: Path, column: str
) -> None:
    columns = table()
    columns[column][498] = 9.9e37
    done = imported(command, tmp_path, *write(tmp_path, columns))
    assert done.status == 1
    assert re.search(r"9\.9e\+37.*in line 500", done.err)


def test_lines_out_of_order_are_named_before_the_positions(command: Command, tmp_path: Path) -> None:
    columns = table()
    n = columns["t"].size
    for late in (np.r_[0:600, 700:800, 600:700, 800:n], np.r_[0:900, 1000:1100, 900:1000, 1100:n]):
        done = imported(command, tmp_path, *write(tmp_path, {k: v[late] for k, v in columns.items()}))
        assert done.status == 1
        first = int(np.flatnonzero(np.diff(columns["t"][late]) < 0.0)[0])
        assert f"has times that run back in line {first + 3}; sort the lines" in done.err


@pytest.mark.parametrize(
    ("at_mm", "by_mm"),
    [(9.0, -65.536), (9.0, 65.536), (0.5, -4.096)],
    ids=["wraps", "wraps as it counts down", "is reset"],
)
def test_a_position_that_jumps_is_named_with_its_line(
    command: Command, tmp_path: Path, at_mm: float, by_mm: float
) -> None:
    columns = table()
    x, touching = columns["x"], np.flatnonzero((columns["run"] == 2.0) & (columns["up"] == 0.0))
    first = touching[np.searchsorted(x[touching], at_mm)]
    if by_mm > 0.0:
        x *= -1.0
    x[first : touching[-1] + 1] += by_mm
    told = TRACES.replace("part_mm = [0.0, 0.0, 20.0, 20.0]\n", "")
    done = imported(command, tmp_path, *write(tmp_path, columns, told=told))
    assert done.status == 1
    jump = re.search(r"a position that jumps by (\S+) mm in pass 2, in line (\d+)", done.err)
    assert jump is not None, done.err
    assert float(jump[1]) == pytest.approx(by_mm, abs=0.1)
    assert int(jump[2]) == first + 2


def test_a_counter_reset_between_passes_is_asked_about(command: Command, tmp_path: Path) -> None:
    columns = table()
    columns["x"][columns["run"] >= 2.0] -= 65.536
    done = imported(command, tmp_path, *write(tmp_path, columns))
    assert done.status == 1
    assert "reset of the encoder" in done.err


def two_whiskers(**more: Floats) -> tuple[dict[str, Floats], str]:
    columns = table()
    columns |= {"v": columns["w"].copy(), **more}
    told = TRACES.replace('moment = ["w"]', 'moment = ["w", "v"]')
    return columns, "across_mm = [0.0, 4.0]\n" + told


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda v: 0.4 - v, "whisker 1, reversed signal"),
        (lambda v: 1000.0 * v, "whisker 1, other unit"),
        (lambda v: 0.001 * v, "whisker 1, other unit"),
    ],
)
def test_a_channel_unlike_the_others_is_named_at_import(
    command: Command, tmp_path: Path, change: Callable[[Floats], Floats], says: str
) -> None:
    columns, told = two_whiskers()
    noise = np.random.default_rng(5).normal(0.0, 1e-4, columns["v"].size)
    columns["v"] = change(columns["v"] + noise)
    third, told = (
        {**columns, "u": columns["w"] - noise},
        told.replace('"v"]', '"v", "u"]').replace("4.0]", "4.0, 8.0]"),
    )
    done = imported(command, tmp_path, *write(tmp_path, third, told=told))
    assert done.status == 0, done.err
    assert says in done.out


def test_one_signal_recorded_twice_is_named_at_import(command: Command, tmp_path: Path) -> None:
    columns, told = two_whiskers()
    done = imported(command, tmp_path, *write(tmp_path, columns, told=told))
    assert "whisker 1, doubled channel" in done.out


def tdms_segment(description: bytes, data: bytes, contents: int) -> bytes:
    """Lead-in, description and data of a TDMS segment."""
    lead_in = b"TDSm" + struct.pack("<IIQQ", contents, 4713, len(description) + len(data), len(description))
    return lead_in + description + data


def tdms_description(*paths: str) -> bytes:
    """A description of channels of one byte a piece."""
    objects = (struct.pack("<I", len(p)) + p.encode() + struct.pack("<IIIQI", 20, 1, 1, 1, 0) for p in paths)
    return struct.pack("<I", len(paths)) + b"".join(objects)


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (
            lambda: tdms_segment(
                tdms_description("/'daq'/'w'", "/'daq'/'x'", "/'daq'/'y'"), bytes(3_000_000), 14
            ),
            "300,000 pieces",
        ),
        (
            lambda: (
                tdms_segment(tdms_description("/'daq'/'w'"), b"0", 14) + 110_000 * tdms_segment(b"", b"0", 8)
            ),
            "100,000 segments",
        ),
        (lambda: tdms_segment(struct.pack("<I", 250_000), b"", 6), "200,000 described objects"),
        (lambda: tdms_segment(bytes(17_000_000), b"", 6), "16,000,000 bytes of descriptions"),
        (
            lambda: (
                tdms_segment(tdms_description(*(f"/'daq'/'{k}'" for k in range(3000))), bytes(3000), 14)
                + 30_000 * tdms_segment(b"", b"", 8)
            ),
            "10,000,000 objects in its segments together",
        ),
    ],
    ids=["pieces", "segments", "objects", "descriptions", "inherited objects"],
)
def test_tdms_work_is_counted_before_it_is_done(
    command: Command, tmp_path: Path, spoil: Callable[[], bytes], says: str
) -> None:
    pytest.importorskip("nptdms")
    (tmp_path / "whisker.toml").write_text(WHISKER)
    columns = '[columns]\nmoment = ["w"]\nx = "x"\ny = "y"\n'
    (tmp_path / "traces.toml").write_text(f'whisker = "whisker.toml"\nsampling_rate_hz = 500.0\n{columns}')
    (tmp_path / "traces.tdms").write_bytes(spoil())
    started = time.process_time()
    done = imported(command, tmp_path, tmp_path / "traces.tdms", tmp_path / "traces.toml")
    assert done.status == 1
    assert says in done.err
    assert time.process_time() - started < 10.0
