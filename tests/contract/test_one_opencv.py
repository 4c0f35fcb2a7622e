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
from tests.contract.test_packaging import PACKAGES, ROOT

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
