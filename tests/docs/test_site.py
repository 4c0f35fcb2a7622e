"""The documentation: scripts run, commands exist, the glossary is complete, the site builds without a warning."""

from __future__ import annotations

import doctest
import importlib.util
import os
import re
import runpy
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from pipeline.cli.main import app, main
from pipeline.runs.summary import GLOSSARY
from recognition.decide.decision import Decision, ReadingFlag
from recognition.decide.verify import Verdict
from recognition.language.confusions import CharacterState
from recognition.marks.grade import LIMITS, Action
from whisker_array.scan.recording import load_scan

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = (ROOT / "README.md", *sorted((DOCS / "pages").rglob("*.md")), *sorted((DOCS / "notes").glob("*.md")))
LIBRARY = DOCS / "pages" / "reference" / "library.md"
COMMAND = re.compile(
    r"^ *(?:tactile-marks|py -m pipeline) ([a-z][^|\n]*)$|`tactile-marks ([a-z][^`|]*)`", re.MULTILINE
)
SCRIPT = re.compile(r"(<!-- not run: [^\n]+ -->\n+)?^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)


def _scripts() -> list[object]:
    return [
        pytest.param(
            found[2], id=f"{page.relative_to(ROOT)}:{page.read_text()[: found.start()].count(chr(10)) + 1}"
        )
        for page in PAGES
        for found in SCRIPT.finditer(page.read_text(encoding="utf-8"))
        if not found[1]
    ]


@pytest.mark.parametrize("script", _scripts())
def test_scripts_of_the_documentation_run(
    script: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "script.py"
    path.write_text(script, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "agg")
    status: object = 0
    try:
        runpy.run_path(str(path), run_name="__main__")
    except SystemExit as ended:
        status = ended.code
    assert not status


def test_the_examples_of_the_library_give_what_the_page_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "agg")
    done = doctest.testfile(str(LIBRARY), module_relative=False, optionflags=doctest.IGNORE_EXCEPTION_DETAIL)
    assert done.attempted > 20
    assert done.failed == 0
    assert {file.name for file in tmp_path.iterdir()} == {"edges.png", "part.npz"}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_commands_and_flags_of_the_documentation_exist(page: Path) -> None:
    text = page.read_text(encoding="utf-8").replace("\\\n", " ")
    for line in map("".join, COMMAND.findall(text)):
        words = shlex.split(line.split("  #")[0].rstrip("&"))
        command = app[words[0]]
        if words[1:] and words[1] in list(command):
            command = command[words[1]]
        flags = {name for argument in command.assemble_argument_collection() for name in argument.names}
        named = {word.partition("=")[0] for word in words if word.startswith("--")}
        assert named <= flags | {"--help", "--help-all", "--version"}, f"{page.name}: {line}"


@pytest.mark.skipif(importlib.util.find_spec("mkdocs") is None, reason="the extra docs is not installed")
def test_the_site_builds_strictly(tmp_path: Path) -> None:
    ran = subprocess.run(
        [sys.executable, "-m", *f"mkdocs build --strict -f docs/mkdocs.yml -d {tmp_path}/site".split()],
        cwd=ROOT,
        env={**os.environ, "NO_MKDOCS_2_WARNING": "1", "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert ran.returncode == 0, ran.stderr
    site = tmp_path / "site"
    library = (site / "reference" / "library" / "whisker_array-whisker.html").read_text(encoding="utf-8")
    assert "enhancement_factor" in library
    assert (site / "search" / "search_index.js").exists()  # search works from a folder


GLOSSARY_PAGE = (ROOT / GLOSSARY).read_text(encoding="utf-8")


def test_every_reason_is_explained_with_its_code() -> None:
    for flag in ReadingFlag:
        assert f"| {flag.text.partition(' (')[0]} | `{(flag.name or '').lower()}` |" in GLOSSARY_PAGE


def test_every_word_of_a_row_is_explained() -> None:
    words = (*Decision, *Verdict, *(set(CharacterState) - {CharacterState.READ}))
    for word in (*words, *(action.value for action in Action if action is not Action.NONE)):
        assert str(word) in GLOSSARY_PAGE


def test_the_limits_of_the_grades_are_those_of_the_program() -> None:
    for measure, limits in LIMITS.items():
        (line,) = [line for line in GLOSSARY_PAGE.splitlines() if line.startswith(f"| {measure} ")]
        assert [float(cell) for cell in line.split("|")[3:-1]] == list(limits)


IMPORT_PAGE = Path(__file__).parents[2] / "docs" / "pages" / "how-to" / "import.md"
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
    blocks = dict(re.findall(r"^```(\w*)\n(.*?)^```", IMPORT_PAGE.read_text(encoding="utf-8"), re.M | re.S))
    monkeypatch.chdir(tmp_path)
    Path("traces.toml").write_text(blocks["toml"], encoding="utf-8")
    run(MAKE)
    write_traces("simulated.h5", "traces.csv")
    capsys.readouterr()
    run(blocks[""])
    printed = capsys.readouterr().out
    assert blocks["text"] in printed
    assert "S9    accept" in printed
