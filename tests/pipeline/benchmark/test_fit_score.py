"""The command that fits the score: what it learns from, what it leaves out, and what it writes."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from pipeline.benchmark.exam.condition import Level
from pipeline.benchmark.trials.journal import Trial, TrialJournal
from recognition.decide.score import Measure, share
from tests.benchmarks import fit_score
from tests.benchmarks.fit_score import KnownReading, fit, known_readings, left_out

DESIGN = {
    "name": "made-up",
    "kept_out_soils": ["tar"],
    "section": [{"name": "own", "kept_out": False}, {"name": "else", "kept_out": True}],
}
ROUGH = Measure.FINE_SHARE


def known(odds: float, right: bool, soil: str, font: str, **options: object) -> KnownReading:
    given = {"kept_out": False, "measures": {Measure.ODDS: odds}, **options}
    return KnownReading("tactile", right, "own", soil, font, 0.3, **given)  # type: ignore[arg-type]


def reading(rng: np.random.Generator, soil: str = "mould", *, slope: float = 0.5) -> KnownReading:
    """A text, right as often as so much of its log odds says."""
    odds = float(rng.normal(1.0, 3.0))
    return known(odds, bool(rng.random() < share(slope * odds)), soil, "font0")


@pytest.fixture
def exam(tmp_path: Path) -> Path:
    """Parts of two soils, a third that is kept out and a section that is, read by every mode."""
    journal = TrialJournal(tmp_path / "run", {"parts": DESIGN})
    rng = np.random.default_rng(8)
    for k in range(480):
        soil = ("mould", "ash", "tar")[k % 3]
        section = ("own", "else")[k // 3 % 2]
        one = reading(rng, soil)
        levels: dict[str, Level] = {"soil": soil, "font": f"{section}{k % 4}"}
        measures = {name.value: value for name, value in one.measures.items()} | {ROUGH.value: k / 480}
        trials = [
            Trial(
                f"{section}-{soil}-{k}", k, levels, mode, "A1", "A1" if one.right else "B1",
                decision="review" if k == 0 else "accept", confidence=0.99, measures=measures,
            )
            for mode in fit_score.SOURCES
        ]  # fmt: skip
        nothing = Trial(f"{section}-{soil}-{k}", k, levels, "easyocr-photo", "A1", "", confidence=0.0)
        journal.keep(trials[0].part, (*trials, nothing))
    journal.close()
    return tmp_path / "run"


def test_readings_come_back_with_what_is_known_of_them(exam: Path) -> None:
    found = list(known_readings(exam))
    assert len(found) == 3 * 480
    assert all(one.kept_out == (one.soil == "tar" or one.font.startswith("else")) for one in found)
    assert found[0].broken
    assert not found[-1].broken
    assert found[-1].measures[ROUGH] == pytest.approx(479 / 480)


def test_the_weights_by_which_texts_were_drawn_come_back() -> None:
    rng = np.random.default_rng(3)
    readings = []
    for _ in range(20_000):
        odds, rough = float(rng.normal(1.0, 3.0)), float(rng.uniform(0.0, 1.0))
        right = bool(rng.random() < share(0.6 * odds - 0.5 - 2.0 * max(rough - 0.5, 0.0)))
        readings.append(known(odds, right, "ash", "font0", measures={Measure.ODDS: odds, ROUGH: rough}))
    made = fit(readings)
    # some five standard errors of 20,000 readings
    assert made.slope == pytest.approx(0.6, abs=0.04)
    assert made.bias == pytest.approx(-0.5, abs=0.12)
    rough = made.terms[ROUGH]
    assert rough.nats(0.9) - rough.nats(0.6) == pytest.approx(-0.6, abs=0.12)
    said = np.array([made.probability(one.measures) for one in readings])
    assert said.mean() == pytest.approx(np.mean([one.right for one in readings]), abs=2e-3)


def test_a_quantity_never_counts_the_wrong_way() -> None:
    rng = np.random.default_rng(4)
    readings = []
    for _ in range(2000):
        odds, rough = float(rng.normal(1.0, 3.0)), float(rng.uniform(0.0, 1.0))
        right = bool(rng.random() < share(odds + 3.0 * rough))  # rougher is better here, by chance
        readings.append(known(odds, right, "ash", "font0", measures={Measure.ODDS: odds, ROUGH: rough}))
    assert ROUGH not in fit(readings).terms


def test_a_soil_is_judged_by_the_others_and_by_nothing_kept_out() -> None:
    rng = np.random.default_rng(5)
    fair = [reading(rng) for _ in range(400)]
    # what is left out and what is kept out lie: sure of what is wrong
    lies = [known(4.6, False, "ash", "font0") for _ in range(200)]
    kept = [known(4.6, False, "tar", "font9", kept_out=True) for _ in range(200)]
    alone, beside = next(left_out([*fair, *lies], "soil")), next(left_out([*fair, *lies, *kept], "soil"))
    assert alone.name == beside.name == "ash"
    assert (alone.said == beside.said).all()
    assert alone.said[0] > 0.8
    assert not alone.right.any()


def test_the_fit_names_what_it_rests_on_and_nothing_kept_out(
    exam: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "score.fit.json"
    monkeypatch.setattr(fit_score, "FITTED", path)
    fit_score.main(exam, threshold=0.8, write=True)
    made = json.loads(path.read_text(encoding="utf-8"))
    assert made["soils"] == ["ash", "mould"]
    assert {font[:3] for font in made["fonts"]} == {"own"}
    assert made["editions"] == {"run": 480}
    assert "ODDS" in made["scores"]["vision"]["terms"]
    said = capsys.readouterr().out
    assert "| tar | 160 |" in said
    assert "| each soil | " in said


def test_readings_that_are_all_right_fit_nothing() -> None:
    with pytest.raises(ValueError, match="right and wrong readings"):
        fit([known(2.0, True, "ash", "font0") for _ in range(100)])
