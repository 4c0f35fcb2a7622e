"""The worked example of the page on imported traces: its description, commands and output."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import numpy as np
import pytest

from pipeline.cli.main import main
from whisker_array.scan.recording import load_scan

PAGE = Path(__file__).parents[2] / "docs" / "pages" / "how-to" / "import.md"
MAKE = """
tactile-marks synth parts --parts 1 --format A9 --seed 4 --no-photo
tactile-marks design --height-mm 5 --alpha 30:60 --mu 0.1:0.5 --depth-mm 0.2 --no-trade-offs --out whisker.toml
tactile-marks scan parts/part-000.npz --height-mm 5 --whisker whisker.toml --fidelity pointwise --out simulated.h5
"""


def run(commands: str) -> None:
    for command in commands.strip().splitlines():
        assert main(shlex.split(command)[1:]) == 0, command


def write_traces(source: str, target: str) -> None:
    """Write four whiskers of a scan as the page describes: volts, um, decimal commas, a jittering position."""
    scan, rng, t = load_scan(source), np.random.default_rng(1), 0.0
    lines, run_number = ["t;X;Y;run;up;w0;w1;w2;w3"], 0
    for sweep in scan.sweeps:
        n_air, along = sweep.air_n_mm.shape[2], 1000.0 * sweep.plan.position_mm()
        along = np.concatenate([np.full(n_air, along[0]), along + rng.normal(0.0, 2.0, along.size)])
        for line_mm, air, moment in zip(sweep.plan.line_mm, sweep.air_n_mm, sweep.moment_n_mm, strict=True):
            across = np.full(along.size, 1000.0 * line_mm[0])
            x, y = (along, across) if sweep.plan.direction.along_x else (across, along)
            volts = 0.2 + 0.35 * np.concatenate([air, moment], axis=1)[:4]  # zero and gain of the bridge
            for k in range(along.size):
                t += 1.0 / scan.sample_rate_hz
                values = ";".join(f"{v:.5f}" for v in volts[:, k])
                row = f"{t:.6f};{x[k]:.1f};{y[k]:.1f};{run_number};{int(k < n_air)};{values}"
                lines.append(row.replace(".", ","))
            run_number += 1
    Path(target).write_text("\n".join(lines) + "\n", encoding="utf-8")


def test_the_example_of_imported_traces_reads_the_plate(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    blocks = dict(re.findall(r"^```(\w*)\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.M | re.S))
    monkeypatch.chdir(tmp_path)
    Path("traces.toml").write_text(blocks["toml"], encoding="utf-8")
    run(MAKE)
    write_traces("simulated.h5", "traces.csv")
    capsys.readouterr()
    run(blocks[""])
    printed = capsys.readouterr().out
    assert blocks["text"] in printed
    assert "S9    accept" in printed
