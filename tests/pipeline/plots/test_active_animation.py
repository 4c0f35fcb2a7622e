"""The animation of active touch: a frame a pass, small, and nothing written where it cannot be."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from glyphs.errors import FileError
from glyphs.surface.maps import HeightMap, TraceDirection
from pipeline.plots.active_animation import LAST_MS, FeltPart, save_animation
from recognition.active.active_reading import ActiveReading, PassFelt, PlaceBelief, StopReason
from recognition.decision.reading import Reading
from whisker_array.whisker.passes import Pass


def felt_part(passes: int = 3) -> FeltPart:
    y, x = np.mgrid[0:40, 0:120] * 0.1
    felt = [
        PassFelt(
            Pass(
                direction=TraceDirection.FORWARD_Y if k % 2 else TraceDirection.FORWARD_X,
                line_mm=(0.5 + k, 1.5 + k),
                along_mm=(0.0, 4.0),
                sample_pitch_mm=0.1,
                speed_mm_s=50.0,
            ),
            1.0 + k,
            why="to try it",
            places=()
            if k == 0
            else (PlaceBelief("K", 0.6 + 0.1 * k, "X", (3.0, 2.0)), PlaceBelief("4", 0.9)),
        )
        for k in range(passes)
    ]
    found = ActiveReading(Reading((), 0.7), tuple(felt), StopReason.NO_GAIN)
    surface = HeightMap((0.1 * np.sin(3.0 * x) * (y > 2.0)).astype(np.float32), 0.1)
    return FeltPart(surface, found, [None] * passes, sure_from=0.95)


@pytest.mark.parametrize(("suffix", "kind"), [(".gif", "GIF"), (".png", "PNG")])
def test_a_frame_a_pass_and_the_last_stays(tmp_path: Path, suffix: str, kind: str) -> None:
    path, still = tmp_path / f"felt{suffix}", tmp_path / "still.png"
    save_animation(felt_part(), path, still=still)
    with Image.open(path) as moving:
        assert (moving.format, moving.n_frames) == (kind, 3)  # type: ignore[attr-defined]
        frames, shown_ms = [], []
        for k in range(3):
            moving.seek(k)
            frames.append(np.asarray(moving.convert("RGB"), dtype=int))
            shown_ms.append(moving.info["duration"])
    assert shown_ms[-1] == LAST_MS > shown_ms[0]
    assert all(np.abs(a - b).max() > 50 for a, b in itertools.pairwise(frames))
    np.testing.assert_array_equal(np.asarray(Image.open(still).convert("RGB")), frames[-1])


def test_other_suffixes_are_refused_before_anything_is_drawn(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"end it in \.gif or \.png"):
        save_animation(felt_part(), tmp_path / "felt.mp4")
    with pytest.raises(ValueError, match="edge maps"):
        FeltPart(felt_part().height_map, felt_part().found, [], sure_from=0.9)
