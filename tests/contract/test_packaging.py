"""What `pip install tactile-marks` gives: a wheel built from an sdist of this tree, in an environment of its own.

packages, pyproject.toml ... --copy--> tree --> sdist --unpacked--> wheel --pip--> environment, another folder
"""

from __future__ import annotations

import ast
import contextlib
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import tomllib
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from email.parser import Parser
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from glyphs import stamp
from tests.contract.front_doors import environment, run_process
from tests.support.run_tables import csv_rows

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
PACKAGES = ("glyphs", "whisker_array", "recognition", "pipeline")
COMMITTED = "2026-11-29T12:00:00Z"
SETUPTOOLS = 77
"""The first that knows a licence by its SPDX name."""
SCRAPS = shutil.ignore_patterns("__pycache__", ".*", "*~")


@dataclass(frozen=True)
class Installed:
    """An environment with the wheel, and a folder to work in that is far from the sources; `tree` is their clone, which
    has a commit of the version's date."""

    tree: Path
    sdist: Path
    wheel: Path
    bin: Path
    work: Path

    def run(self, *command: str, status: int = 0) -> str:
        """Run a program of the environment; what it printed."""
        program = self.bin / command[0]
        keep = {
            k: v for k, v in os.environ.items() if k != "PYTHONPATH" and not k.startswith("TACTILE_MARKS_")
        }
        done = subprocess.run(
            [program, *command[1:]], cwd=self.work, env=keep, capture_output=True, text=True
        )
        assert done.returncode == status, done.stdout + done.stderr
        return done.stdout

    def python(self, program: str, *arguments: str) -> str:
        """Run a program text."""
        return self.run("python", "-c", program, *arguments)


def missing(what: str) -> None:
    """Skip the test, or fail it where everything must be tested."""
    if os.environ.get("MARKS_TEST_ALL") == "1":
        pytest.fail(f"{what}, and MARKS_TEST_ALL asks for every test")
    pytest.skip(what)


def backend(folder: Path) -> dict[str, str]:
    """Environment variables under which a setuptools that is new enough is found."""
    try:
        if int(version("setuptools").split(".")[0]) >= SETUPTOOLS:
            return dict(os.environ)
    except PackageNotFoundError:
        pass
    asked = ("--quiet", "--disable-pip-version-check", "--target", str(folder), f"setuptools>={SETUPTOOLS}")
    if subprocess.run([sys.executable, "-m", "pip", "install", *asked], capture_output=True).returncode:
        missing(f"setuptools {SETUPTOOLS} is not installed and cannot be fetched")
    return {**os.environ, "PYTHONPATH": str(folder)}


def built(kind: str, tree: Path, out: Path, environment: dict[str, str]) -> Path:
    """What a hook of the backend makes, such as an sdist or a wheel."""
    system = PROJECT["build-system"]
    program = f"import sys; sys.path[:0] = {system['backend-path']}; import {system['build-backend']} as b"
    subprocess.run(
        [sys.executable, "-c", f"{program}; b.{kind}(sys.argv[1])", str(out)],
        cwd=tree,
        env=environment,
        capture_output=True,
        check=True,
    )
    (made,) = out.iterdir()
    return made


def commit(tree: Path) -> None:
    """Make a clone of a tree, with one commit."""
    who = {f"GIT_{kind}_{what}": "x@y" for kind in ("AUTHOR", "COMMITTER") for what in ("NAME", "EMAIL")}
    when = {"GIT_AUTHOR_DATE": COMMITTED, "GIT_COMMITTER_DATE": COMMITTED}
    for command in (("init", "-q"), ("add", "pyproject.toml"), ("commit", "-q", "-m", "x")):
        subprocess.run(("git", *command), cwd=tree, env={**os.environ, **who, **when}, check=True)


def is_dated(told: str) -> bool:
    return (
        re.fullmatch(re.escape(PROJECT["project"]["version"]) + r"\+20261129\.g[0-9a-f]+", told) is not None
    )


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Installed:
    base = tmp_path_factory.mktemp("packaging")
    for name in ("tree", "sdist", "wheel", "work"):
        (base / name).mkdir()
    for name in PACKAGES:
        shutil.copytree(ROOT / name, base / "tree" / name, ignore=SCRAPS)
    for name in (
        "pyproject.toml",
        PROJECT["project"]["readme"],
        *PROJECT["project"]["license-files"],
    ):
        shutil.copy(ROOT / name, base / "tree" / name)
    commit(base / "tree")
    environment = backend(base / "backend")
    sdist = built("build_sdist", base / "tree", base / "sdist", environment)
    safely = {"filter": "data"} if hasattr(tarfile, "data_filter") else {}  # from Python 3.11.4 on
    with tarfile.open(sdist) as archive:
        archive.extractall(base, **safely)
    wheel = built("build_wheel", base / sdist.name.removesuffix(".tar.gz"), base / "wheel", environment)

    subprocess.run([sys.executable, "-m", "venv", "--without-pip", base / "env"], check=True)
    python = base / "env" / "bin" / "python"
    # of its modules a third is ever imported; those are compiled then
    asked = (
        "install",
        "--quiet",
        "--disable-pip-version-check",
        "--no-compile",
        "--no-deps",
        "--no-index",
        str(wheel),
    )
    subprocess.run([sys.executable, "-m", "pip", "--python", python, *asked], capture_output=True, check=True)
    # the libraries of this environment, after the wheel; its .pth files, which may name the sources, do not count
    found = subprocess.run(
        [python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"],
        capture_output=True,
        check=True,
    )
    own, libraries = Path(found.stdout.decode().strip()), sysconfig.get_path("purelib")
    (own / "libraries.pth").write_text(f"{libraries}\n", encoding="utf-8")
    return Installed(base / "tree", sdist, wheel, python.parent, base / "work")


def test_the_wheel_holds_every_file_of_the_packages_and_nothing_else(installed: Installed) -> None:
    sources = {
        path.relative_to(installed.tree).as_posix()
        for name in PACKAGES
        for path in (installed.tree / name).rglob("*")
        if path.is_file() and path.suffix != ".pyc"  # building compiles the backend
    }
    with zipfile.ZipFile(installed.wheel) as archive:
        held = {name for name in archive.namelist() if ".dist-info/" not in name}
        info = {n.partition(".dist-info/")[2]: n for n in archive.namelist() if ".dist-info/" in n}
        assert sorted(held ^ sources) == []
        assert {f"{name}/py.typed" for name in PACKAGES} < held
        assert archive.read(info["licenses/LICENSE"]) == (ROOT / "LICENSE").read_bytes()
        assert "tactile-marks = pipeline.cli.main:main" in archive.read(info["entry_points.txt"]).decode()
        told = Parser().parsestr(archive.read(info["METADATA"]).decode())
    assert (told["Name"], is_dated(told["Version"])) == ("tactile-marks", True)
    assert told["License-Expression"] == "Apache-2.0"
    extras = set(PROJECT["project"]["optional-dependencies"])
    assert set(told.get_all("Provides-Extra")) == extras
    with tarfile.open(installed.sdist) as archive:
        inner = {name.partition("/")[2] for name in archive.getnames()}
    assert {*sources, "pyproject.toml", "README.md", "LICENSE"} <= inner


def test_the_command_comes_from_the_wheel_and_answers(installed: Installed) -> None:
    where = installed.python("import glyphs, whisker_array, recognition, pipeline as p; print(glyphs, whisker_array, "
                             "recognition, p)")  # fmt: skip
    assert where.count(str(installed.bin.parent)) == len(PACKAGES)
    assert str(ROOT) not in where.replace(str(installed.bin.parent), "")
    assert "Usage: tactile-marks" in installed.run("tactile-marks", "--help")
    assert is_dated(installed.run("tactile-marks", "--version").strip())


def test_without_git_the_version_is_the_plain_one(tmp_path: Path) -> None:
    tree, out = tmp_path / "tree", tmp_path / "out"
    shutil.copytree(ROOT / "pipeline" / "building", tree / "pipeline" / "building", ignore=SCRAPS)
    out.mkdir()
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, tree / name)
    wheel = built("build_wheel", tree, out, backend(tmp_path / "b"))
    assert wheel.name.split("-")[1] == PROJECT["project"]["version"]


def test_a_part_is_read(installed: Installed) -> None:
    """By camera and network: touch and templates would compile their kernels anew, which takes most of a minute."""
    photo = stamp("74", fonts="gothic", height_mm=5.0, seed=1).photograph()
    Image.fromarray(photo.pixels).save(installed.work / "part.png")
    given = ("--font", "gothic", "--format", "99", "--height-mm", "5", "--jobs", "1", "--experts", "network")
    installed.run("tactile-marks", "read", "part.png", *given, "--out", "rows.csv")
    (row,) = csv_rows(installed.work / "rows.csv")
    assert (row["part"], row["text"]) == ("part", "74")


OURS = "opencv-contrib-python-headless"
LIBRARIES = Path(np.__file__).parents[1]
TRIED = """
import sys
sys.path[1:] += sys.argv[1:3]
import numpy as np
from glyphs.opencv import cv2
assert cv2.__file__.startswith(sys.argv[2]), cv2.__file__
for name in sys.argv[3:]:
    value = cv2
    for part in name.split("."):
        value = getattr(value, part)
image = np.random.default_rng(0).integers(0, 255, (64, 64)).astype(np.uint8)
written = cv2.imencode(".png", image)[1]
assert (cv2.imdecode(written, cv2.IMREAD_GRAYSCALE) == image).all()
ends = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 5, 1e-3)
smooth = cv2.GaussianBlur(image, (9, 9), 3.0)
cv2.findTransformECC(smooth, smooth, np.eye(3, dtype=np.float32), cv2.MOTION_HOMOGRAPHY, ends)
cv2.createCLAHE(2.0, (4, 4)).apply(image)
"""


def modules() -> Iterator[tuple[str, str]]:
    """Name and text of every module that knows of cv2."""
    for package in PACKAGES:
        for path in (ROOT / package).rglob("*.py"):
            if "cv2" in (text := path.read_text(encoding="utf-8")):
                yield path.relative_to(ROOT).as_posix(), text


def names_used() -> Iterator[str]:
    """Everything of cv2 that the program uses, `utils.logging.setLogLevel` for one."""
    for _, text in modules():
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.Attribute) and re.fullmatch(r"cv2(\.\w+)+", name := ast.unparse(node)):
                yield name.removeprefix("cv2.")


def tried(libraries: Path) -> subprocess.CompletedProcess[str]:
    """Use all that the program uses, with the libraries of one folder alone."""
    command = [sys.executable, "-I", "-S", "-c", TRIED, str(ROOT), str(libraries), *sorted(set(names_used()))]
    return subprocess.run(command, capture_output=True, text=True)


def test_all_that_is_used_of_opencv_is_installed() -> None:
    """With both packages of it, as the extra `vision` has them."""
    works = tried(LIBRARIES)
    assert works.returncode == 0, works.stderr


def test_what_the_removal_of_one_opencv_leaves_of_the_other_is_explained(tmp_path: Path) -> None:
    """A folder without modules: pip has taken the files of both."""
    for name in ("numpy", "numpy.libs", "lazy_loader"):
        with contextlib.suppress(FileExistsError):
            (tmp_path / name).symlink_to(LIBRARIES / name)
    (tmp_path / "cv2" / "data").mkdir(parents=True)
    broken = tried(tmp_path)
    assert broken.returncode == 1
    assert "OpenCV is damaged (its functions are missing)" in broken.stderr
    assert f"pip install --force-reinstall --no-deps {OURS}" in broken.stderr


def test_too_little_memory_is_not_taken_for_a_damaged_opencv(tmp_path: Path, height_map: Path) -> None:
    words = "cv2.abi3.so: failed to map segment from shared object"
    (tmp_path / "cv2.py").write_text(f"raise ImportError({words!r})\n", encoding="utf-8")
    env = environment(PYTHONPATH=f"{tmp_path}{os.pathsep}{ROOT}")
    done = run_process("read", height_map, "--format", "A9", "--jobs", "1", env=env)
    assert done.status == 1
    assert "too little memory to load OpenCV; let the program use more memory" in done.out
    assert "damaged" not in done.out


def test_opencv_is_imported_in_one_place() -> None:
    importing = [
        name
        for name, text in modules()
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Import) and any(alias.name == "cv2" for alias in node.names)
    ]
    assert importing == ["glyphs/opencv.py"]
