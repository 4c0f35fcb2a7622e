"""Build with setuptools; the date and commit of a clone become part of the version, 0.1.0+20261129.g9f04df81. Without
git the version is the plain one; an sdist keeps that of its clone."""

import atexit
import os
import shutil
import subprocess
import tempfile
from pathlib import Path

from setuptools.build_meta import *  # noqa: F403

HERE = Path(__file__).resolve().parents[2]
COMMIT = ("git", "log", "-1", "--format=+%cd.g%h", "--date=format:%Y%m%d")

if (HERE / ".git").exists():
    try:
        tag = subprocess.run(COMMIT, cwd=HERE, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        tag = ""
    # setuptools reads this file beside pyproject.toml
    folder = tempfile.mkdtemp()
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    settings = Path(folder, "tag.cfg")
    settings.write_text(f"[egg_info]\ntag_build = {tag}\n", encoding="ascii")
    os.environ["DIST_EXTRA_CONFIG"] = str(settings)
