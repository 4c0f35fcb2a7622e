"""How fast the service answers under load, and whether it errs. Talks to a service of its own on this machine.

    python tests/benchmarks/service_load.py --clients 1 8 32 --seconds 60

photo   POST /v1/parts with a photograph
scan    POST /v1/parts with a recorded scan
fused   POST /v1/parts/{id}/scan for parts that the camera was unsure of

Each client sends its next request when it has its answer. Printed: requests, errors, answers a second, p50 and p99.
"""

from __future__ import annotations

import argparse
import asyncio
import itertools
import os
import tempfile
import time
from collections import Counter
from collections.abc import Awaitable, Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import httpx
import numpy as np

from glyphs.soiling.soiled import Soiling
from pipeline.files.synth import SynthSpec, make_part, write_part
from pipeline.reading.simulated_scan import feel
from pipeline.service.process import service_process
from whisker_array.scan.recording import save_scan
from whisker_array.whisker.array import default_plan

HEIGHT_MM = 5.0
FORMAT = "AA999999"
REQUEST_TIMEOUT_S = 120.0


@dataclass
class Tally:
    """What came back."""

    seconds: list[float] = field(default_factory=list)
    statuses: Counter[str] = field(default_factory=Counter)


@dataclass(frozen=True)
class Supplies:
    """Files to send."""

    photos: tuple[bytes, ...]
    scans: tuple[bytes, ...]


def make_supplies(folder: Path, *, parts: int, dirt: float, seed: int = 5) -> Supplies:
    """Photographs and recorded scans of as many synthetic parts."""
    spec = SynthSpec(format=FORMAT, seed=seed, height_mm=HEIGHT_MM, soiling=Soiling(severity=dirt))
    photos, scans = [], []
    for number in range(parts):
        stem = folder / f"part-{number}"
        write_part(spec, stem, number, photos=True)
        photos.append(stem.with_suffix(".png").read_bytes())
        soiled = make_part(spec, number)
        plan = default_plan((0.0, 0.0, *soiled.height_map.size_mm), character_height_mm=HEIGHT_MM)
        scan = feel(soiled.height_map, plan=plan, height_mm=HEIGHT_MM, sensor_seed=number, soil=soiled.soil)
        save_scan(scan, stem.with_suffix(".h5"))
        scans.append(stem.with_suffix(".h5").read_bytes())
    return Supplies(tuple(photos), tuple(scans))


async def _client(send: Callable[[], Awaitable[httpx.Response]], until: float, tally: Tally) -> None:
    while time.monotonic() < until:
        start = time.perf_counter()
        try:
            answer = await send()
            status = str(answer.status_code)
        except httpx.HTTPError as error:
            status = type(error).__name__
        tally.seconds.append(time.perf_counter() - start)
        tally.statuses[status] += 1


async def run(
    url: str, kind: str, supplies: Supplies, *, clients: int, seconds: float
) -> tuple[Tally, float]:
    """Load the service for so long; returns what came back and the seconds it took to the last answer."""
    limits = httpx.Limits(max_connections=clients, max_keepalive_connections=clients)
    async with httpx.AsyncClient(base_url=url, timeout=REQUEST_TIMEOUT_S, limits=limits) as http:
        photos: Iterator[bytes] = itertools.cycle(supplies.photos)
        scans: Iterator[bytes] = itertools.cycle(supplies.scans)
        waiting: list[str] = []
        if kind == "fused":
            # as many parts that wait for touch as there are supplies; each may be felt again and again
            for photo in supplies.photos:
                answer = await http.post("/v1/parts", files={"photo": ("part.png", photo)})
                waiting.append(answer.json()["id"])
        targets = itertools.cycle(zip(waiting, supplies.scans, strict=True)) if waiting else None

        async def send() -> httpx.Response:
            if kind == "photo":
                return await http.post("/v1/parts", files={"photo": ("part.png", next(photos))})
            if kind == "scan":
                return await http.post("/v1/parts", files={"scan": ("part.h5", next(scans))})
            assert targets is not None
            part_id, scan = next(targets)
            return await http.post(f"/v1/parts/{part_id}/scan", files={"scan": ("part.h5", scan)})

        tally, start = Tally(), time.monotonic()
        await asyncio.gather(*(_client(send, start + seconds, tally) for _ in range(clients)))
        return tally, time.monotonic() - start


def main() -> None:
    """Run every kind of request with every number of clients."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--kinds", nargs="+", default=["photo", "scan", "fused"], choices=["photo", "scan", "fused"]
    )
    parser.add_argument("--clients", nargs="+", type=int, default=[1, 8, 32])
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--parts", type=int, default=20)
    parser.add_argument("--dirt", type=float, default=0.3)
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        supplies = make_supplies(folder, parts=chosen.parts, dirt=chosen.dirt)
        options = ("--jobs", str(chosen.jobs), "--format", FORMAT, "--font", "gothic", "--height-mm", "5")
        print(
            f"{chosen.parts} parts, dirt {chosen.dirt}, {chosen.jobs} processes, {chosen.seconds:.0f} s each"
        )
        print(
            f"{'kind':<6} {'clients':>7} {'answers':>8} {'errors':>7} {'a second':>9} {'p50 s':>7} "
            f"{'p99 s':>7}  statuses"
        )
        with service_process(folder / "service", *options) as service:
            for kind in chosen.kinds:
                asyncio.run(run(service.url, kind, supplies, clients=2, seconds=5.0))  # templates, once
                for clients in chosen.clients:
                    tally, took = asyncio.run(
                        run(service.url, kind, supplies, clients=clients, seconds=chosen.seconds)
                    )
                    p50, p99 = np.percentile(tally.seconds, [50, 99])
                    errors = sum(n for status, n in tally.statuses.items() if status not in ("200", "201"))
                    n = len(tally.seconds)
                    print(
                        f"{kind:<6} {clients:>7} {n:>8} {errors:>7} {n / took:>9.2f} {p50:>7.2f} {p99:>7.2f}  "
                        f"{dict(tally.statuses)}",
                        flush=True,
                    )


if __name__ == "__main__":
    main()
