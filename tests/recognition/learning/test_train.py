"""A toy of the recogniser is trained in less than a minute, and reads what it has learned."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch", reason="the extra `train` is not installed")
pytest.importorskip("onnx2torch", reason="the extra `train` is not installed")

import torch
from cyclopts import App

from glyphs.part import stamp
from glyphs.stamping.layouts import Layout
from recognition.learning.covers import cover_rivals
from recognition.learning.network import COLUMNS, Recogniser
from recognition.learning.public_start import load_start
from recognition.learning.sketches import sketch_strips
from recognition.learning.train import train
from recognition.learning.train_recogniser import (
    as_read,
    choose_strips,
    crop_for_reading,
    decode,
    gather,
    measure,
)
from recognition.learning.training_loop import Training
from recognition.learning.training_parts import TrainingPart
from recognition.learning.training_samples import (
    TALL_ROWS,
    WIDE_MARGIN,
    TrainingStrip,
    TrainingView,
    lines_of,
    read_samples,
    rounds,
    write_samples,
)
from recognition.recogniser.recogniser import CHARACTERS, FEATURE_COLUMNS, WIDER
from recognition.see.text_line import HEIGHT_ROWS, MARGIN, ROWS, TextLine
from recognition.see.view import LAYERS, View, heights_view

STEPS = 60
TEXTS = ("K7", "7K", "B2", "2B", "KB", "BK", "72", "27")
TOY = Training(samples=8 * STEPS, batch=8, frozen_share=0.0)
READ_SHARE = 0.75
"""Of the characters that it was trained on."""


def line_of(text: str) -> tuple[View, TextLine, str]:
    """A clean plate as an instrument measures it, 28 samples to the height: what the recogniser sees."""
    part = stamp(text, fonts="gothic", height_mm=5.0, pitch_mm=5.0 / 28, seed=1)
    made = TrainingPart(part, Layout(), scan=None, photos=())  # type: ignore[arg-type]
    line, said, _ = lines_of(made)[0]
    return heights_view(part.height_map), line, said


def run_train(*words: object) -> None:
    """As the command line does."""
    app = App()
    app.default(train)
    command, bound, _ = app.parse_args([str(word) for word in words])[:3]
    command(*bound.args, **bound.kwargs)


def kept_in(folder: Path) -> list[TrainingStrip]:
    return read_samples(TrainingStrip, sorted(folder.glob("*.npz")))


def strip_of(text: str) -> TrainingStrip:
    view, line, said = line_of(text)
    layers = view.strip(line, rows=TALL_ROWS, margin=WIDE_MARGIN).astype(np.float16)
    # of those felt none is left out of a round
    return TrainingStrip(layers, said, "felt", 0.0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("strips")
    write_samples(made / "0.npz", [strip_of(text) for text in TEXTS])
    return made


@pytest.fixture(scope="module")
def trained(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("out") / "toy.onnx"
    torch.set_num_threads(1)
    train("recogniser", learn_from=[folder], held_out=folder, how=TOY, out=out, log=out.with_suffix(".log"))
    return out


def lines(log: Path) -> list[dict[str, object]]:
    return [json.loads(line) for line in log.read_text().splitlines()]


def test_its_own_texts_are_read(trained: Path, folder: Path) -> None:
    log = lines(trained.with_suffix(".log"))
    network = Recogniser(load_start(), CHARACTERS)
    network.load_state_dict(torch.load(trained.with_suffix(".pt"), weights_only=True))
    characters, mistakes, read = measure(network, kept_in(folder))["all"]
    assert (characters, read) == (2 * len(TEXTS), len(TEXTS))
    assert mistakes <= (1.0 - READ_SHARE) * characters
    # the log ends with what the last weights read, and their running mean
    assert [next(iter(line)) for line in log[-2:]] == ["last", "average"]


def test_what_is_written_reads_as_what_was_trained(trained: Path, folder: Path) -> None:
    from recognition.recogniser.networks import open_network

    network = Recogniser(load_start(), CHARACTERS)
    network.load_state_dict(torch.load(trained.with_suffix(".pt"), weights_only=True))
    network.eval()
    whole, session = open_network(trained.with_suffix(".float.onnx")), open_network(trained)
    for strip in kept_in(folder):
        fed = as_read(strip)[None]
        (said,) = whole.run(None, {"strip": fed})
        with torch.no_grad():
            expected = network(torch.from_numpy(fed)).numpy()
        # the same sums in another order, single precision
        np.testing.assert_allclose(said, expected, atol=1e-3)
        assert decode(said[0]) == decode(expected[0])
        # in eight bits posteriors move by some hundredths
        short, features = session.run(["posteriors", "features"], {"strip": fed})
        assert np.abs(np.exp(short) - np.exp(said)).mean() < 0.02
        # templates are compared in its middle layers
        assert features.ndim == 4
        assert features.shape[3] == round(fed.shape[3] / (FEATURE_COLUMNS * WIDER))
        assert features.std(axis=(2, 3)).max() > 0.0


def test_fewer_strips_than_a_batch_are_refused(folder: Path, tmp_path: Path) -> None:
    how = Training(samples=99, batch=99)
    with pytest.raises(ValueError, match="8 strips are fewer than a batch of 99"):
        train(
            "recogniser",
            learn_from=[folder],
            held_out=folder,
            how=how,
            out=tmp_path / "net.onnx",
            log=tmp_path / "log",
        )


# --------------------------------------------------------------------------------------------------------- parts


def test_a_plain_strip_is_what_is_read(folder: Path) -> None:
    strip = kept_in(folder)[0]
    cut = crop_for_reading(strip)
    assert cut.shape[:2] == (LAYERS, ROWS)
    shown = as_read(strip)
    assert shown.shape[2] % COLUMNS == 0
    assert 0 <= shown.shape[2] - WIDER * cut.shape[2] < COLUMNS + 1
    view, line, _ = line_of(TEXTS[0])
    asked = view.strip(line)
    # the margins are no whole number of columns: fifths of one, sixteen bits
    wide = min(asked.shape[2], cut.shape[2])
    off = np.abs(asked[:, :, :wide] - cut[:, :, :wide])
    assert np.median(off) < 1e-3
    assert off.max() < 0.5 * np.abs(np.diff(asked, axis=2)).max() + 1e-3


def test_strips_that_come_later_are_read_as_well(tmp_path: Path) -> None:
    write_samples(tmp_path / "a.npz", [strip_of("K7")] * 8)
    drawn = rounds(TrainingStrip, [tmp_path], np.random.default_rng(0), files=2)
    assert {s.text for s in next(drawn)} == {"K7"}
    write_samples(tmp_path / "b.npz", [strip_of("B2")] * 8)
    assert {s.text for s in next(drawn)} == {"K7", "B2"}
    write_samples(tmp_path / "c.npz", [strip_of("27")] * 8)
    # three files, two at a time: none is read alone
    assert [len(next(drawn)) for _ in range(3)] == [16] * 3
    with pytest.raises(ValueError, match="no samples"):
        next(rounds(TrainingStrip, [tmp_path / "none"], np.random.default_rng(0), files=2))


def test_hopeless_photographs_are_seldom_learned_from() -> None:
    def strip(source: str, severity: float) -> TrainingStrip:
        return TrainingStrip(np.ones((LAYERS, TALL_ROWS, 64), np.float16), "A", source, severity)

    strips = [strip("photo", 0.9)] * 200 + [strip("felt", 0.9)] * 50 + [strip("photo", 0.2)] * 200
    kept = choose_strips(strips, np.random.default_rng(0))
    hard, easy = (sum(s.source == "photo" and s.severity == level for s in kept) for level in (0.9, 0.2))
    assert sum(s.source == "felt" for s in kept) == 50
    assert 0 < hard < 0.6 * easy < 120


def test_covers_hide_what_tells_characters_apart_and_nothing_else() -> None:
    strip = sketch_strips([Path("gothic")], np.random.default_rng(1))[0]
    tall, _ = gather([strip] * 40)
    before = tall.clone()
    texts, places = ["B" * len(strip.text)] * 40, [strip.places] * 40
    covered = cover_rivals(tall, texts, places, rng=torch.Generator().manual_seed(0))
    changed = (covered != before).any(dim=1)
    assert changed.any()
    first, last = strip.places[0][0], strip.places[-1][1]
    assert not changed[:, :, : int(first) - 8].any()
    assert not changed[:, :, int(last) + 8 :].any()
    none = cover_rivals(before.clone(), texts, [()] * 40, rng=torch.Generator().manual_seed(0))
    torch.testing.assert_close(none, before)


def test_heights_and_brightness_are_seen_relative_to_what_lies_around(folder: Path) -> None:
    network = Recogniser(load_start(), "ABCD").eval()
    strip = torch.from_numpy(as_read(kept_in(folder)[0]))[None]
    lifted = strip.clone()
    lifted[:, 0] += 3.0 * strip[:, 6]
    with torch.no_grad():
        one, other = network.normalise(strip), network.normalise(lifted)
    inner = slice(round(MARGIN * HEIGHT_ROWS), -round(MARGIN * HEIGHT_ROWS))
    # a plate that lies three heights higher: blurs by way of coarser pixels leave a thousandth of it
    torch.testing.assert_close(one[..., 8:-8, inner], other[..., 8:-8, inner], atol=0.1, rtol=0.0)


def test_the_finder_is_trained_by_the_same_command(tmp_path: Path) -> None:
    """A few seconds of training find no lines; what is written says of every cell of any view what the network says."""
    from recognition.find.finder import CELL
    from recognition.learning.finder_network import FINDINGS, Finder
    from recognition.recogniser.networks import open_network

    rng = np.random.default_rng(0)
    views = [
        TrainingView(
            rng.normal(0.0, 0.02, (LAYERS, 40, 160)).astype(np.float16), (((20.0, 20.0), (140.0, 20.0)),)
        )
        for _ in range(4)
    ]
    write_samples(tmp_path / "views" / "0.npz", views)
    out, log = tmp_path / "finder.onnx", tmp_path / "finder.log"
    given = ["finder", "--learn-from", tmp_path / "views", "--held-out", tmp_path / "views"]
    given += ["--samples", 20, "--batch", 2, "--threads", 1, "--out", out, "--log", log]
    run_train(*given)
    assert [next(iter(line)) for line in lines(log)[-2:]] == ["last", "average"]
    network = Finder()
    network.load_state_dict(torch.load(out.with_suffix(".pt"), weights_only=True))
    network.eval()
    view = torch.from_numpy(views[0].layers.astype(np.float32))[None]
    (found,) = open_network(out).run(None, {"view": view.numpy()})
    assert found.shape == (1, FINDINGS, 40 // CELL, 160 // CELL)
    with torch.no_grad():
        np.testing.assert_allclose(found, network(view).numpy(), atol=1e-3)
