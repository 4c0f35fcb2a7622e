"""Acceptance by `read --active` on parts whose texts have confusable rivals: accepted, wrong, stage seconds.

    python tests/benchmarks/active_acceptance.py [--seed 9000] [--parts 20] [--plan] [--each]

For each font and dirt severity `--parts` parts are stamped. Half of the texts are drawn from characters that dies and
dirt make alike (0 O Q D, 8 B, 5 S ...), the others freely. Every part is felt pass by pass; `--plan` reads the whole
plan, too. Intervals are Wilson's, 95 %.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator

import numpy as np
from scipy.stats import binomtest

from glyphs import stamp
from pipeline.reading.part_reader import simulated_stage
from recognition import Reader
from recognition.decide.evidence import Evidence
from recognition.see.virtual_array import VirtualArray
from recognition.surface import Surface

FORMAT = "AA999999"
FONTS = ("gothic", "futural", "timesrb")
SEVERITIES = (0.0, 0.3, 0.6)
LETTERS, DIGITS = "OQDCGBSZIPREFUVMN", "0156823"


def texts(rng: np.random.Generator) -> Iterator[str]:
    """Serials of the format, every other one of confusable characters alone."""
    every = ("ABCDEFGHIJKLMNOPQRSTUVWXYZ", "0123456789")
    while True:
        for letters, digits in ((LETTERS, DIGITS), every):
            yield "".join(rng.choice(list(letters if kind == "A" else digits)) for kind in FORMAT)


def share(count: int, n: int) -> str:
    """Count of n, with its interval in percent."""
    if not n:
        return "-"
    low, high = binomtest(count, n).proportion_ci(method="wilson")
    return f"{count}/{n} ({100 * low:.0f} to {100 * high:.0f} %)"


def main(
    *, seed: int = 9000, parts: int = 20, budget_s: float = 60.0, plan: bool = False, each: bool = False
) -> None:
    """Print a table by dirt.

    Args:
        seed: of the parts.
        parts: of each font and dirt.
        budget_s: of the stage, for each part.
        plan: read the whole plan, too.
        each: print a line for each part.
    """
    warnings.simplefilter("error", RuntimeWarning)
    reader, stage = Reader(format=FORMAT), simulated_stage(VirtualArray(), "")
    rows = []
    for font in FONTS:
        for severity in SEVERITIES:
            drawn = texts(np.random.default_rng((seed, len(rows))))
            for _ in range(parts):
                text, own_seed = next(drawn), (seed, len(rows))
                part = stamp(text, fonts=font, dirt=severity, seed=own_seed)
                surface = Surface(part.height_map, part.soil, stage=stage, budget_s=budget_s)
                one = reader.decide(Evidence.of(reader.feel(surface)))
                log = one.trace.scan.log if one.trace.scan is not None else None
                stage_s = sum(p.order.stage_s for p in log.passes) if log is not None else 0.0
                whole = reader.read(part.height_map, soil=part.soil) if plan else None
                rows.append((severity, font, text, one, stage_s, whole))
                if each:
                    worn = "worn " if any("worn tip" in m for m in one.messages()) else ""
                    extra = (
                        "" if whole is None else f" | {whole.text} {whole.decision} {whole.confidence:.3f}"
                    )
                    mark = "WRONG" if one.decision == "accept" and one.text != text else ""
                    print(
                        f"{font:8} {severity} {own_seed} {text} {one.text:8} {one.decision:7} {one.confidence:.3f} "
                        f"{stage_s:5.1f}s {worn}{mark}{extra}",
                        flush=True,
                    )  # fmt: skip
    print(
        f"{'dirt':>5} {'parts':>5}  {'accepted':<24} {'accepted wrong':<22} stage s mean, median  worn tip named"
    )
    for level in (*SEVERITIES, None):
        own = [row for row in rows if level is None or row[0] == level]
        accepted = [row for row in own if row[3].decision == "accept"]
        wrong = sum(row[3].text != row[2] for row in accepted)
        spent = [row[4] for row in own]
        worn = sum(any("worn tip" in m for m in row[3].messages()) for row in own)
        print(
            f"{'all' if level is None else level:>5} {len(own):>5}  {share(len(accepted), len(own)):<24} "
            f"{share(wrong, len(accepted)):<22} {np.mean(spent):.1f}, {np.median(spent):.1f}  {worn}"
        )
        if plan:
            taken = [row for row in own if row[5].decision == "accept"]
            bad = sum(row[5].text != row[2] for row in taken)
            print(f"      whole plan: {share(len(taken), len(own))}, wrong {share(bad, len(taken))}")


if __name__ == "__main__":
    from cyclopts import run

    run(main)
