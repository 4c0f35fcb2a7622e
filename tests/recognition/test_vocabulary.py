"""What `from recognition import ...` offers, and how its values show themselves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import is_dataclass, replace

import matplotlib
import pytest
from matplotlib.figure import Figure

import recognition
from glyphs.stamping.stamp import StampedPart
from recognition import (
    ActiveReading,
    ActiveSettings,
    Candidate,
    Code,
    Finding,
    Grammar,
    Reader,
    ReaderSettings,
    Reading,
    ReadingFlag,
    StopReason,
)
from recognition.decide.depth_rules import depth_rule
from recognition.decide.evidence import SenseEvidence
from recognition.decide.verify import verify
from recognition.language.check_digits import CheckDigit

LONGEST = 200


@pytest.fixture(scope="module")
def reading(calm_part: StampedPart, reader: Callable[..., Reader]) -> Reading:
    """A reading whose last character is none of letters and figures."""
    read = reader(format="A99A", height_mm=5.0).read(calm_part.height_map)
    first, *_, last = read.characters
    last = replace(last, candidates=(Candidate("<", 0.9, 0.6), *first.candidates[:2]))
    return replace(
        read,
        characters=(*read.characters[:-1], last),
        findings=(Finding.of(ReadingFlag.LOW_CONFIDENCE), Finding(ReadingFlag.UNREAD_MARKS, "reads “SN8”")),
    )


@pytest.fixture(scope="module")
def values(reading: Reading) -> list[object]:
    """One of each kind, long ones of those that may be long."""
    first, trace = reading.characters[0], reading.trace
    assert trace.lattice is not None
    corners = ((20.123456789, 8.0), (24.0, 8.0), (24.0, 12.0), (20.0, 12.0))
    return [
        *(reading, trace, trace.choice, trace.lattice, trace.line, reading.box, reading.findings[0]),
        *(first, first.candidates[0], first.depth, first.state, first.grade, reading.evidence.touch.views[0]),
        *(verify(trace.lattice, "K71B"), CheckDigit("luhn"), depth_rule("27CFR478.92"), ActiveSettings()),
        ReaderSettings(fonts=("gothic", "futural"), format="AA999999", height_mm=5.0),
        Grammar(lexicon=frozenset(str(k) for k in range(1000, 9000))),
        Grammar(sets=("ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789",) * 20),
        Code("Data Matrix", "[)>␞12␝MFR 0AB12␝SER KX40725␞␄", corners),
        ActiveReading(SenseEvidence("tactile"), reading, (), StopReason.BUDGET, (0.0, 0.0, 40.0, 13.0)),
    ]


def test_values_print_on_one_short_line(values: list[object]) -> None:
    for value in values:
        assert len(repr(value)) < LONGEST, type(value)
        assert "\n" not in repr(value)


def test_no_public_value_is_left_out(values: list[object]) -> None:
    public = (getattr(recognition, name) for name in recognition.__all__)
    kinds = {kind for kind in public if isinstance(kind, type) and is_dataclass(kind)}
    assert kinds - {type(value) for value in values} == set()


def test_a_reading_is_a_table_in_a_notebook(reading: Reading) -> None:
    html = reading._repr_html_()
    assert "gothic" in html
    assert html.count("<td") == 3 * 4
    assert "&lt;" in html  # characters are text, not markup
    assert "<b style='font-size:150%'><</b>" not in html
    assert "reads “SN8”" in html
    assert len(html) < 20_000


def test_a_reading_is_drawn_for_show(reading: Reading) -> None:
    import matplotlib.pyplot as plt

    matplotlib.use("agg")
    figure = reading.plot(title="part")
    assert isinstance(figure, Figure)
    assert plt.gcf() is figure
    plt.close(figure)


def test_a_reading_keeps_its_trace_but_is_not_compared_by_it(reading: Reading) -> None:
    assert reading == replace(reading, trace=replace(reading.trace, lattice=None), evidence=None)
    assert "trace" not in repr(reading)


def test_options_go_over_settings() -> None:
    settings = Reader(ReaderSettings(height_mm=3.0), fonts=["gothic"]).settings
    assert settings == ReaderSettings(("gothic",), height_mm=3.0)
