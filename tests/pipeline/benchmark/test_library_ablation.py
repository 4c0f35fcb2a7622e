"""Variants of the reader differ from it in what they name, and in nothing else."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import log_softmax

from glyphs import stamp
from recognition.glyph_match.combine import NO_FACE
from recognition.glyph_match.face_library import face_library
from recognition.reader import Reader
from recognition.recogniser.read_line import with_slip
from tests.benchmarks.drawn_parts import DrawnPart, KeptSweeps
from tests.benchmarks.library_ablation import (
    VARIANTS,
    WHOLE,
    AblatedPart,
    VariantReading,
    group_table,
    is_learned,
    pair_table,
    read_variants,
    right_above_wrong,
    summary_table,
)


@pytest.fixture(scope="module")
def part() -> DrawnPart:
    dirty = stamp("K7", seed=4, dirt=0.3)
    facts = (8, "stamped", 0.3, "gothic", "A9", "workshop", "K7", 5.0)
    return DrawnPart(*facts, dirty.height_map, dirty.photograph(), dirty.soil)


def test_the_whole_library_reads_as_the_reader_does(part: DrawnPart) -> None:
    ablated = read_variants(part, KeptSweeps())
    reading = Reader(format="A9").read(part.height_map, soil=part.soil_layer)
    whole, expected = ablated.readings[WHOLE.name], VariantReading.of(reading, "K7")
    assert whole.losses.tobytes() == expected.losses.tobytes()
    assert whole.score == expected.score
    assert set(ablated.readings) == {variant.name for variant in VARIANTS}
    assert list(summary_table([AblatedPart.of(ablated.plain)])) == list(summary_table([ablated]))


def test_variants_change_the_library_and_the_weights(part: DrawnPart) -> None:
    reader, library = Reader(format="A9"), face_library("tactile")
    by_name = {}
    for variant in VARIANTS[1:]:
        with variant.in_place():
            by_name[variant.name] = reader.read(part.height_map, soil=part.soil_layer).trace
    few = set(by_name["10 faces"].faces) - {NO_FACE}
    assert few <= set(library.faces.names[:10])
    assert not set(by_name[WHOLE.name].faces) <= {*library.faces.names[:10], NO_FACE}
    trace = by_name["80 faces, product"]
    network, faces = (
        log_softmax(trace.by_expert[name].log_belief, axis=1) for name in ("network", "templates")
    )
    product = with_slip(replace(trace.lattice, log_belief=log_softmax(network + faces, axis=1)))
    assert np.exp(trace.lattice.log_belief) == pytest.approx(np.exp(product.log_belief), abs=1e-3)


def _reading(right: bool, score: float) -> VariantReading:
    return VariantReading("K7" if right else "H7", right, score, score > 0.5, np.array([0.1, 0.2]))


def test_right_readings_are_counted_above_the_wrong_ones() -> None:
    readings = [
        _reading(right, score)
        for right, score in ((True, 0.9), (False, 0.8), (True, 0.8), (True, 0.7), (False, 0.1))
    ]
    assert [right_above_wrong(readings, wrong) for wrong in (1, 2, 3)] == [1, 3, 3]


def _tables(parts: Sequence[AblatedPart]) -> str:
    return "\n".join([*summary_table(parts), *pair_table(parts), *group_table(parts, "severity")])


def test_tables_compare_each_variant_with_all_faces() -> None:
    parts = [
        AblatedPart(
            "stamped", 0.3, "arvo", {v.name: _reading(v == WHOLE or k > 0, 0.1 * k) for v in VARIANTS}
        )
        for k in range(9)
    ]
    tables = _tables(parts)
    assert f"| {WHOLE.name} | 9 | 9 |" in tables
    assert "| no library | 0, 1 (1) |" in tables


def test_a_font_that_was_learned_is_left_out() -> None:
    assert is_learned("allerta-latin-400-normal")  # the recogniser's manifest names allerta_medium.otf
    assert is_learned("roboto-mono-latin-700-normal")  # in the library
    assert not is_learned("arvo-latin-400-normal")
