"""A golden part's scan, and the figures of an identified whisker with their uncertainty."""

from __future__ import annotations

import math
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

from glyphs.errors import FileError
from glyphs.surface.pieces import Piece
from pipeline.cli.design_report import fitness
from pipeline.common.golden_record import GoldenMeasure, GoldenRecord, Measured, wear_messages
from pipeline.errors import OwnFileError
from pipeline.formats.whisker_file import read_piece
from pipeline.reading import golden
from pipeline.reading.golden import measure_golden, measure_sent
from pipeline.reading.predictions import predictions
from tests.support.benches import known_whisker, recorded, worn
from tests.support.paper import is_jammed
from whisker_array.design.limits import Request
from whisker_array.identification.bench import Unknown
from whisker_array.identification.knowledge import Knowledge
from whisker_array.scan.recording import save_scan
from whisker_array.whisker.sections import WhiskerError

PIECE = Piece(angle_deg=(45.0,), land_mm=1.2)
TOML = 'kind = "pits"\nangle_deg = [45]\nland_mm = 1.2\n'


def test_tip_friction_and_preload_of_a_worn_whisker_are_found(tmp_path: Path) -> None:
    """Within 10 % of the radius, 0.02 of friction and 1 % of preload; measured errors are a third of these."""
    (tmp_path / "golden.toml").write_text(TOML)
    save_scan(recorded(PIECE, touch=worn(0.1, 1.1), friction=0.3, whiskers=1), tmp_path / "a.h5")
    found = measure_golden(tmp_path / "a.h5", tmp_path / "golden.toml")
    assert found[GoldenMeasure.RADIUS].value == pytest.approx(0.1, rel=0.1)
    assert found[GoldenMeasure.FRICTION].value == pytest.approx(0.3, abs=0.02)
    assert found[GoldenMeasure.PRELOAD].value == pytest.approx(1.1, rel=0.01)
    assert all(0.0 <= one.sd < 0.05 for one in found.values())


def _scan(**changed: float) -> GoldenRecord:
    usual = {"gain": 1.0, "zero_lands": 0.01, "tip_radius_mm": 0.06, "friction": 0.2, "preload_mm": 1.0}
    measures = {GoldenMeasure(name): Measured(value, 0.002) for name, value in {**usual, **changed}.items()}
    return GoldenRecord(datetime(2026, 11, 23, tzinfo=UTC), "", False, measures)


def test_wear_is_told_beyond_its_limit_and_what_chance_does_is_not() -> None:
    new = _scan()
    assert wear_messages(new, new) == ()
    assert wear_messages(_scan(tip_radius_mm=0.08, gain=1.04, friction=0.28), new) == ()
    assert wear_messages(_scan(tip_radius_mm=0.1), new) == (
        "the tips are worn: radius 0.100 mm, 0.060 before; change the whiskers",
    )
    told = wear_messages(_scan(gain=0.9, zero_lands=0.08, friction=0.4, preload_mm=1.2), new)
    assert [line.split("; ")[1] for line in told] == [
        "look for a loose clamp or a bent whisker, then calibrate",
        "let the amplifier warm up, then calibrate",
        "clean the golden part and the tips",
        "set the stage's height",
    ]


@pytest.mark.parametrize(
    ("written", "said"),
    [
        ('kind = "hole"', "says kind = 'hole'"),
        ('kind = "pits"\ndepht_mm = 1', "has the unknown key depht_mm"),
        ('kind = "pits"\nangle_deg = [95]', "give walls of 0 to 90 degrees"),
        ('kind = "ball"\ndepth_mm = 9', "more than half of a ball"),
        ("kind =", "is not TOML"),
    ],
)
def test_a_piece_that_cannot_be_is_refused_by_its_file(tmp_path: Path, written: str, said: str) -> None:
    (tmp_path / "piece.toml").write_text(written)
    with pytest.raises(FileError, match=r"piece\.toml") as refused:
        read_piece(tmp_path / "piece.toml")
    assert said in str(refused.value)


def test_only_the_scan_is_the_senders_fault(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    scan, relief = tmp_path / "scan-1.h5", Path("golden.toml")
    scan.write_bytes(b"rubbish")
    with pytest.raises(FileError, match=r"^a\.h5: ") as refused:
        measure_sent(scan, "a.h5", relief)
    assert not isinstance(refused.value, OwnFileError)
    monkeypatch.setattr(golden, "read_scan", lambda _: recorded(PIECE))
    with pytest.raises(OwnFileError, match=r"^golden\.toml: "):
        measure_sent(scan, "a.h5", relief)

    monkeypatch.setattr(golden, "read_scan", Mock(side_effect=MemoryError))
    with pytest.raises(OwnFileError, match="memory"):
        measure_sent(scan, "a.h5", relief)


WHISKER, TOUCH, KNOWN = known_whisker()
REQUEST = Request(
    alpha_rad=(math.radians(20.0), math.radians(45.0)), mu=(0.1, 0.3), depth_mm=0.3, character_height_mm=5.0
)


def of(known: Knowledge) -> dict[str, tuple[float, float]]:
    told = predictions(WHISKER, TOUCH, known, more=fitness(REQUEST))
    return {one.what: (one.value, one.sd) for one in told}


def test_spread_is_that_of_whiskers_drawn_from_what_is_known() -> None:
    """First order against 2,000 draws: within 10 %, three times what so many draws leave of a standard deviation."""
    rng = np.random.default_rng(5)
    drawn = rng.multivariate_normal(np.zeros(len(KNOWN.names)), KNOWN.covariance, size=2000)
    by_name = dict(zip(KNOWN.names, drawn.T, strict=True))
    moments = []
    for k in range(len(drawn)):
        whisker = replace(
            WHISKER,
            l1_mm=WHISKER.l1_mm + by_name[Unknown.L1][k],
            l2_mm=WHISKER.l2_mm + by_name[Unknown.L2][k],
            l3_mm=WHISKER.lowered_mm + by_name[Unknown.L3][k],
            beta_rad=WHISKER.beta_rad + math.radians(by_name[Unknown.BETA][k]),
        )
        touch = replace(
            TOUCH,
            tip=whisker.tip_model(),
            preload_mm=TOUCH.preload_mm + by_name[Unknown.PRELOAD][k],
            friction=TOUCH.friction + by_name[Unknown.FRICTION][k],
        )
        moments.append(abs(touch.land_moment_n_mm()) * (1.0 + by_name[Unknown.STIFFNESS][k]))
    value, sd = of(KNOWN)["moment of the land, N mm"]
    assert value == pytest.approx(abs(TOUCH.land_moment_n_mm()))
    assert sd == pytest.approx(np.std(moments), rel=0.1)


def test_the_steepest_wall_is_where_the_whisker_jams() -> None:
    steepest, _ = of(KNOWN)["steepest wall it climbs, deg"]
    slopes = np.tan(np.radians([steepest - 0.1, steepest + 0.1]))
    np.testing.assert_array_equal(is_jammed(slopes, TOUCH.friction, TOUCH.tip), [False, True])


def test_a_whisker_that_jams_in_the_job_is_no_number() -> None:
    steep = replace(REQUEST, alpha_rad=(math.radians(30.0), math.radians(85.0)), mu=(0.1, 0.9))
    told = {one.what: one for one in predictions(WHISKER, TOUCH, KNOWN, more=fitness(steep))}
    assert math.isnan(told["worst edge contrast"].value)
    assert math.isfinite(told["moment of the land, N mm"].value)


@pytest.mark.parametrize(
    ("names", "covariance", "says"),
    [
        ((Unknown.L1, Unknown.L1), np.eye(2), "or one twice"),
        ((Unknown.PLAY,), np.eye(1), "or one twice"),
        ((Unknown.L1,), np.eye(2), r"must be \(1, 1\)"),
        ((Unknown.L1,), np.array([[np.nan]]), "must be finite"),
        ((Unknown.L1,), np.array([[-1.0]]), "negative variance"),
    ],
)
def test_knowledge_that_cannot_be_is_refused(
    names: tuple[Unknown, ...], covariance: np.ndarray, says: str
) -> None:
    with pytest.raises(WhiskerError, match=says):
        Knowledge(names, covariance)
