"""The first hour: every block of the tutorials, README and the page on deploying is run, from an empty folder.

A page is one script of bash, made of its blocks in order, word by word:

block without a language, sh                       its lines
any other, after a line that names a `FILE.ext`    is pasted at the end of that file
text, python (test_site runs it), json             left out: output, and scripts of their own

What a line may do to the machine is done to a folder of the test: programs that install or start other programs
(`INSTALLERS`) succeed without doing anything, `sudo` runs its command, and /etc, /opt, /var and /backups lie in that
folder. Of an exam one part is read in place of two. A service gets free ports and ends when the next one starts; an
answer of it that is an error ends the script. A `demo`, which needs no files, is run by the first page that names it;
the service's has a clean and a filthy part in place of six.
"""

from __future__ import annotations

import os
import re
import shutil
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from pipeline.cli.demo import PLATES
from tests.support.waiting import free_port, program

ROOT = Path(__file__).parents[2]
PAGES = ("README.md", *(f"docs/pages/tutorials/{name}.md" for name in ("read-parts", "line", "judge")),
         "docs/pages/how-to/deploy.md")  # fmt: skip
INSTALLERS = ("pip", "pytest", "useradd", "systemctl", "podman", "docker", "openssl")
BLOCK = re.compile(r"(?P<before>[^\n]*)\n+^```(?P<language>\w*)\n(?P<text>.*?)^```", re.MULTILINE | re.DOTALL)
FILE = re.compile(r"`(\w[\w-]*\.\w+)`[^`]*$")
LEFT_OUT = ("text", "json")
MACHINE = re.compile(r"(?<![\w./:-])/(?=(?:etc|opt|var|backups)/)")
TWO_PARTS = re.compile(r"(benchmark (?:run|export) [^\n]*?--parts) 2\b")
"""Exams of which a page takes two parts; here one shows that the commands go together."""
DEMO = """\
import sys
from pipeline.cli import demo, main
demo.SEVERITIES = (0.0, 0.9)
sys.exit(main.main(sys.argv[1:]))
"""
MOST_S = 600.0
"""For one page, on a busy machine; alone each takes some 20 s."""
SERVED = """\
#!{python}
import contextlib, os, signal, subprocess, sys, time, urllib.request
from pathlib import Path

command = ["{command}", *sys.argv[1:]]
if sys.argv[1:2] == ["demo"]:
    try:
        Path(os.environ["DEMOS"], "-".join(sys.argv[1:])).touch(exist_ok=False)
    except FileExistsError:
        sys.exit(0)
    command[:1] = [sys.executable, "-c", {demo!r}]
if sys.argv[1:2] != ["serve"]:
    os.execv(command[0], command)
# here and not for all commands: `settings` would write it into the file, and the page sets the port there
os.environ["TACTILE_MARKS_SERVICE_PORT"] = os.environ["SERVED_PORT"]
pid = Path(os.environ["SERVICE_PID"])
if pid.exists():
    before = int(pid.read_text())
    os.kill(before, signal.SIGTERM)
    with contextlib.suppress(ProcessLookupError):
        while True:
            os.kill(before, 0)
            time.sleep(0.1)
log = pid.with_suffix(".log")
with log.open("wb") as stream:
    process = subprocess.Popen(command, stdout=stream, stderr=stream, start_new_session=True)
pid.write_text(str(process.pid))
url = f"http://127.0.0.1:{{os.environ['SERVED_PORT']}}/healthz"
while process.poll() is None:
    try:
        urllib.request.urlopen(url, timeout=2.0)
        sys.exit(0)
    except OSError:
        time.sleep(0.1)
sys.exit(log.read_text())
"""
VENV = """\
#!/bin/sh
# python3 -m venv FOLDER
mkdir -p "$3/bin" && cp "$(dirname "$0")"/* "$3/bin/" && : > "$3/bin/activate"
"""
SUDO = """\
#!/bin/sh
while [ "${1#-}" != "$1" ]; do shift 2; done
exec env "$@"
"""


def script_of(page: Path) -> str:
    """The blocks of a page as one script; each begins in the same folder."""
    lines = ["set -euo pipefail"]
    for block in BLOCK.finditer(page.read_text(encoding="utf-8")):
        named = FILE.search(block["before"])
        if block["language"] in ("", "sh"):
            lines.append(f'cd "$START"\n{block["text"]}')
        elif named is not None and block["language"] not in LEFT_OUT:
            lines.append(f"cat >> {named[1]} <<'END-OF-BLOCK'\n{block['text']}END-OF-BLOCK")
    return "\n".join(lines) + "\n"


def executable(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")
    path.chmod(path.stat().st_mode | stat.S_IXUSR)


@pytest.fixture
def programs(tmp_path: Path) -> Path:
    """A folder of programs that goes before those of the machine."""
    folder = tmp_path / "programs"
    folder.mkdir()
    for name in INSTALLERS:
        executable(folder / name, "#!/bin/sh\n")
    for name in ("python3", "python3.11"):
        executable(folder / name, VENV)
    executable(folder / "sudo", SUDO)
    executable(
        folder / "curl", f'#!/bin/sh\nexec {program("curl")} --fail-with-body --silent --show-error "$@"\n'
    )
    executable(
        folder / "tactile-marks",
        SERVED.format(python=sys.executable, command=program("tactile-marks"), demo=DEMO),
    )
    return folder


@pytest.fixture(scope="module")
def demos(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("demos")


@pytest.mark.skipif(sys.platform == "win32", reason="the pages are for a shell")
@pytest.mark.parametrize("page", PAGES)
def test_every_block_of_a_page_runs_from_an_empty_folder(
    page: str, tmp_path: Path, programs: Path, demos: Path
) -> None:
    port, tcp_port = free_port(), free_port()
    script = MACHINE.sub(f"{tmp_path}/machine/", script_of(ROOT / page))
    script = TWO_PARTS.sub(r"\1 1", script)
    script = script.replace(":8417/v1", f":{port}/v1").replace("--tcp.port 8418", f"--tcp.port {tcp_port}")
    for folder in ("etc/systemd/system", "opt", "var/lib", "backups"):
        (tmp_path / "machine" / folder).mkdir(parents=True)
    work = tmp_path / "work"
    work.mkdir()
    if page.endswith("deploy.md"):  # it begins in the sources
        shutil.copytree(ROOT / "docs" / "deploy", work / "docs" / "deploy")
    environment = {
        **{name: value for name, value in os.environ.items() if not name.startswith("TACTILE_MARKS_")},
        "PATH": f"{programs}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": str(ROOT),
        "START": str(work),
        "DEMOS": str(demos),
        "SERVICE_PID": str(tmp_path / "service"),
        "SERVED_PORT": str(port),
        # one worker wherever a page does not name a number: each loads all libraries first
        "TACTILE_MARKS_WORKERS_JOBS": "1",
    }
    try:
        done = subprocess.run(
            [program("bash"), "-x", "-c", script],
            cwd=work, env=environment, capture_output=True, text=True, timeout=MOST_S, check=False,
        )  # fmt: skip
    finally:
        if (running := tmp_path / "service").exists():
            os.kill(int(running.read_text()), 15)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    if page == "README.md":  # its demonstration has read every plate as stamped, or its status were 1
        assert all(plate["text"] in done.stdout for plate in PLATES.values())
        assert {".npz", ".h5", ".png"} <= {path.suffix for path in (work / "demo-out").iterdir()}
