"""The bring-up guide on an emulated bench, command by command, and hosts that die in the middle of a pass."""

from __future__ import annotations

import re
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from glyphs.surface.maps import HeightMap
from glyphs.surface.pieces import PieceKind
from pipeline.bench.bench import Bench
from pipeline.bench.settings import read_bench
from pipeline.cli.main import main
from pipeline.common.parsed import write_toml
from pipeline.formats.synth import SynthSpec, make_part
from pipeline.formats.whisker_file import read_piece
from tests.support.bench import a_pass, bench_settings, stamped
from tests.support.emulator.bench import EmulatedBench
from tests.support.emulator.world import World
from tests.support.waiting import PATIENCE_S, wait_until

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
    part = make_part(SynthSpec("AA99", seed=4, height_mm=3.0), 0)

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
