"""Parts that were measured askew, with gaps, or by a bench with a fault."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from glyphs.stamping.stamp import StampedPart
from glyphs.surface.maps import HeightMap
from recognition.decide.decision import BROKEN, Decision, ReadingFlag, bench_faults
from recognition.decide.depth_rules import least_depth
from recognition.decide.reading import Reading
from recognition.marks.no_depth import NoDepth
from recognition.reader import Reader
from recognition.touch import bench_findings
from tests.support.bench_faults import recorded
from tests.support.felt import felt, tilted
from whisker_array.estimation.faults import Fault, FaultKind
from whisker_array.scan.scan import Scan
from whisker_array.simulation.traces import Fidelity

# ----------------------------------------------------------------------------------------------------------- mounted

Make = Callable[..., StampedPart]
READER = Reader(fonts=["gothic"], format="A9A99", height_mm=5.0, depth_rules=(least_depth(0.1),))


@pytest.fixture(scope="module")
def part(make_part: Make) -> StampedPart:
    return make_part("K7B29", calm=True, pitch_mm=0.1)


@pytest.fixture(scope="module")
def level(part: StampedPart) -> Reading:
    return READER.read(part.height_map)


def depths(reading: Reading) -> list[float]:
    return [c.depth.mean_mm for c in reading.characters if c.depth is not None]


@pytest.mark.parametrize(("deg", "azimuth_deg"), [(30.0, 0.0), (45.0, 60.0)])
def test_depths_of_a_tilted_part_are_those_of_a_level_one(
    part: StampedPart, level: Reading, deg: float, azimuth_deg: float
) -> None:
    seen, _ = tilted(part.height_map, deg, azimuth_deg)
    reading = READER.read(seen)
    assert (reading.text, reading.decision) == ("K7B29", Decision.ACCEPT)
    assert reading.height_mm == pytest.approx(level.height_mm, rel=0.02)
    assert depths(reading) == pytest.approx(depths(level), abs=0.006)


def test_a_part_with_single_samples_missing_is_read(part: StampedPart, level: Reading) -> None:
    gone = np.random.default_rng(0).random(part.height_map.shape) < 0.25
    reading = READER.read(HeightMap(np.where(gone, np.nan, part.height_map.z_mm), part.height_map.pitch_mm))
    assert (reading.text, reading.decision) == ("K7B29", Decision.ACCEPT)
    assert not reading.flags & ReadingFlag.DROPOUTS
    (note,) = reading.notes
    assert note.startswith(("24.", "25."))
    assert "filled from their neighbours" in note
    assert depths(reading) == pytest.approx(depths(level), abs=0.01)
    assert level.notes == ()


def clipped(scan: Scan, most: float) -> Scan:
    """A recording of a converter whose range ends at a share of the land's moment."""
    end = most * abs(scan.touch.land_moment_n_mm())
    sweeps = (
        replace(s, moment_n_mm=np.clip(s.moment_n_mm, -end, end), air_n_mm=np.clip(s.air_n_mm, -end, end))
        for s in scan.sweeps
    )
    return replace(scan, sweeps=tuple(sweeps))


@pytest.mark.parametrize("noisy", [False, True])
def test_a_clipped_recording_is_named_and_has_no_depth(part: StampedPart, noisy: bool) -> None:
    scan = felt(part.height_map, fidelity=Fidelity.POINTWISE)
    scan = recorded(scan, rng=np.random.default_rng(0)) if noisy else scan
    sound = READER.read(scan)
    assert len(depths(sound)) == 5
    assert not sound.flags & ReadingFlag.BENCH_FAULTY
    # between the land and the floors of the marks
    reading = READER.read(clipped(scan, 0.92))
    assert reading.text == "K7B29"
    assert [c.no_depth for c in reading.characters] == [NoDepth.SATURATED] * 5
    assert reading.decision is Decision.REVIEW
    assert any(text.startswith("saturated signal: ") for text in reading.messages())
    assert any("(lower the gain, scan it again)" in text for text in reading.messages())
    assert not reading.flags & ReadingFlag.TOO_SHALLOW


# ---------------------------------------------------------------------------------------------------- touch findings


@pytest.mark.parametrize("kind", FaultKind)
@pytest.mark.parametrize("whisker", [None, 1])
def test_only_channels_at_wrong_places_send_a_part_to_review(kind: FaultKind, whisker: int | None) -> None:
    findings = bench_findings([Fault(kind, "what and where", whisker)])
    assert bench_faults(findings) == ("what and where",)
    assert bool(findings[0].flag & BROKEN) == (kind in (FaultKind.EXCHANGED, FaultKind.DOUBLED))
