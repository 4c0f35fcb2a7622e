"""`tactile-marks figures`: the paper's results, computed and drawn."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pipeline.cli.exit_status import failures_reported


def figures(
    *,
    out: Path = Path("figures-out"),
    mu: float = 0.2,
    noise: float = 0.0,
    seed: int = 0,
    picture_format: Literal["png", "svg"] = "png",
) -> int:
    """Draw Figs. 4, 6 and 7 of the paper, with the step F read off simulated traces beside eq. (16), and more.

    The linear beam beside the exact one, and the errors of friction, slope and depth as a mixed array finds them.

    Parameters
    ----------
    out
        Folder for the pictures, figures.csv and estimators.csv; made if it is not there.
    mu
        Friction coefficient in Figs. 6 and 7; Fig. 4 has the paper's range of them.
    noise
        Rms noise of the moment as a share of its value on the land, 0 to 0.02.
    seed
        Seed of the noise.
    picture_format
        Of the pictures.
    """
    with failures_reported():
        from pipeline.plots.drawing import FigureSettings
        from pipeline.plots.gallery import draw_gallery, step_table

        settings = FigureSettings(mu=mu, noise=noise, seed=seed)
        print("tracing and drawing (the first time also compiles the kernels) ...", flush=True)
        gallery = draw_gallery(out, settings=settings, picture_format=picture_format)
    print("\n".join(step_table(gallery.rows)))
    print(
        "peak: highest moment over the land's; the ball rounds the edge, and in contact the tip slides off it"
    )
    for path in (*gallery.pictures, *gallery.tables):
        print(f"wrote {path}")
    return 0
