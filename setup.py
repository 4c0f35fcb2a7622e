"""The date and commit of a clone become part of the version that is built from it: 0.1.0+20261129.g9f04df81.

Without git, or from an unpacked archive of the sources, the version is the plain one; an sdist keeps that of its clone.
"""

import subprocess
from pathlib import Path

from setuptools import setup

HERE = Path(__file__).resolve().parent
COMMIT = ("git", "log", "-1", "--format=+%cd.g%h", "--date=format:%Y%m%d")

try:
    cloned = (HERE / ".git").exists()
    done = subprocess.run(COMMIT, cwd=HERE, capture_output=True, text=True, check=True) if cloned else None
except (OSError, subprocess.CalledProcessError):
    done = None

setup(options={"egg_info": {"tag_build": done.stdout.strip()}} if done is not None else {})
