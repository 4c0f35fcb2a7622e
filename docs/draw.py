"""Draw the pictures of the documentation with the program as it stands: `python docs/draw.py`, some minutes.

The figure of the page on results is drawn from its table; three of the page on physics and the animation of active
touch by the scripts beside this one; `review.jpg`, `shadow.jpg` and `teach.jpg` by `screenshots.py`, which needs a
browser; `covers.svg` by `tests/benchmarks/cover_reliability.py`.
"""

import contextlib
import re
import shutil
import tempfile
from pathlib import Path

from active_touch import draw_active_touch
from elastica_figure import elastica_figure
from estimators_figure import estimators_figure
from paper_figures import draw_figures
from results_figure import draw_results
from speed_figure import speed_figure

from pipeline.cli.main import main
from pipeline.plots.pictures import save_figure

PAGES = Path(__file__).parent / "pages"
DESIGN = "design --alpha 30:60 --mu 0.1:0.5 --depth-mm 0.2 --height-mm 5"
COMMANDS = (
    f"{DESIGN} --picture design.png --drawing whisker-drawing.svg",
    "design --array --height-mm 5 --accuracy 0.98 --dirt 0.3 --picture array.png",
    "bench scan bench.toml --region 3 8 21 16 --dry-run moves.png",
    "demo --out .",
)
"""Each writes its pictures into the working folder."""


def draw(folder: Path) -> None:
    """Run the commands in a folder, and copy the pictures that the pages have."""
    page = (PAGES / "how-to" / "bench.md").read_text(encoding="utf-8")
    bench = re.search(r"```toml\n(.*?)```", page, re.DOTALL)
    assert bench is not None
    (folder / "bench.toml").write_text(bench[1], encoding="utf-8")
    with contextlib.chdir(folder):
        draw_figures(Path())
        for command in COMMANDS:
            print(f"tactile-marks {command}", flush=True)
            if status := main(command.split()):
                raise SystemExit(status)
    for picture in sorted(folder.glob("*.*")):
        kept = PAGES / "figures" / picture.name
        if kept.exists():
            shutil.copyfile(picture, kept)
            print(f"drew {kept}")


if __name__ == "__main__":
    draw_results()
    for name, figure in (
        ("elastica", elastica_figure),
        ("estimators", estimators_figure),
        ("speed", speed_figure),
    ):
        print(f"drawing {name}", flush=True)
        save_figure(figure(), PAGES / "figures" / f"{name}.png")
    draw_active_touch(PAGES / "figures" / "active-touch.gif")
    with tempfile.TemporaryDirectory() as temporary:
        draw(Path(temporary))
