"""A process that does one thing again for every line it is sent, on one core, and answers when it is done.

    python one_core.py edge_map | read_known_height | read_unknown_height

Thread counts must be set in the environment before numpy is loaded, so this is a process of its own.
"""

from __future__ import annotations

import sys
from collections.abc import Callable

import numpy as np

from glyphs.die import default_die
from glyphs.outlines import load_font
from glyphs.stamping import stamp
from recognition.reader import Reader, ReaderSettings
from whisker_array.array import default_plan
from whisker_array.edges import edge_map
from whisker_array.scan import Scan, trace_scan
from whisker_array.sensor import draw_sensor_chain
from whisker_array.touch import default_touch

TEXT = "KR804217"
HEIGHT_MM = 5.0


def a_scan(text: str, seed: int) -> Scan:
    """A stamped part with all its variation, felt by whiskers as from the bench."""
    font, rng = load_font("gothic"), np.random.default_rng(seed)
    part = stamp(text, font, default_die(HEIGHT_MM, font=font), height_mm=HEIGHT_MM, rng=rng)
    plan = default_plan((0.0, 0.0, *part.height_map.size_mm), character_height_mm=HEIGHT_MM)
    chain = draw_sensor_chain(plan.array.n_whiskers, rng=rng)
    return trace_scan(part.height_map, touch=default_touch(HEIGHT_MM), plan=plan, sensor=chain, rng=rng)


def task(name: str) -> Callable[[], str]:
    """What is to be done; everything before it is warm."""
    scan = a_scan(TEXT, 1)
    if name == "edge_map":
        return lambda: "x".join(str(n) for n in edge_map(scan).shape)
    height = HEIGHT_MM if name == "read_known_height" else None
    reader = Reader(ReaderSettings(fonts=("gothic",), mask="AA999999", height_mm=height))
    reader.read_scan(a_scan("BZ135690", 2))  # another part, so that only the templates are kept

    def read() -> str:
        reading = reader.read_scan(scan).reading
        steps = " ".join(f"{step}={seconds:.4f}" for step, seconds in reading.seconds.items())
        return f"{reading.text} {steps}"

    return read


if __name__ == "__main__":
    do = task(sys.argv[1])
    do()
    print("ready", flush=True)
    for _ in sys.stdin:
        print(do(), flush=True)
