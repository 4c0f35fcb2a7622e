"""The documentation: every script in it runs, every command in it exists, and the site builds without a warning."""

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

import pytest

from pipeline.cli.main import app

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
