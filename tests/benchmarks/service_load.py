"""Latency and correctness of the service's answers when parts arrive at a fixed rate.

    python tests/benchmarks/service_load.py --kinds photo --rates 0.5 1 2 --seconds 60
    python tests/benchmarks/service_load.py --kinds part --rates 0.5 --seconds 600 --sample 60      # soak

photo   POST /v1/parts with a photograph
scan    POST /v1/parts with a recorded scan
part    POST /v1/parts with a photograph, and where touch is needed POST /v1/parts/{id}/scan

The loop is open: a part comes when its time has come, whether those before it are answered or not, as parts do on a
line. An answer's time counts from when the part was to be sent, so that a service that stalls cannot hide the parts
which it kept from being sent. Every tenth part is sent twice at once with one Idempotency-Key.

Loads only a service of its own, on 127.0.0.1. Of the answers: accepted with the right text, accepted with a wrong one,
503 (retry later), failed; seconds of those that were read; memory of the service and of its workers together,
open files of the service, processor time of both a part. Ends with status 1 where a text was accepted that is wrong, an
answer failed, or the store does not hold exactly the parts that were answered.
"""

from __future__ import annotations

import argparse
import asyncio
import itertools
import os
import sqlite3
import sys
import tempfile
from collections import Counter
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import httpx
import numpy as np

from glyphs.soiling.soiled import Soiling
from pipeline.formats.synth import SynthSpec, make_part, write_part
from pipeline.service.process import ServiceProcess, service_process
from pipeline.service.settings import STORE_FILE
from recognition.see.virtual_array import VirtualArray
from recognition.see.virtual_bench import VirtualBench
from whisker_array.scan.recording import save_scan

HEIGHT_MM = 5.0
FORMAT = "AA999999"
REQUEST_TIMEOUT_S = 300.0
MOST_REQUESTS = 100_000
CONNECTIONS = 190
"""Below what the service lets one address have; parts beyond wait here, and their time runs."""
TWICE_EVERY = 10
READ = ("right", "open", "wrong")
COLUMNS = ("kind", "rate/s", "sent", "read/s", "right", "wrong", "503", "failed", "p50", "p90", "p99", "max", "MB",
           "workers", "files")  # fmt: skip


@dataclass(frozen=True)
class Sample:
    """One part: what is sent, and what it bears."""

    text: str
    photo: bytes
    scan: bytes


@dataclass
class Tally:
    """What came back: seconds of the parts that were read, and how many ended how."""

    seconds: list[float] = field(default_factory=list)
    ends: Counter[str] = field(default_factory=Counter)
    ids: set[str] = field(default_factory=set)


def arrivals(rate: float, seconds: float, *, poisson: bool, rng: np.random.Generator) -> np.ndarray:
    """When parts come, in seconds from the start: at even distances, or as they like (Poisson)."""
    count = min(MOST_REQUESTS, round(rate * seconds))
    if not poisson:
        return np.arange(count) / rate
    return np.sort(
        rng.uniform(0.0, seconds, count)
    )  # of a Poisson process with so many, that is where they lie


async def offer(times: Sequence[float], send: Callable[[int], Awaitable[str]], tally: Tally) -> None:
    """Send every part at its time.

    Args:
        times: in seconds from now.
        send: sends the part of a number and tells how it ended.
        tally: gets the ends, and the seconds of parts that were read.
    """
    clock = asyncio.get_running_loop().time
    start = clock()

    async def one(number: int, due: float) -> None:
        end = await send(number)
        tally.ends[end] += 1
        if end in READ:
            tally.seconds.append(clock() - due)

    async with asyncio.TaskGroup() as sent:
        for number, time in enumerate(times):
            await asyncio.sleep(start + time - clock())
            sent.create_task(one(number, start + time))


class Sender:
    """Sends parts of one kind, and looks at the answers."""

    def __init__(self, http: httpx.AsyncClient, kind: str, samples: Sequence[Sample], tally: Tally) -> None:
        self._http, self._kind, self._samples, self._tally = http, kind, samples, tally
        self._run = os.urandom(6).hex()

    async def __call__(self, number: int) -> str:
        """How a part ended: right, open (for a person, or unreadable), wrong, 503, or what failed."""
        sample = self._samples[number % len(self._samples)]
        key = f"{self._run}-{number}"
        times = 2 if number % TWICE_EVERY == 0 else 1
        try:
            ends = await asyncio.gather(*(self._read(sample, key) for _ in range(times)))
        except httpx.HTTPError as error:
            return type(error).__name__
        if len({part for part, _ in ends if part}) > 1:
            return "doubled"
        return min((end for _, end in ends), key=lambda end: end == "503")

    async def _read(self, sample: Sample, key: str) -> tuple[str, str]:
        scanned = self._kind == "scan"
        files = {"scan": ("part.h5", sample.scan)} if scanned else {"photo": ("part.png", sample.photo)}
        touch = {"touch": "plan"} if self._kind == "part" else {}
        answer = await self._http.post("/v1/parts", files=files, data=touch, headers={"Idempotency-Key": key})
        if answer.is_success:
            self._tally.ids.add(answer.json()["id"])
            if answer.json()["state"] == "touch_needed" and self._kind == "part":
                answer = await self._http.post(
                    f"/v1/parts/{answer.json()['id']}/scan",
                    files={"scan": ("part.h5", sample.scan)},
                    headers={"Idempotency-Key": f"{key}-scan"},
                )
        if not answer.is_success:
            return "", str(answer.status_code)
        part = answer.json()
        if part["state"] != "accepted":
            return part["id"], "open"
        return part["id"], "right" if part["text"] == sample.text else "wrong"


def make_samples(folder: Path, *, parts: int, dirt: float, seed: int = 5) -> tuple[Sample, ...]:
    """Photographs and recorded scans of as many synthetic parts."""
    spec = SynthSpec(format=FORMAT, seed=seed, height_mm=HEIGHT_MM, soiling=Soiling(severity=dirt))
    samples = []
    for number in range(parts):
        stem = folder / f"part-{number}"
        write_part(spec, stem, number, photos=True)
        soiled = make_part(spec, number)
        scan = VirtualBench(soiled.height_map, HEIGHT_MM, VirtualArray(seed=number), soiled.soil).scan()
        save_scan(scan, stem.with_suffix(".h5"))
        samples.append(
            Sample(soiled.text, stem.with_suffix(".png").read_bytes(), stem.with_suffix(".h5").read_bytes())
        )
    return tuple(samples)


def footprint(pid: int) -> tuple[float, float, int]:
    """Memory of a service in MB, that of its workers together, and its open files."""
    workers = sum(_resident_mb(child) for child in _children(pid))
    return _resident_mb(pid), workers, len(os.listdir(f"/proc/{pid}/fd"))


def processor_s(pid: int) -> tuple[float, float]:
    """Processor time of a service, and of its workers together."""
    return _processor_s(pid), sum(_processor_s(child) for child in _children(pid))


def _children(pid: int) -> list[int]:
    # workers are started by a thread
    lists = Path(f"/proc/{pid}/task").glob("*/children")
    return [int(child) for path in lists for child in path.read_text(encoding="ascii").split()]


def _processor_s(pid: int) -> float:
    user, system = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()[11:13]
    return (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")


def _resident_mb(pid: int) -> float:
    pages = int(Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def row(kind: str, rate: float, seconds: float, tally: Tally, pid: int) -> str:
    """One line of the table."""
    read = sum(tally.ends[end] for end in READ)
    sent = tally.ends.total()
    failed = sent - read - tally.ends["503"]
    times = np.percentile(tally.seconds, (50, 90, 99, 100)) if tally.seconds else [np.nan] * 4
    own, workers, files = footprint(pid)
    counts = (
        sent,
        f"{read / seconds:.2f}",
        tally.ends["right"],
        tally.ends["wrong"],
        tally.ends["503"],
        failed,
    )
    held = (f"{own:.0f}", f"{workers:.0f}", files)
    cells = (kind, f"{rate:g}", *counts, *(f"{time:.2f}" for time in times), *held)
    return " ".join(f"{cell!s:>7}" for cell in cells)


async def load(
    service: ServiceProcess,
    kind: str,
    samples: Sequence[Sample],
    *,
    times: Sequence[float],
    rate: float,
    sample_s: float,
) -> tuple[Tally, float]:
    """Load the service; what came back, and the seconds to the last answer. Prints a row every `sample_s`."""
    tally, clock = Tally(), asyncio.get_running_loop().time
    start = clock()

    async def watch() -> None:
        for n in itertools.count(1):
            await asyncio.sleep(start + n * sample_s - clock())
            print(
                row(kind, rate, clock() - start, tally, service.process.pid), f" after {n * sample_s:.0f} s"
            )

    limits = httpx.Limits(max_connections=CONNECTIONS, max_keepalive_connections=CONNECTIONS)
    timeout = httpx.Timeout(REQUEST_TIMEOUT_S)
    async with httpx.AsyncClient(base_url=service.url, timeout=timeout, limits=limits) as http:
        watching = asyncio.create_task(watch()) if sample_s else None
        await offer(times, Sender(http, kind, samples, tally), tally)
        if watching is not None:
            watching.cancel()
    return tally, clock() - start


def main() -> int:
    """Run every kind of part at every rate."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    kinds = ("photo", "scan", "part")
    parser.add_argument("--kinds", nargs="+", default=kinds, choices=kinds)
    parser.add_argument("--rates", nargs="+", type=float, default=[0.5, 1.0, 2.0], help="parts a second")
    parser.add_argument(
        "--even", action="store_true", help="parts at even distances; else at random (Poisson)"
    )
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--sample", type=float, default=0.0, help="seconds between rows while a load runs")
    parser.add_argument("--parts", type=int, default=20, help="different ones")
    parser.add_argument("--dirt", type=float, default=0.3)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    chosen = parser.parse_args()
    sys.stdout.reconfigure(line_buffering=True)  # type: ignore[union-attr]
    total = Tally()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        samples = make_samples(folder, parts=chosen.parts, dirt=chosen.dirt)
        options = ("--jobs", str(chosen.jobs), "--format", FORMAT, "--font", "gothic", "--height-mm", "5")
        print(
            f"{chosen.parts} parts, dirt {chosen.dirt}, {chosen.jobs} processes, {chosen.seconds:.0f} s each"
        )
        print(" ".join(f"{column:>7}" for column in COLUMNS))
        rng = np.random.default_rng(1)
        with service_process(folder / "service", *options) as service:
            for kind in chosen.kinds:
                warming = np.arange(4.0)  # templates, once
                tally, _ = asyncio.run(load(service, kind, samples, times=warming, rate=1.0, sample_s=0.0))
                total.ids |= tally.ids
                for rate in chosen.rates:
                    times = arrivals(rate, chosen.seconds, poisson=not chosen.even, rng=rng)
                    before = processor_s(service.process.pid)
                    tally, took = asyncio.run(
                        load(service, kind, samples, times=times, rate=rate, sample_s=chosen.sample)
                    )
                    print(row(kind, rate, took, tally, service.process.pid), f" {dict(tally.ends)}")
                    spent = np.subtract(processor_s(service.process.pid), before) / max(len(times), 1)
                    print(
                        f"processor time a part: service {1e3 * spent[0]:.1f} ms, workers {1e3 * spent[1]:.1f} ms"
                    )
                    total.ends += tally.ends
                    total.ids |= tally.ids
        with sqlite3.connect(folder / "service" / STORE_FILE) as store:
            (kept,) = store.execute("select count(*) from parts").fetchone()
    sound = set(total.ends) <= {"right", "open", "503"} and kept == len(total.ids)
    print(f"parts answered {len(total.ids)}, in the store {kept}: {'sound' if sound else 'NOT SOUND'}")
    return 0 if sound else 1


if __name__ == "__main__":
    sys.exit(main())
