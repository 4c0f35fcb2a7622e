"""Serials that are a small part of a large photograph: how many are found, by their share of its width.

    python tests/benchmarks/wide_frames.py DRAWN --frames 12

A drawn photograph (`drawn_parts.py`) that the reader reads right by itself is pasted on a frame of 12 or 20 million
pixels with clutter: holes, plates with edges, bolts, labels with bars. A serial is found if the line that is read lies
on it, at its height within a factor of 2. Seconds are those of one core's processor.
"""

from __future__ import annotations

import math
import time
from pathlib import Path

import cv2
import numpy as np
from cyclopts import App
from numpy.typing import NDArray

from glyphs.camera.photo import Photo
from recognition.reader import Reader
from recognition.see.photo_frame import photo_pitch_mm
from tests.benchmarks.drawn_parts import DrawnPart, load_part

Pixels = NDArray[np.uint8]
SHARES = (0.05, 0.1, 0.19, 0.4)
"""Widths of a serial as shares of the frame's."""
SHAPES = {4000: 3000, 5472: 3648}
"""Rows of a frame by its columns: 12 and 20 million pixels."""
app = App()


def clutter(shape: tuple[int, int], rng: np.random.Generator) -> Pixels:
    """A frame of a machine: a shaded ground with plates, holes, bolts, labels, scratches and noise."""
    rows, columns = shape
    shade = np.add.outer(np.linspace(-15, 15, rows), np.linspace(20, -20, columns))
    frame = np.clip(110 + shade, 0, 255).astype(np.uint8)
    for _ in range(60):
        x, y = int(rng.integers(columns)), int(rng.integers(rows))
        size, grey = float(rng.uniform(0.01, 0.09)) * columns, int(rng.integers(30, 220))
        kind = rng.choice(["plate", "hole", "bolt", "label", "scratch"], p=(0.3, 0.25, 0.25, 0.05, 0.15))
        if kind == "plate":
            corner = (x + int(size * rng.uniform(0.5, 4.0)), y + int(size * rng.uniform(0.3, 2.0)))
            cv2.rectangle(frame, (x, y), corner, grey, -1)
            cv2.rectangle(frame, (x, y), corner, max(grey - 40, 0), max(2, int(size / 40)))
        elif kind == "hole":
            cv2.circle(frame, (x, y), int(size / 2), min(grey + 40, 255), -1, cv2.LINE_AA)
            cv2.circle(frame, (x, y), int(size / 2.4), 25, -1, cv2.LINE_AA)
        elif kind == "bolt":
            angles = rng.uniform(0, math.pi) + np.arange(6) * math.pi / 3
            corners = np.stack([x + size / 3 * np.cos(angles), y + size / 3 * np.sin(angles)], axis=1)
            cv2.fillPoly(frame, [np.rint(corners).astype(np.int32)], grey, cv2.LINE_AA)
            cv2.circle(frame, (x, y), int(size / 5), max(grey - 50, 0), max(2, int(size / 50)), cv2.LINE_AA)
        elif kind == "label":
            wide, high = int(size * 1.5), int(size * 0.7)
            cv2.rectangle(frame, (x, y), (x + wide, y + high), 225, -1)
            for bar in np.cumsum(rng.uniform(0.01, 0.06, 30)):
                if bar < 0.9:
                    left = x + int(bar * wide)
                    cv2.rectangle(frame, (left, y + high // 6), (left + wide // 60, y + high // 2), 40, -1)
        else:
            end = (x + int(rng.normal(0, 3) * size), y + int(rng.normal(0, 3) * size))
            cv2.line(frame, (x, y), end, grey, max(1, int(size / 60)), cv2.LINE_AA)
    noise = np.empty(shape, dtype=np.float32)
    cv2.setRNGSeed(int(rng.integers(2**31)))
    cv2.randn(noise, 0.0, 2.0)
    return np.clip(cv2.GaussianBlur(frame, (0, 0), 1.2) + noise, 0, 255).astype(np.uint8)


def framed(plate: Pixels, serial: tuple[float, ...], share: float, frame: Pixels, rng: np.random.Generator):
    """Paste a photograph into a frame so that its serial has a share of the width.

    Args:
        plate: the photograph.
        serial: x0, y0, x1, y1 of the serial on it, pixels.
        share: width of the serial as a share of the frame's.
        frame: the frame.
        rng: draws the place.

    Returns:
        The frame, and the serial's box on it; None if the photograph does not fit.
    """
    rows, columns = frame.shape
    scale = share * columns / (serial[2] - serial[0])
    size = (round(plate.shape[1] * scale), round(plate.shape[0] * scale))
    if size[0] >= columns or size[1] >= rows:
        return None
    shrinks = cv2.INTER_AREA if scale < 1.0 else cv2.INTER_CUBIC
    pasted = cv2.resize(plate, size, interpolation=shrinks)
    x, y = int(rng.integers(columns - size[0])), int(rng.integers(rows - size[1]))
    frame = frame.copy()
    frame[y : y + size[1], x : x + size[0]] = pasted
    return frame, tuple(v * scale + (x, y)[k % 2] for k, v in enumerate(serial))


def read_alone(part: DrawnPart) -> tuple[Pixels, tuple[float, ...]] | None:
    """The photograph of a part in grey and the box of its serial, pixels; None if it is not read right by itself."""
    reading = Reader(format=part.format).read(Photo(part.photo.pixels))
    if reading.text != part.text or reading.box is None:
        return None
    box = reading.box
    return np.rint(part.photo.grey() * 255).astype(np.uint8), (box.x0_mm, box.y0_mm, box.x1_mm, box.y1_mm)


def is_found(line, box: tuple[float, ...], pitch: float, *, most_size: float = 2.0) -> bool:
    """Whether a line lies on the box of a serial."""
    x, y = line.centre_mm.mean(axis=0) / pitch
    height = (line.height_mm / pitch) / (box[3] - box[1])
    inside = box[0] <= x <= box[2] and box[1] <= y <= box[3]
    return bool(inside and 1.0 / most_size <= height <= most_size)


@app.default
def main(drawn: Path, *, frames: int = 12, seed: int = 1, columns: int = 4000) -> None:
    """Print how many serials are found and read right, and the time, by their share of the width.

    Args:
        drawn: folder of drawn parts.
        frames: frames of each share.
        seed: seed of the frames.
        columns: width of a frame: 4000 or 5472 pixels.
    """
    parts = []
    for path in sorted(drawn.glob("*.h5")):
        part, _ = load_part(path)
        alone = read_alone(part)
        if alone is not None:
            parts.append((part, *alone))
        if len(parts) == frames:
            break
    print(f"{len(parts)} photographs that are read right by themselves")
    shape = (SHAPES[columns], columns)
    grounds = [clutter(shape, np.random.default_rng((seed, k))) for k in range(3)]
    for share in SHARES:
        found, right, accepted, wrong, seconds = 0, 0, 0, 0, []
        for number, (part, plate, serial) in enumerate(parts):
            rng = np.random.default_rng((seed, number))
            framing = framed(plate, serial, share, grounds[number % 3], rng)
            if framing is None:
                continue
            photo = Photo(framing[0])
            reader = Reader(format=part.format)
            start = time.process_time()
            reading = reader.read(photo)
            seconds.append(time.process_time() - start)
            line = reading.trace.line
            found += line is not None and is_found(line, framing[1], photo_pitch_mm(photo))
            right += reading.text == part.text
            accepted += reading.decision == "accept"
            wrong += reading.decision == "accept" and reading.text != part.text
        print(
            f"{shape[1]} x {shape[0]}, {100 * share:.0f} %: found {found} of {len(seconds)}, right {right}, "
            f"accepted {accepted} ({wrong} wrong), median {np.median(seconds):.2f} s, most {max(seconds):.2f} s",
            flush=True,
        )


if __name__ == "__main__":
    app()
