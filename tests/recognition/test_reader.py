"""Stamped plates go in, serials come out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from glyphs import stamp
from glyphs.fonts.glyph import FontError
from glyphs.stamping.stamp import StampedPart
from glyphs.surface.maps import HeightMap, MapError, TraceDirection
from recognition.decide.decision import Decision, ReadingFlag
from recognition.decide.depth_rules import depth_rule
from recognition.decide.reading import Reading
from recognition.reader import Reader
from recognition.see.virtual_array import VirtualArray
from recognition.settings import STAND_INS, ReaderSettings, Repertoire
from tests.support.felt import felt, shallower
from whisker_array.scan.sensor import draw_sensor_chain
from whisker_array.simulation.traces import Fidelity
from whisker_array.whisker.touch import Touch

Make = Callable[..., StampedPart]
Readers = Callable[..., Reader]
LEAN_SHARE = 0.15
"""Of a line's turn, by which that of the line found may fall short; the recogniser bears it."""
HEIGHT_SHARE = 0.12
"""Of the height, by which that of a line found may be mistaken; the recogniser bears it."""
KNOWN = {"format": "A9A99", "height_mm": 5.0}
"""Of `K7B29`: where another thing is asked, what is known halves the time of a reading."""


def holds(outer: tuple[float, float, float, float], x: float, y: float) -> bool:
    return outer[0] < x < outer[2] and outer[1] < y < outer[3]


def check(reading: Reading, part: StampedPart, *, accepted: bool = True) -> None:
    """Text, place, height and decision of a reading of a part that was stamped with known ones."""
    assert reading.text == part.text
    if accepted:
        assert reading.decision is Decision.ACCEPT
        # a wrong acceptance is the dear mistake: one in ten by the default threshold
        assert reading.confidence >= 0.9
    assert reading.height_mm == pytest.approx(part.height_mm, rel=HEIGHT_SHARE)
    true_boxes = [b for b, c in zip(part.boxes_mm, part.text, strict=True) if c != " "]
    for found, (x0, y0, x1, y1) in zip(reading.characters, true_boxes, strict=True):
        box = (found.box.x0_mm, found.box.y0_mm, found.box.x1_mm, found.box.y1_mm)
        assert holds(box, 0.5 * (x0 + x1), 0.5 * (y0 + y1))
        assert reading.box.x0_mm <= found.box.x0_mm + 1e-9
        assert reading.box.y1_mm >= found.box.y1_mm - 1e-9


@pytest.fixture(scope="module")
def plain(make_part: Make, reader: Readers) -> tuple[StampedPart, Reading]:
    part = make_part()
    return part, reader().read(part.height_map)


def test_what_a_reading_tells(plain: tuple[StampedPart, Reading]) -> None:
    part, reading = plain
    check(reading, part)
    assert (reading.font, reading.source, reading.raised) == ("gothic", "tactile", False)
    assert reading.flags is ReadingFlag.NONE
    assert reading.rotation_deg == pytest.approx(0.0, abs=1.5)
    steps = "mount, first pass, scan, see, find, measure, decide"
    assert set(reading.seconds) == set(steps.split(", "))
    assert all(t >= 0.0 for t in reading.seconds.values())
    boxes = [c.box for c in reading.characters]
    assert all(a.x0_mm < b.x0_mm and a.x1_mm < b.x1_mm for a, b in pairwise(boxes))
    assert set(reading.trace.by_expert) >= {"network", "templates"}
    assert reading.trace.scan.fidelity == Fidelity.CONTACT.value
    # templates settle the height of the line that was found by at most a twentieth
    assert reading.height_mm == pytest.approx(reading.trace.line.height_mm, rel=0.06)
    assert reading.trace.edge_map is not None
    assert reading.trace.height_map is not None


@pytest.mark.parametrize(
    ("made", "known"),
    [
        ({"pitch_mm": 0.02}, KNOWN),
        ({"pitch_mm": 0.15}, KNOWN),
        ({"height_mm": 2.5}, {}),
        ({"face": "round"}, KNOWN),
        ({"text": "AB 123"}, {"format": "AA 999", "height_mm": 5.0}),
        ({"text": "AB 123"}, {"format": None, "height_mm": 5.0, "accept_risk": 0.02}),
        ({}, {"fonts": ()}),
        ({}, {"array": VirtualArray(fidelity=Fidelity.POINTWISE), **KNOWN}),
    ],
)
def test_parts_of_all_kinds_are_accepted(
    made: dict[str, Any], known: dict[str, Any], make_part: Make, reader: Readers
) -> None:
    part = make_part(**made)
    reading = reader(**known).read(part.height_map)
    check(reading, part)
    assert reading.font == "gothic"


@pytest.mark.parametrize("face", ["sharp", "dotted"])
def test_other_faces_are_read_for_review(face: str, make_part: Make, reader: Readers) -> None:
    # templates are of a flat face: the text is right, but nobody should trust it unseen
    part = make_part(face=face)
    check(reader(**KNOWN).read(part.height_map), part, accepted=False)


def test_raised_marks(make_part: Make, reader: Readers) -> None:
    part = make_part(raised=True)
    reading = reader(**KNOWN).read(part.height_map)
    check(reading, part)
    assert reading.raised
    # their height is their depth, by a die of 0.2 mm
    assert all(c.depth is not None and c.depth.mean_mm > 0.15 for c in reading.characters)


def test_a_turned_line(make_part: Make, reader: Readers) -> None:
    part = make_part(line_rotation_deg=-8.0)
    reading = reader(**KNOWN).read(part.height_map)
    check(reading, part)
    assert reading.rotation_deg == pytest.approx(-8.0, abs=LEAN_SHARE * 8.0)


def test_a_slanted_line(make_part: Make, reader: Readers) -> None:
    """Its height is known less well than a level one's: it was learned on those."""
    reading = reader(**KNOWN).read(make_part(line_rotation_deg=-140.0).height_map)
    assert (reading.text, reading.decision) == ("K7B29", Decision.ACCEPT)
    assert reading.rotation_deg == pytest.approx(-140.0, abs=LEAN_SHARE * 30.0)


def test_dropouts(make_part: Make, reader: Readers) -> None:
    part = make_part()
    z = part.height_map.z_mm.copy()
    z[np.random.default_rng(5).random(z.shape) < 0.03] = np.nan
    z[5:28, 80:140] = np.nan
    reading = reader(**KNOWN).read(HeightMap(z, part.height_map.pitch_mm))
    check(reading, part, accepted=False)
    assert ReadingFlag.DROPOUTS in reading.flags
    assert reading.decision is not Decision.REJECT


def test_noisy_sensors(make_part: Make, reader: Readers, touch: Touch) -> None:
    part, rng = make_part(), np.random.default_rng(3)
    chain = draw_sensor_chain(8, rng=rng, full_scale_n_mm=3.0 * abs(touch.land_moment_n_mm()))
    reading = reader(**KNOWN).read(felt(part.height_map, sensor=chain, rng=rng))
    check(reading, part)
    assert "scan" not in reading.seconds


def test_one_direction_is_enough_to_read(make_part: Make, reader: Readers) -> None:
    part = make_part()
    check(reader(**KNOWN).read(felt(part.height_map, directions=(TraceDirection.BACK_X,))), part)


def test_a_format_with_a_literal(make_part: Make, reader: Readers) -> None:
    part = make_part("AB-123")
    reading = reader(format="AA-999", height_mm=5.0).read(part.height_map)
    check(reading, part)
    assert [c.char for c in reading.characters[2].candidates] == ["-"]


def test_a_format_leaves_only_what_it_allows(make_part: Make, reader: Readers) -> None:
    part = make_part("B8O0I1", seed=6)
    reading = reader(format="A9A9A9", height_mm=5.0).read(part.height_map)
    check(reading, part, accepted=False)
    for k, character in enumerate(reading.characters):
        assert all(c.char.isdigit() == (k % 2 == 1) for c in character.candidates)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"height_mm": 0.0}, "height_mm"),
        ({"height_mm": -5.0}, "height_mm"),
        ({"height_mm": float("nan")}, "height_mm"),
        ({"height_mm": float("inf")}, "height_mm"),
        ({"accept_risk": 1.5}, "accept_risk"),
        ({"accept_risk": float("nan")}, "accept_risk"),
        ({"accept_risk": -0.1}, "accept_risk"),
    ],
)
def test_settings_out_of_range_are_refused(wrong: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        ReaderSettings(**wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize("format", ["A9~99", "ä9A99", "€"])
def test_a_font_that_lacks_what_the_format_needs_is_refused(format: str) -> None:
    with pytest.raises(FontError, match="gothic"):
        Reader(ReaderSettings(fonts=("gothic",), format=format))


def test_fonts_that_nobody_named_are_stood_in_for_whatever_the_format_needs() -> None:
    # the gothic has no plus, and no font has a euro
    for format_ in ("A-9", r"A\+9", "A€9"):
        assert tuple(f.name for f in Repertoire(ReaderSettings(format=format_)).fonts) == STAND_INS


@pytest.mark.parametrize(("shape", "height_mm"), [((8, 8), 0.5), ((8, 8), 50.0), ((2, 300), None)])
def test_maps_too_small_for_characters_are_rejected(
    shape: tuple[int, int], height_mm: float | None, reader: Readers
) -> None:
    rough = HeightMap(np.random.default_rng(0).normal(size=shape), 0.1)
    assert reader(height_mm=height_mm).read(rough).decision is Decision.REJECT


# ------------------------------------------------------------------------------------------------------ depth


def test_every_character_has_a_depth(plain: tuple[StampedPart, Reading]) -> None:
    part, reading = plain
    assert reading.trace.relief.height_mm.shape == reading.trace.edge_map.shape
    z, pitch = reading.trace.height_map.z_mm, reading.trace.height_map.pitch_mm
    for character, (x0, y0, x1, y1) in zip(reading.characters, part.boxes_mm, strict=True):
        deepest = -z[int(y0 / pitch) : int(y1 / pitch) + 1, int(x0 / pitch) : int(x1 / pitch) + 1].min()
        # a plate waves by 10 micrometres, and a blow that leans is not as deep everywhere
        assert character.depth.max_mm == pytest.approx(deepest, abs=0.03)
    known = [c.depth for c in reading.characters if c.depth is not None]
    assert reading.depth_min_mm == min(d.min_mm for d in known)
    assert reading.depth_mean_mm == pytest.approx(np.mean([d.mean_mm for d in known]))


def test_a_shallow_character_is_flagged_by_name_where_a_rule_is_given(
    make_part: Make, reader: Readers
) -> None:
    part = make_part("K7B29", calm=True)
    shallow = shallower(part, 3, floor_mm=0.05)
    rules = (depth_rule("27CFR478.92"),)
    told = reader(depth_rules=rules, **KNOWN).read(shallow)
    assert told.text == part.text
    assert told.flags & ReadingFlag.TOO_SHALLOW
    note = told.findings[0].text
    assert note.startswith("too shallow for 27CFR478.92: 2 at place 4 0.0")
    assert note.endswith("mm (at least 0.0762)")
    depth = told.characters[3].depth
    assert depth.min_mm == pytest.approx(0.05, abs=0.01)
    # without a rule the same is felt and nothing is said
    plain = reader(**KNOWN).read(shallow)
    assert plain.flags is ReadingFlag.NONE
    assert plain.findings == ()
    assert plain.characters == told.characters
    # the text is as sure, but a mark that breaks a rule that was asked for is not accepted
    assert (plain.decision, told.decision) == (Decision.ACCEPT, Decision.REVIEW)
    assert plain.confidence == told.confidence


def test_without_heights_there_is_no_depth_and_the_reason_is_noted(
    plain: tuple[StampedPart, Reading], reader: Readers, monkeypatch: pytest.MonkeyPatch
) -> None:
    def jammed(*_: object) -> None:
        raise MapError("at a friction of 1.2 the whisker jams on the land", hint="check the friction")

    monkeypatch.setattr("recognition.touch.felt_relief", jammed)
    scan = plain[1].trace.scan
    assert scan is not None
    reading = reader().read(scan)
    assert reading.text == plain[0].text
    assert (reading.trace.relief, reading.depth_min_mm) == (None, None)
    assert reading.notes == (
        "no depth was measured: at a friction of 1.2 the whisker jams on the land; check the friction",
    )


def test_a_scan_that_shows_nothing_says_why(plain: tuple[StampedPart, Reading], reader: Readers) -> None:
    scan = plain[1].trace.scan
    still = replace(
        scan,
        sweeps=tuple(
            replace(s, moment_n_mm=np.zeros_like(s.moment_n_mm), air_n_mm=np.zeros_like(s.air_n_mm))
            for s in scan.sweeps
        ),
    )
    reading = reader().read(still)
    assert (reading.text, reading.decision) == ("", Decision.REJECT)
    assert reading.messages()[0].startswith("no characters found: the 0° sweep shows no land")


@pytest.mark.parametrize("format", ["AA9a", "re:[A-Z]{2}[0-9][a-z]"])
def test_a_place_may_hold_small_letters_only(format: str) -> None:
    """No face of the library has any, so the recogniser alone says which; a format is written as for the command."""
    part, reader = stamp("KX4a", fonts="gothic", height_mm=4.0, seed=1), Reader(format=format)
    assert reader.read(part).text == "KX4a"
    assert reader.read(part.photograph()).text == "KX4a"
