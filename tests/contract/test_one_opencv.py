"""The extra `vision` brings a second OpenCV into the folder of the first: one that works remains."""

from __future__ import annotations

import ast
import contextlib
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from tests.contract.front_doors import environment, run_process
from tests.contract.test_packaging import PACKAGES, ROOT, missing

OURS, BROUGHT = "opencv-contrib-python-headless", "opencv-python-headless"
TRIED = """
import sys
sys.path[1:] += sys.argv[1:3]
import numpy as np
from glyphs.opencv import cv2
assert cv2.__file__.startswith(sys.prefix), cv2.__file__
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


def pip(python: Path, *arguments: str) -> None:
    command = (sys.executable, "-m", "pip", "--python", str(python), *arguments)
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        missing(f"pip cannot {arguments[0]} here: {done.stderr[-300:]}")


def tried(python: Path) -> subprocess.CompletedProcess[str]:
    """Use all that the program uses, with what it imports before OpenCV from this environment, and nothing else."""
    beside = python.parents[1] / "beside"
    beside.mkdir(exist_ok=True)
    for name in ("numpy", "numpy.libs", "lazy_loader"):
        with contextlib.suppress(FileExistsError):
            (beside / name).symlink_to(Path(np.__file__).parents[1] / name)
    command = [python, "-I", "-c", TRIED, str(ROOT), str(beside), *sorted(set(names_used()))]
    return subprocess.run(command, capture_output=True, text=True)


def test_one_opencv_remains_and_its_loss_is_explained(tmp_path: Path) -> None:
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", tmp_path], check=True)
    python = tmp_path / "bin" / "python"
    for package in (OURS, BROUGHT):
        pip(python, "install", "--quiet", "--no-deps", package)
    works = tried(python)
    assert works.returncode == 0, works.stderr
    pip(python, "uninstall", "--quiet", "--yes", BROUGHT)
    # the folder of the other package is left without its functions
    broken = tried(python)
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
