"""Growth of the time of reading: with the characters of a line, the parts of a run, and the fonts that compete.

    python tests/benchmarks/scaling.py [--axes characters parts fonts] [--figure scaling.svg] [--rounds 3]

One core, character height and format given, clean parts in gothic, scans by sensors as from the bench; their simulation
is not counted. Of every part the fastest round, since other work on a machine only adds; then the mean over the parts.
The run of parts is the command itself, `read --jobs 1` on recordings, from its start to its end.

Fonts: the built-in ones, those TTFs of the plotting library that have all letters and figures, and, as these are not
enough, the same slanted or condensed. Printed: a table an axis, the line t = a + b n by the median of slopes, and p of
t ~ n^p.
"""

from __future__ import annotations

import argparse
import json
import logging
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.stats import theilslopes

from glyphs.fonts.glyph import Font, FontError, Glyph
from glyphs.fonts.outlines import BUILTIN_FONTS, load_font
from pipeline.formats.synth import SynthSpec, make_part
from pipeline.reading.simulated_scan import feel
from recognition.language.remainders import ALPHANUMERIC
from recognition.reader import Reader
from recognition.senses.settings import ReaderSettings
from whisker_array.scan.recording import save_scan
from whisker_array.scan.scan import Scan
from whisker_array.whisker.array import default_plan

HEIGHT_MM = 5.0
ONE_CORE = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL", "NUMBA")}
CHARACTERS, PARTS, FONTS = (2, 4, 6, 8, 12, 16), (10, 20, 40, 80), (1, 2, 4, 8, 16, 32, 64)
VARIANTS = (("slanted 10 deg", 0.176, 1.0), ("condensed 0.8", 0.0, 0.8), ("slanted, condensed", 0.176, 0.8))
"""Name, shear and width of what is made of a font."""


@dataclass(frozen=True)
class Point:
    """One line of a table: how many, the seconds, of how many parts how many were right, and a remark."""

    n: int
    seconds: float
    right: int
    of: int
    remark: str = ""


@dataclass(frozen=True)
class Axis:
    """Quantity that is varied, its points, and the unit of the seconds."""

    name: str
    of: str
    points: tuple[Point, ...]

    def line(self) -> tuple[float, float]:
        """(a, b) of t = a + b n: the median slope of all pairs (Theil and Sen), which one odd point does not turn."""
        found = theilslopes([p.seconds for p in self.points], [p.n for p in self.points])
        return float(found.intercept), float(found.slope)

    def power(self) -> float:
        """p of t ~ n^p."""
        return float(
            np.polyfit(*np.log([[p.n for p in self.points], [p.seconds for p in self.points]]), 1)[0]
        )


def format_of(count: int) -> str:
    """Two letters, then figures."""
    return "AA"[:count] + "9" * (count - 2)


def a_scan(format: str, number: int) -> tuple[str, Scan]:
    """The text stamped, and the recording of it."""
    part = make_part(SynthSpec(format=format, seed=400), number)
    plan = default_plan((0.0, 0.0, *part.height_map.size_mm), character_height_mm=HEIGHT_MM)
    scan = feel(part.height_map, plan=plan, height_mm=HEIGHT_MM, sensor_seed=number)
    return "".join(part.text.split()), scan


def timed(reader: Reader, scans: Sequence[tuple[str, Scan]], *, rounds: int) -> tuple[float, int, str]:
    """Seconds a part, how many are right, and the steps that take most; the first round only warms."""
    fastest = [float("inf")] * len(scans)
    right, steps = 0, Counter[str]()
    for k in range(rounds + 1):
        for place, (text, scan) in enumerate(scans):
            start = time.perf_counter()
            reading = reader.read(scan)
            took = time.perf_counter() - start
            if k == 0:
                right += "".join(reading.text.split()) == text
            else:
                fastest[place] = min(fastest[place], took)
                steps.update(reading.seconds)
    share = sum(steps.values())
    most = ", ".join(f"{step} {seconds / share:.0%}" for step, seconds in steps.most_common(3))
    return sum(fastest) / len(scans), right, most


def over_characters(counts: Sequence[int], *, parts: int, rounds: int) -> Axis:
    """A reading of lines of so many characters, one font."""
    points = []
    for count in counts:
        scans = [a_scan(format_of(count), number) for number in range(parts)]
        reader = Reader(ReaderSettings(fonts=("gothic",), format=format_of(count), height_mm=HEIGHT_MM))
        seconds, right, most = timed(reader, scans, rounds=rounds)
        points.append(Point(count, seconds, right, parts, most))
    return Axis("characters", "a reading, one font", tuple(points))


def over_fonts(counts: Sequence[int], *, parts: int, rounds: int) -> Axis:
    """A reading of eight characters while so many fonts compete, the right one among them."""
    fonts, points = competing(max(counts)), []
    scans = [a_scan(format_of(8), number) for number in range(parts)]
    for count in counts:
        reader = Reader(ReaderSettings(format=format_of(8), height_mm=HEIGHT_MM, fonts=fonts[:count]))
        start = time.perf_counter()
        reader.read(scans[0][1])
        first_s = time.perf_counter() - start
        seconds, right, most = timed(reader, scans, rounds=rounds)
        points.append(
            Point(count, seconds, right, parts, f"first, with its templates {first_s:.1f} s; {most}")
        )
    return Axis("competing fonts", "a reading of 8 characters", tuple(points))


def over_parts(counts: Sequence[int], *, rounds: int) -> Axis:
    """The whole command on so many recordings of eight characters."""
    points = []
    with tempfile.TemporaryDirectory() as folder:
        texts = {}
        for number in range(max(counts)):
            texts[f"part-{number:03d}"], scan = a_scan(format_of(8), number)
            save_scan(scan, Path(folder) / f"part-{number:03d}.h5")
        for count in counts:
            files = [f"{name}.h5" for name in list(texts)[:count]]
            known = (
                "--font",
                "gothic",
                "--format",
                format_of(8),
                "--height-mm",
                f"{HEIGHT_MM:g}",
                "--jobs",
                "1",
            )
            command = [sys.executable, "-m", "pipeline", "read", *files, *known, "--out", f"{count}.jsonl"]
            took = []
            for _ in range(rounds + (not points)):  # the very first may have to compile
                start = time.perf_counter()
                subprocess.run(command, cwd=folder, check=True, capture_output=True)
                took.append(time.perf_counter() - start)
            seconds = min(took)
            right = right_in(Path(folder) / f"{count}.jsonl", texts)
            points.append(Point(count, seconds, right, count, f"{count / seconds:.2f} parts a second"))
    return Axis("parts", "the command, from start to end", tuple(points))


def right_in(table: Path, texts: dict[str, str]) -> int:
    """Number of rows with the text that was stamped."""
    rows = map(json.loads, table.read_text(encoding="utf-8").splitlines())
    return sum("".join(row["text"].split()) == texts[row["part"]] for row in rows)


def competing(count: int) -> tuple[Font, ...]:
    """So many fonts, gothic first; ends the program if there are not so many."""
    plain = [load_font(name) for name in BUILTIN_FONTS] + plotting_fonts()
    made = [varied(font, *variant) for variant in VARIANTS for font in plain]
    fonts = (plain + made)[:count]
    if len(fonts) < count:
        raise SystemExit(f"{len(fonts)} fonts are at hand, not {count}")
    n_own, n_plain = min(len(BUILTIN_FONTS), count), min(len(plain), count)
    others = f"{n_plain - n_own} of the plotting library, {count - n_plain} of these slanted or condensed"
    print(f"\nfonts: {n_own} built in, {others}")
    return tuple(fonts)


def plotting_fonts() -> list[Font]:
    """Those TTFs of the plotting library that have every letter and figure."""
    import matplotlib

    logging.getLogger("fontTools").setLevel(logging.ERROR)  # of odd dates in some of them
    found = []
    for file in sorted(Path(matplotlib.get_data_path(), "fonts", "ttf").glob("*.ttf")):
        try:
            font = load_font(str(file))
        except FontError:
            continue  # symbols only
        if set(ALPHANUMERIC) <= set(font.glyphs) and font.name not in {f.name for f in found}:
            found.append(font)
    return found


def varied(font: Font, name: str, shear: float, width: float) -> Font:
    """The font leaning or narrower, under a name that says so."""
    turn = np.array([[width, 0.0], [shear, 1.0]])

    def changed(glyph: Glyph) -> Glyph:
        return replace(
            glyph,
            strokes=tuple(line @ turn for line in glyph.strokes),
            contours=tuple(line @ turn for line in glyph.contours),
            advance=glyph.advance * width,
        )

    glyphs = {char: changed(font.glyphs[char]) for char in ALPHANUMERIC}
    return Font(
        f"{font.name}, {name}", glyphs, font.stroke_ratio, f"{font.name}, {name}, for this measurement"
    )


def tell(axis: Axis) -> None:
    """Print the table of one axis."""
    a, b = axis.line()
    print(f"\n{axis.name}: {axis.of}")
    for point in axis.points:
        print(
            f"  {point.n:4d}  {point.seconds * 1000:9.0f} ms  right {point.right}/{point.of}  {point.remark}"
        )
    print(f"  t = {a * 1000:.0f} ms + {b * 1000:.1f} ms x n;  t ~ n^{axis.power():.2f}", flush=True)


def draw(axes: Sequence[Axis], path: Path) -> None:
    """All axes in one picture."""
    import matplotlib

    matplotlib.rcParams.update({"svg.fonttype": "none", "svg.hashsalt": "scaling", "font.size": 9})
    from matplotlib.figure import Figure

    figure = Figure(figsize=(3.2 * len(axes), 2.9), layout="constrained")
    for panel, axis in zip(np.atleast_1d(figure.subplots(1, len(axes))), axes, strict=True):
        n, seconds = np.array([(p.n, p.seconds) for p in axis.points]).T
        a, b = axis.line()
        unit, scale = ("s", 1.0) if seconds.max() >= 2.0 else ("ms", 1000.0)
        along = np.linspace(0.0, n.max(), 65)
        panel.plot(along, scale * (a + b * along), color="#7f7f7f", linewidth=1.0, zorder=1)
        panel.plot(n, scale * seconds, "o", color="#0072b2", zorder=2)
        panel.set(xlim=(0, None), ylim=(0, None), xlabel=axis.name, ylabel=f"time, {unit}")
        if seconds.max() > 20.0 * seconds.min():  # a step, beside which all else would lie on the axis
            low, high = 0.5 * scale * seconds.min(), 2.0 * scale * seconds.max()
            panel.set(xscale="log", yscale="log", xlim=(0.8 * n.min(), 1.3 * n.max()), ylim=(low, high))
            for side in (panel.xaxis, panel.yaxis):
                side.set_major_formatter("{x:g}")
        else:
            panel.xaxis.get_major_locator().set_params(integer=True)
        slope = f"{scale * a:.3g} {unit} + {1000 * b:.3g} ms each"
        panel.set_title(f"{axis.of}\n{slope}", fontsize=9, loc="left")
        panel.spines[["top", "right"]].set_visible(False)
        panel.grid(color="#e4e8eb", linewidth=0.6)
    figure.savefig(path, metadata={"Date": None} if path.suffix == ".svg" else None, dpi=110)


def main() -> None:
    """Command line."""
    if any(os.environ.get(name) != value for name, value in ONE_CORE.items()):
        # numpy has counted the cores already
        os.execve(sys.executable, [sys.executable, *sys.argv], {**os.environ, **ONE_CORE})
    plain = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=plain)
    parser.add_argument("--axes", nargs="+", choices=("characters", "parts", "fonts"))
    parser.add_argument("--characters", nargs="+", type=int, default=CHARACTERS, help="of a line")
    parser.add_argument("--parts", nargs="+", type=int, default=PARTS, help="of a run")
    parser.add_argument("--fonts", nargs="+", type=int, default=FONTS, help="that compete")
    parser.add_argument("--samples", type=int, default=4, help="parts a point, but for --axes parts")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--figure", type=Path, help=".svg or .png")
    options = parser.parse_args()
    if min(map(len, (options.characters, options.parts, options.fonts))) < 2:
        parser.error("a curve needs two points at least")
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    n, rounds = options.samples, options.rounds
    measure: dict[str, Callable[[], Axis]] = {
        "characters": lambda: over_characters(options.characters, parts=n, rounds=rounds),
        "parts": lambda: over_parts(options.parts, rounds=rounds),
        "fonts": lambda: over_fonts(options.fonts, parts=n, rounds=rounds),
    }
    axes = []
    for name in options.axes or measure:
        axes.append(measure[name]())
        tell(axes[-1])
    if options.figure is not None:
        draw(axes, options.figure)
        print(f"\nwrote {options.figure}, {options.figure.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
