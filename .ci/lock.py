"""Makes docs/deploy/requirements.lock anew: brings CI's environment up to the newest there is, and writes down what of
it a service takes, by version and hash. What is locked is then tested by `.ci/run`, which installs it.

    .ci/venv/bin/python .ci/lock.py && .ci/run
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TESTED = "test,proof,lint,docs"
"""As in `.ci/run`."""
DEPLOYED = "formats,checkdigits,service,postgres,mqtt,opcua"
HEAD = f"""\
# What a service takes, as it was tested: tactile-marks[{DEPLOYED}]
# for Linux on x86-64 with Python 3.11. Made by .ci/lock.py; install with: pip install --no-deps --require-hashes -r
"""


def pip(*arguments: str) -> str:
    """What pip says."""
    command = (sys.executable, "-m", "pip", "--disable-pip-version-check", *arguments)
    return subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout


def main() -> None:
    """Write the file."""
    pip("install", "--quiet", "--upgrade", "--upgrade-strategy", "eager", "-e", f".[{TESTED}]")
    with tempfile.TemporaryDirectory() as name:
        tested, report = Path(name, "tested.txt"), Path(name, "report.json")
        tested.write_text(pip("freeze", "--exclude-editable"), encoding="utf-8")
        told = ("--report", str(report), "--constraint", str(tested), f".[{DEPLOYED}]")
        pip("install", "--quiet", "--dry-run", "--ignore-installed", *told)
        found = json.loads(report.read_text(encoding="utf-8"))["install"]
    lines = [
        f"{one['metadata']['name']}=={one['metadata']['version']} "
        f"--hash=sha256:{one['download_info']['archive_info']['hashes']['sha256']}\n"
        for one in found
        if one["metadata"]["name"] != "tactile-marks"
    ]
    text = HEAD + "".join(sorted(lines, key=str.lower))
    Path(ROOT, "docs", "deploy", "requirements.lock").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
