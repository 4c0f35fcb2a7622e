"""Draw the figure of the page on results from the page's own table: python docs/results_figure.py"""

import re
from pathlib import Path

import matplotlib.pyplot as plt

PAGES = Path(__file__).parent / "pages"
DIRT = (0.0, 0.3, 0.6, 0.9)
STYLES = {
    "fused": ("touch and camera", "C0", "o-"),
    "tactile": ("touch", "C1", "s-"),
    "vision": ("camera", "C2", "^-"),
    "rapidocr relief": ("RapidOCR, felt relief", "0.4", "s--"),
    "rapidocr photo": ("RapidOCR, photograph", "0.65", "^--"),
}
CELL = re.compile(r"([\d.]+) \(([\d.]+) to ([\d.]+)\) / [\d.]+ / ([\d.]+) \(\d+\)")


def draw_results() -> None:
    """Write `figures/results.svg`: characters right with 95 % intervals, and parts accepted, against dirt."""
    plt.rcParams.update({"svg.hashsalt": "results", "svg.fonttype": "none"})
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.0, 3.6), layout="constrained")
    drawn = 0
    for line in (PAGES / "results.md").read_text(encoding="utf-8").splitlines():
        cells = [tuple(map(float, found.groups())) for found in CELL.finditer(line)]
        if len(cells) != len(DIRT):
            continue
        label, color, style = STYLES[line.split("|")[1].strip()]
        x = [dirt + 0.008 * (drawn - 2) for dirt in DIRT]  # side by side, so that no interval hides another
        drawn += 1
        share, low, high, accepted = zip(*cells, strict=True)
        error = [
            [a - b for a, b in zip(share, low, strict=True)],
            [b - a for a, b in zip(share, high, strict=True)],
        ]
        left.errorbar(x, share, error, fmt=style, color=color, capsize=3, label=label)
        right.plot(x, accepted, style, color=color, label=label)
    left.set(xlabel="dirt", ylabel="characters right, %", ylim=(40, 101), xticks=DIRT)
    right.set(xlabel="dirt", ylabel="parts accepted, %", ylim=(0, 101), xticks=DIRT)
    right.legend(frameon=False, fontsize="small")
    figure.savefig(PAGES / "figures" / "results.svg", metadata={"Date": None})


if __name__ == "__main__":
    draw_results()
