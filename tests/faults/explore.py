"""Makes every call that changes a file fail, tear or be the last one, once each, and looks at what is left.

    python -m tests.faults.explore                        every call of every subject, in every way; some minutes
    python -m tests.faults.explore evidence jobs -v       these subjects, and each fault as it is found
    python -m tests.faults.explore --sample 0.1           about a tenth of it
    python -m tests.faults.explore jobs=0.5 tokens        half of the faults of jobs, all of tokens

A subject works in a process of its own, forked from this one, in which shim.c is loaded before everything else. Losses
of power are made up from the calls of a run without faults (power_loss.py), after each call of it.
"""

from __future__ import annotations

import argparse
import contextlib
import ctypes
import gc
import json
import logging
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from tests.faults.power_loss import CHOICES, Call, Disk, acknowledged, digest_of, lay_out, read_calls

MODES = {"error": 1, "no space once": 2, "no space": 3, "killed": 4, "torn": 5}
PATIENCE_S = 60
LOADED = "TACTILE_MARKS_FAULTS"
SHIM = Path(__file__).with_name("shim.c")


@dataclass
class Tally:
    """What was tried of a subject, and what was found wrong."""

    calls: int = 0
    tried: Counter[str] = field(default_factory=Counter)
    found: list[str] = field(default_factory=list)


class Shim:
    """The library that is loaded already."""

    def __init__(self) -> None:
        self._c = ctypes.CDLL(os.environ[LOADED])
        self._c.faults_failed.restype = ctypes.c_char_p
        self._c.faults_arm.argtypes = [ctypes.c_char_p, ctypes.c_char_p, ctypes.c_long, ctypes.c_int]
        self._c.faults_disarm.restype = ctypes.c_long

    def arm(self, root: Path, log: Path, at: int, mode: int) -> None:
        self._c.faults_arm(str(root).encode(), str(log).encode(), at, mode)

    def disarm(self) -> tuple[int, str]:
        """Calls counted, and the one that was made to fail."""
        return self._c.faults_disarm(), self._c.faults_failed().decode()

    def say(self, word: str) -> None:
        self._c.faults_ack(word.encode())


def forked(work: Callable[[], object]) -> tuple[str, str]:
    """(how it ended, what it returned or raised) of a function, called in a process of its own."""
    read, write = os.pipe()
    pid = os.fork()
    if pid == 0:
        os.close(read)
        signal.alarm(PATIENCE_S)
        try:
            told = "ok", str(work())
        except AssertionError as error:
            told = "wrong", f"{error} {traceback.format_exc()}"
        except BaseException as error:
            told = "raised", f"{type(error).__name__}: {error} {traceback.format_exc()}"
        os.write(write, json.dumps(told).encode()[-60_000:])
        os._exit(0)
    os.close(write)
    with os.fdopen(read, "rb") as pipe:
        data = pipe.read()
    _, status = os.waitpid(pid, 0)
    if not data:
        return "killed", f"signal {os.WTERMSIG(status)}" if os.WIFSIGNALED(status) else "exit"
    ended, text = json.loads(data)
    return ended, text


class Explorer:
    """Tries faults on one subject."""

    def __init__(self, name: str, folder: Path, shim: Shim, *, say: Callable[[str], None]) -> None:
        from tests.faults.subjects import SUBJECTS

        self.name, self._subject, self._shim, self._say = name, SUBJECTS[name], shim, say
        self._template, self._at, self._log = folder / "template", folder / "at", folder / "calls"
        self.tally = Tally()

    def explore(self, sample: float, rng: np.random.Generator) -> Tally:
        """Try a share of the faults."""
        self._template.mkdir(parents=True)
        self._subject.prepare(self._template)
        self._warm_up()
        self._set_out()
        disk = Disk(self._at)
        ended, text = self._work(0, 0)
        assert ended == "ok", text
        self.tally.calls = int(text.split()[0])
        calls = read_calls(self._log)
        self._judge("without a fault", acknowledged(calls), power=False)
        self._lose_power(disk, calls, sample, rng)
        for mode, number in MODES.items():
            for at in range(1, self.tally.calls + 1):
                if rng.random() < sample:
                    self._disturb(mode, number, at)
        return self.tally

    def _warm_up(self) -> None:
        """Once in this process, so that those forked from it find everything imported."""
        self._set_out()
        words: list[str] = []
        with contextlib.chdir(self._at):
            self._subject.work(self._at, words.append)
            self._subject.check(self._at, words, False)
        gc.freeze()

    def _set_out(self) -> None:
        shutil.rmtree(self._at, ignore_errors=True)
        shutil.copytree(self._template, self._at)
        self._log.unlink(missing_ok=True)

    def _work(self, at: int, mode: int) -> tuple[str, str]:
        def work() -> str:
            self._shim.arm(self._at, self._log, at, mode)
            try:
                self._subject.work(self._at, self._shim.say)
            finally:
                count, failed = self._shim.disarm()
            return f"{count} {failed}"

        return forked(work)

    def _disturb(self, mode: str, number: int, at: int) -> None:
        self._set_out()
        disk = Disk(self._at)
        ended, text = self._work(at, number)
        failed = text.partition(" ")[2]
        if ended == "ok" and not failed:
            return  # a call that cannot go wrong in this way
        self.tally.tried[mode] += 1
        what = f"{mode} at call {at}"
        if ended not in ("ok", "killed") or (ended == "killed" and number < MODES["killed"]):
            self._wrong(f"{what}: the work ended with what nobody tells: {text}")
        if ended == "ok":
            what += f" ({failed})"
        calls = read_calls(self._log)
        self._judge(what, acknowledged(calls), power=False)
        if mode == "error" and any(call.op == "L" for call in calls):
            # what an fsync could not write is lost for good, and the next fsync does not say so
            for call in calls:
                disk.take(call)
            self._judge_loss(disk, "strict", calls, f"{what}, then the power", np.random.default_rng(0))

    def _lose_power(self, disk: Disk, calls: list[Call], sample: float, rng: np.random.Generator) -> None:
        seen: set[str] = set()
        for n, call in enumerate([None, *calls]):
            if call is not None:
                disk.take(call)
            for choice in (*CHOICES, "chance", "chance"):
                if rng.random() >= sample:
                    continue
                told = (
                    f"the power lost ({choice}) after call {n} ({call and (call.op, Path(call.path).name)})"
                )
                self._judge_loss(disk, choice, calls[:n], told, rng, seen)

    def _judge_loss(
        self,
        disk: Disk,
        choice: str,
        calls: list[Call],
        what: str,
        rng: np.random.Generator,
        seen: set[str] | None = None,
    ) -> None:
        left, words = disk.after_loss(choice, rng), acknowledged(calls)
        digest = digest_of(left, words)
        if seen is not None and digest in seen:
            return
        if seen is not None:
            seen.add(digest)
        shutil.rmtree(self._at, ignore_errors=True)
        lay_out(left, self._at)
        self.tally.tried[f"power lost: {choice}"] += 1
        self._judge(what, words, power=True)

    def _judge(self, what: str, words: list[str], *, power: bool) -> None:
        ended, text = forked(lambda: self._subject.check(self._at, words, power))
        if ended != "ok":
            self._wrong(f"{what}: {text}")

    def _wrong(self, what: str) -> None:
        self.tally.found.append(what)
        self._say(f"{self.name}: {what}")


def preloaded(arguments: list[str], **options: object) -> subprocess.CompletedProcess[str]:
    """This program in a process that has the shim, compiled for it."""
    with tempfile.TemporaryDirectory(prefix="tactile-marks-shim-") as folder:
        library = Path(folder) / "shim.so"
        subprocess.run(
            ["gcc", "-O1", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC", "-o", library, SHIM, "-ldl"],
            check=True,
        )
        environment = {**os.environ, LOADED: str(library), "LD_PRELOAD": str(library)}
        return subprocess.run(
            [sys.executable, "-m", "tests.faults.explore", *arguments],
            env=environment,
            text=True,
            cwd=SHIM.parents[2],
            **options,  # type: ignore[call-overload]
        )


def main(arguments: list[str] | None = None) -> int:
    """Print what was tried; 1 where something is wrong."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("subjects", nargs="*", help="subjects, or subject=share; all of them unless given")
    parser.add_argument("--sample", type=float, default=1.0, help="share of the faults that are tried")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", type=Path, help="file for the figures")
    parser.add_argument("-v", action="store_true", help="print each fault as it is found, with where it was")
    given = parser.parse_args(arguments)
    if LOADED not in os.environ:
        return preloaded(sys.argv[1:] if arguments is None else arguments).returncode
    import structlog

    from tests.faults.subjects import SUBJECTS

    structlog.configure(wrapper_class=structlog.make_filtering_bound_logger(logging.CRITICAL))
    shim, rng = Shim(), np.random.default_rng(given.seed)
    found: dict[str, Tally] = {}
    shares = {name: share for name, _, share in (one.partition("=") for one in given.subjects or SUBJECTS)}
    with tempfile.TemporaryDirectory(prefix="tactile-marks-faults-") as folder:
        for name, share in shares.items():
            began = time.monotonic()
            at = Path(folder) / name.replace(" ", "-")
            explorer = Explorer(
                name, at, shim, say=lambda text: print(text if given.v else text[:300], flush=True)
            )
            tally = found[name] = explorer.explore(float(share or given.sample), rng)
            print(
                f"{name}: {tally.calls} calls, {sum(tally.tried.values())} faults, {len(tally.found)} wrong,"
                f" {time.monotonic() - began:.1f} s; {dict(tally.tried)}",
                flush=True,
            )
    if given.json is not None:
        figures = {name: {"calls": t.calls, "tried": t.tried, "found": t.found} for name, t in found.items()}
        given.json.write_text(json.dumps(figures, indent=1))
    return int(any(tally.found for tally in found.values()))


if __name__ == "__main__":
    sys.exit(main())
