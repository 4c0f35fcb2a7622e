"""What `from recognition import ...` offers, and how its values show themselves."""

from __future__ import annotations

from dataclasses import is_dataclass, replace

import matplotlib
import numpy as np
import pytest
from matplotlib.figure import Figure

import recognition
from glyphs import EdgeMap, TraceDirection
from glyphs.surface.maps import HeightMap
from recognition import (
    ActiveReading,
    ActiveSettings,
    Box,
    Candidate,
    CharacterReading,
    Code,
    Finding,
    Grammar,
    Lattice,
    MarkDepth,
    Reader,
    ReaderSettings,
    Reading,
    ReadingFlag,
    ReadingTrace,
    StopReason,
    TextLine,
    Verification,
)
from recognition.decide.depth_rules import depth_rule
from recognition.decide.evidence import SenseEvidence
from recognition.decide.verify import verify
from recognition.language.check_digits import CheckDigit
from recognition.language.confusions import state_of
from recognition.language.constrained_decoding import choose
from recognition.marks.grade import Action, MarkGrade, Parameter
from recognition.see.view import heights_view

LONGEST = 200
TEXT = "KX40725<&>"


def lattice() -> Lattice:
    chars = tuple("ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789<&>")
    beliefs = np.full((len(TEXT), len(chars)), 1e-4)
    beliefs[np.arange(len(TEXT)), [chars.index(c) for c in TEXT]] = 0.95
    boxes = tuple(Box(float(k), 0.0, k + 0.9, 5.0) for k in range(len(TEXT)))
    return Lattice(chars, np.log(beliefs), boxes)


def grade() -> MarkGrade:
    names = ("contrast", "completeness", "contamination", "depth")
    return MarkGrade(tuple(Parameter(name, 0.5, 3) for name in names), Action.CLEAN)


def reading() -> Reading:
    characters = tuple(
        CharacterReading(
            tuple(Candidate(c, 0.9, p) for c, p in ((char, 0.95), ("8", 0.03), ("B", 0.01), ("Q", 0.005))),
            box,
            MarkDepth(0.2, 0.15, 0.25),
            state_of({char: 0.95, "8": 0.03}),
            grade(),
        )
        for char, box in zip(TEXT, lattice().boxes, strict=True)
    )
    layers = np.zeros((2, 40, 80), np.float32)
    trace = ReadingTrace(
        EdgeMap(layers, tuple(TraceDirection)[:2], np.ones((40, 80), np.bool_), 0.1),
        lattice(),
        choice=choose(lattice(), None),
        height_map=HeightMap(np.zeros((40, 80), np.float32), 0.1),
    )
    return Reading(
        characters,
        0.6,
        (Finding.of(ReadingFlag.LOW_CONFIDENCE), Finding.of(ReadingFlag.UNREAD_MARKS)),
        "gothic",
        5.0,
        box=Box(0.0, 0.0, 10.0, 5.0),
        trace=trace,
    )


def values() -> list[object]:
    read = reading()
    return [
        read,
        read.trace,
        read.trace.choice,
        read.characters[0],
        *(read.characters[0].candidates[0], read.characters[0].depth, read.characters[0].state, grade()),
        lattice(),
        verify(lattice(), TEXT),
        ReaderSettings(fonts=("gothic", "futural"), format="AA999999", height_mm=5.0),
        Grammar(lexicon=frozenset(str(k) for k in range(1000, 9000))),
        Grammar(sets=("ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789",) * 20),
        CheckDigit("luhn"),
        depth_rule("27CFR478.92"),
        Code(
            "Data Matrix",
            "[)>␞12␝MFR 0AB12␝SER KX40725␞␄",
            ((20.123456789, 8.0), (24.0, 8.0), (24.0, 12.0), (20.0, 12.0)),
        ),
        Finding(ReadingFlag.UNREAD_MARKS, "another line reads “SN8”"),
        TextLine.straight(4.0, 5.0, length_mm=7.0, height_mm=5.0, turned_deg=1.5),
        heights_view(HeightMap(np.zeros((40, 80), np.float32), 0.1)),
        Box(0.1234567891234, 0.0, 1.0, 1.0),
        ActiveReading(SenseEvidence("tactile"), read, (), StopReason.BUDGET),
        ActiveSettings(),
    ]


@pytest.mark.parametrize("value", values(), ids=lambda value: type(value).__name__)
def test_values_print_on_one_short_line(value: object) -> None:
    assert len(repr(value)) < LONGEST
    assert "\n" not in repr(value)


def test_no_public_value_is_left_out() -> None:
    public = (getattr(recognition, name) for name in recognition.__all__)
    kinds = {kind for kind in public if isinstance(kind, type) and is_dataclass(kind)}
    assert kinds - {type(value) for value in values()} == set()
    assert Verification in kinds


def test_a_reading_is_a_table_in_a_notebook() -> None:
    html = reading()._repr_html_()
    assert "gothic" in html
    assert html.count("<td") == 3 * len(TEXT)
    assert "&lt;" in html  # characters are text, not markup
    assert "<b style='font-size:150%'><</b>" not in html
    assert ReadingFlag.UNREAD_MARKS.text in html
    assert len(html) < 20_000


def test_a_reading_is_drawn_for_show() -> None:
    import matplotlib.pyplot as plt

    matplotlib.use("agg")
    figure = reading().plot(title="part")
    assert isinstance(figure, Figure)
    assert figure.get_suptitle().startswith("part: “KX40725<&>”, review")
    assert plt.gcf() is figure
    plt.close(figure)


def test_a_reading_keeps_its_trace_but_is_not_compared_by_it() -> None:
    read = reading()
    assert read == replace(read, trace=replace(read.trace, lattice=None), evidence=None)
    assert "trace" not in repr(read)


def test_options_go_over_settings() -> None:
    assert Reader(ReaderSettings(height_mm=3.0), fonts=["gothic"]).settings == ReaderSettings(
        ("gothic",), height_mm=3.0
    )
