"""The bring-up guide on an emulated bench, hosts that die in a pass, and the parts of a bench by themselves."""

from __future__ import annotations

import re
import shlex
import signal
import subprocess
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from glyphs.errors import FileError
from glyphs.surface.maps import HeightMap
from glyphs.surface.pieces import PieceKind
from pipeline.bench.bench import Bench
from pipeline.bench.moves import Ramp, moves_of
from pipeline.bench.ni_daq import NiDaq
from pipeline.bench.settings import DaqSettings, read_bench
from pipeline.cli.main import main
from pipeline.common.parsed import write_toml
from pipeline.formats.synth import SynthSpec, make_part
from pipeline.formats.whisker_file import read_piece
from tests.support.bench import a_pass, bench_settings, stamped
from tests.support.emulator.bench import EmulatedBench
from tests.support.emulator.world import World
from tests.support.waiting import PATIENCE_S, wait_until
from whisker_array.scan.stage_error import StageError

GUIDE = Path(__file__).parents[3] / "docs" / "pages" / "how-to" / "bench.md"
PROGRAM = (sys.executable, "-m", "pipeline")


def blocks(kind: str) -> list[str]:
    return re.findall(rf"^```{kind}\n(.*?)^```", GUIDE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


def test_the_guide_leads_from_bench_toml_to_the_serial(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (toml, piece), bench = blocks("toml"), tmp_path / "bench.toml"
    bench.write_text(toml, encoding="utf-8")
    Path("piece.toml").write_text(piece, encoding="utf-8")
    commands = [
        line for block in blocks("bash") for line in block.splitlines() if line.startswith("tactile-marks")
    ]
    assert [c.split()[1:3] for c in commands[:4]] == [
        ["bench", word] for word in ("scan", "check", "home", "calibrate")
    ]
    part = make_part(SynthSpec("AA99", seed=8, height_mm=3.0), 0)

    def said(command: str) -> str:
        words = shlex.split(command)[1:]
        at = [w.replace("bench.toml", "emulated.toml") if w == "bench.toml" else w for w in words]
        assert main(at) == 0
        return capsys.readouterr().out

    bare = HeightMap(np.zeros((8, 8), np.float32), 0.075)
    with EmulatedBench(bare, read_bench(bench), seed=0) as emulated:
        write_toml(Path("emulated.toml"), emulated.settings)
        assert "all within the stage's travel" in said(commands[0])
        assert "<svg" in Path("moves.svg").read_text()
        assert "Grbl 1.1" in said(commands[1])
        assert "homed" in said(commands[2])
        gains = said(commands[3])
    assert re.fullmatch(r"gains_known = true\nvolt_per_n_mm = \[.*\]\n", gains)
    bench.write_text(toml + gains, encoding="utf-8")  # [daq] is the last table
    with EmulatedBench(part.height_map, read_bench(bench), seed=0) as marked:
        write_toml(Path("emulated.toml"), marked.settings)
        said(commands[4])
        rows = said(commands[5]).splitlines()[2:-1]
    assert ["never on the land" in row for row in rows] == [False] * 6 + [True] * 2
    assert [float(row.split()[1]) for row in rows] == pytest.approx([1.0] * 8, abs=0.02)
    # passes over the piece and the fit to them take a minute; tests/pipeline/cli/test_whisker.py has few of them
    assert "all within the stage's travel" in said(
        commands[6].replace("--out piece.h5", "--dry-run piece.svg")
    )
    assert commands[7].split()[1:] == ["identify", "piece.h5", "--piece", "piece.toml"]
    assert read_piece(Path("piece.toml")).kind is PieceKind.PITS
    with EmulatedBench(part.height_map, read_bench(bench), seed=0) as marked:
        write_toml(Path("emulated.toml"), marked.settings)
        told = said(commands[8])
    assert f"{part.text}, accepted" in told
    assert re.search(rf"{part.text} +accept", said(commands[-1]))


@pytest.mark.parametrize(("firmware", "ended_by"), [("marlin", signal.SIGKILL), ("grbl", signal.SIGTERM)])
def test_a_host_that_dies_in_a_pass_leaves_the_tips_lifted(
    tmp_path: Path, firmware: str, ended_by: signal.Signals
) -> None:
    with EmulatedBench(stamped(), bench_settings(firmware), seed=1) as emulated:
        write_toml(tmp_path / "bench.toml", emulated.settings)
        world = emulated.world

        def slow(now: World) -> None:
            now.pace = 0.5 if now.touching and now.touched else 0.0

        world.watch = slow
        scan = [*PROGRAM, "bench", "scan", str(tmp_path / "bench.toml"), "--out", str(tmp_path / "scan.h5")]
        host = subprocess.Popen(scan, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            wait_until(lambda: world.touching and world.touched)
            host.send_signal(ended_by)
            host.wait(PATIENCE_S)
        finally:
            host.kill()
        if ended_by is signal.SIGTERM:
            assert host.returncode == 130
            assert not world.touched  # before it has ended
        wait_until(lambda: not emulated.stage.busy and not world.touched)
        assert not (tmp_path / "scan.h5").exists()
        # the next start: home, and feel
        with Bench(read_bench(tmp_path / "bench.toml")) as bench:
            assert bench.stage.lost
            assert not bench.session().feel(a_pass()).flags.any()


@given(distance=st.floats(0.01, 300.0), speed=st.floats(1.0, 200.0), acceleration=st.floats(50.0, 5000.0))
def test_a_ramp_is_its_speed_summed_up(distance: float, speed: float, acceleration: float) -> None:
    ramp = Ramp(distance, speed, acceleration)
    time_s = np.linspace(0.0, ramp.duration_s, 4001)
    rate = np.minimum(np.minimum(acceleration * time_s, acceleration * time_s[::-1]), ramp.peak_mm_s)
    summed = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(time_s))])
    # the trapezoid rule misses a corner by less than a step's square
    assert np.abs(ramp.at_mm(time_s) - summed).max() < 1e-3 * distance
    assert ramp.peak_mm_s <= speed + 1e-12


def test_a_bench_file_is_read_as_written(tmp_path: Path) -> None:
    write_toml(tmp_path / "bench.toml", bench_settings("marlin"))
    assert read_bench(tmp_path / "bench.toml") == bench_settings("marlin")


@pytest.mark.parametrize(
    ("was", "is_now", "told"),
    [
        ("baud", "bauds", "unknown key stage.bauds"),
        ("lift_mm = 5.0", "lift_mm = 50.0", "lie within travel_mm's z"),
        ("range_v = 5.0", "range_v = -5.0", "daq.range_v = -5.0"),
        ("volt_per_n_mm = 1.0", "volt_per_n_mm = [1.0, 1.0]", "2 gains in volt_per_n_mm for 3 whiskers"),
        ('kind = "line"', 'kind = "nidaqmx"', "needs channels and sync_channel"),
    ],
)
def test_what_is_wrong_with_a_bench_file_is_told(tmp_path: Path, was: str, is_now: str, told: str) -> None:
    path = tmp_path / "bench.toml"
    write_toml(path, bench_settings())
    text = path.read_text()
    assert was in text
    path.write_text(text.replace(was, is_now, 1))
    with pytest.raises(FileError) as raised:
        read_bench(path)
    assert told in str(raised.value)


def test_a_turned_comb_keeps_its_tips_over_their_lines() -> None:
    bench = bench_settings()
    forth, back = (moves_of(a_pass(d), bench, preload_mm=0.6) for d in (0, 180))
    assert forth.whisker == (0, 1, 2)
    assert back.whisker == (2, 1, 0)
    # tips 2 mm ahead of the axis and 0.5 mm aside: turned about, the axis passes 4 mm and 1 mm elsewhere
    middle = [np.mean([m.begin_mm, m.end_mm], axis=0) for m in (forth, back)]
    assert middle[1] - middle[0] == pytest.approx([4.0, -1.0])
    assert (forth.touch_z_mm, forth.lift_z_mm) == (-30.6, -25.0)


class _Task:
    """Documented behaviour of nidaqmx.Task that the driver uses: continuous samples, all read at once."""

    def __init__(self) -> None:
        self.channels: list[str] = []
        self.ai_channels = SimpleNamespace(add_ai_voltage_chan=self._add)
        self.timing = SimpleNamespace(cfg_samp_clk_timing=self._clock, samp_clk_rate=0.0)
        self.at_work, self.closed = False, 0

    def _add(self, physical: str, *, min_val: float, max_val: float) -> None:
        assert (min_val, max_val) == (-10.0, 10.0)
        device, _, names = physical.partition("/ai")
        first, _, last = names.partition(":")
        self.channels += [f"{device}/ai{i}" for i in range(int(first), int(last or first) + 1)]

    def _clock(self, rate: float, *, sample_mode: str, samps_per_chan: int) -> None:
        assert (sample_mode, samps_per_chan) == ("continuous", 60 * rate)
        self.timing.samp_clk_rate = rate

    @property
    def number_of_channels(self) -> int:
        return len(self.channels)

    def start(self) -> None:
        self.at_work = True

    def stop(self) -> None:
        self.at_work = False

    def close(self) -> None:
        self.closed += 1

    def read(self, count: int, *, timeout: float) -> list[list[float]]:
        assert self.at_work
        assert count == -1
        return [[0.5, 9.999, 0.0], [-0.5, 0.0, 0.25], [0.1, 4.9, 0.2]]


@pytest.fixture
def tasks(monkeypatch: pytest.MonkeyPatch) -> list[_Task]:
    made: list[_Task] = []

    def task() -> _Task:
        made.append(_Task())
        return made[-1]

    library: Any = ModuleType("nidaqmx")
    library.Task, library.errors = task, SimpleNamespace(Error=type("Error", (Exception,), {}))
    constants: Any = ModuleType("nidaqmx.constants")
    constants.AcquisitionType, constants.READ_ALL_AVAILABLE = SimpleNamespace(CONTINUOUS="continuous"), -1
    library.constants = constants
    monkeypatch.setitem(sys.modules, "nidaqmx", library)
    monkeypatch.setitem(sys.modules, "nidaqmx.constants", constants)
    return made


NI = DaqSettings(kind="nidaqmx", channels="Dev1/ai0:1", sync_channel="Dev1/ai8")


def test_a_card_of_ni_samples_whiskers_and_sync_by_one_clock(tasks: list[_Task]) -> None:
    daq = NiDaq(NI)
    assert tasks[0].channels == ["Dev1/ai0", "Dev1/ai1", "Dev1/ai8"]
    assert daq.whiskers == 2
    daq.start()
    record = daq.stop()
    assert record.volts.tolist() == [[0.5, -0.5], [9.999, 0.0], [0.0, 0.25]]
    assert record.sync.tolist() == [False, True, False]
    assert record.clipped.tolist() == [[False, False], [True, False], [False, False]]
    assert record.stretches() == [slice(1, 2)]
    daq.close()
    daq.close()
    assert tasks[0].closed == 1


def test_what_the_card_refuses_is_a_stages_error(tasks: list[_Task], monkeypatch: pytest.MonkeyPatch) -> None:
    daq = NiDaq(NI)

    def overwritten(count: int, *, timeout: float) -> None:
        raise sys.modules["nidaqmx"].errors.Error("samples were overwritten, -200279")

    monkeypatch.setattr(tasks[0], "read", overwritten)
    daq.start()
    with pytest.raises(StageError, match="-200279"):
        daq.stop()
