"""The command that fits confidences: what it learns from, what it leaves out, and what it writes."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from pipeline.benchmark.exam.condition import Level
from pipeline.benchmark.trials.journal import Trial, TrialJournal
from recognition.decision.part_measures import Measure
from tests.benchmarks import fit_confidence
from tests.benchmarks.fit_confidence import KnownReading, fit, known_readings, left_out, loss

DESIGN = {
    "name": "made-up",
    "kept_out_soils": ["tar"],
    "section": [{"name": "own", "kept_out": False}, {"name": "else", "kept_out": True}],
}


USED = {
    "tactile": {"slope": 0.5, "bias": 0.0},
    "fused": {"slope": 1.0, "bias": 0.0, "ground": {Measure.FINE_SHARE.name: [0.0, 0.5]}},
}
"""By which the benchmark's confidences came from beliefs; of the camera they are the beliefs."""


ROUGH = Measure.FINE_SHARE


def known(belief: float, right: bool, soil: str, font: str, **options: object) -> KnownReading:
    given = {"kept_out": False, "measures": {}, "accepted": belief > 0.9, **options}
    return KnownReading("tactile", belief, right, soil, font, 0.3, **given)  # type: ignore[arg-type]


def reading(k: int, rng: np.random.Generator, soil: str = "mould", **options: object) -> KnownReading:
    """A belief, right as often as the square root of its odds says."""
    odds = float(rng.normal(1.0, 3.0))
    right = bool(rng.random() < 1.0 / (1.0 + np.exp(-0.5 * odds)))
    return known(1.0 / (1.0 + np.exp(-odds)), right, soil, f"font{k % 3}", **options)


@pytest.fixture
def exam(tmp_path: Path) -> Path:
    """Parts of two soils, a third that is kept out and a section that is, read by every mode."""
    journal = TrialJournal.open(tmp_path / "run", {"parts": DESIGN, "calibrations": USED})
    rng = np.random.default_rng(8)
    for k in range(480):
        soil = ("mould", "ash", "tar")[k % 3]
        section = ("own", "else")[k // 3 % 2]
        one = reading(k, rng, soil)
        levels: dict[str, Level] = {"soil": soil, "font": f"{section}{k % 4}"}
        text = "A1" if one.right else "B1"
        trials = [
            Trial(
                f"{section}-{soil}-{k}", k, levels, mode, "A1", text,
                decision="accept", confidence=one.belief, measures={ROUGH.value: k / 480},
            )
            for mode in fit_confidence.SOURCES
        ]  # fmt: skip
        nothing = Trial(f"{section}-{soil}-{k}", k, levels, "easyocr-photo", "A1", "", confidence=0.0)
        journal.add(trials[0].part, (*trials, nothing))
    journal.close()
    return tmp_path / "run"


def test_readings_come_back_with_the_belief_behind_their_confidence(exam: Path) -> None:
    found = list(known_readings(exam))
    assert len(found) == 3 * 480
    assert all(one.kept_out == (one.soil == "tar" or one.font.startswith("else")) for one in found)
    (trial, *_), *_ = TrialJournal.read(exam).done.values()
    odds = trial.confidence / (1.0 - trial.confidence)
    assert found[0].belief == pytest.approx(odds**2 / (1.0 + odds**2))
    assert found[1].belief == pytest.approx(trial.confidence)
    last = found[-1]
    widths = 479 / 480 / 0.5 - 1.0
    odds = last.belief / (1.0 - last.belief)
    said = 1.0 / (1.0 + odds ** (-1.0 / (1.0 + widths)))
    *_, (*_, fused, _) = TrialJournal.read(exam).done.values()
    assert (last.source, said) == ("fused", pytest.approx(fused.confidence))


def test_who_is_off_the_ground_of_the_others_is_believed_less() -> None:
    rng = np.random.default_rng(6)
    fair = [reading(k, rng, measures={"FINE_SHARE": k / 400}) for k in range(400)]
    near, far = (known(0.999, True, "ash", "font0", measures={"FINE_SHARE": rough}) for rough in (0.5, 3.0))
    ash = next(left_out([*fair, *[near] * 30, *[far] * 30], "soil"))
    assert (ash.off[:30] == 0.0).all()
    assert (ash.off[30:] > 1.9).all()  # 3 of a range from 0 to 0.99
    assert ash.said[0] > 0.95
    assert 0.5 < ash.said[-1] < 0.8


def test_a_soil_is_judged_by_the_others_and_by_nothing_kept_out() -> None:
    rng = np.random.default_rng(5)
    fair = [reading(k, rng) for k in range(400)]
    # what is left out and what is kept out lie: sure of what is wrong
    lies = [known(0.99, False, "ash", "font0") for _ in range(200)]
    kept = [known(0.99, False, "tar", "font9", kept_out=True) for _ in range(200)]
    alone, beside = next(left_out([*fair, *lies], "soil")), next(left_out([*fair, *lies, *kept], "soil"))
    assert alone.name == beside.name == "ash"
    assert (alone.said == beside.said).all()
    assert alone.said[0] > 0.8  # the square root of 99 to 1
    assert not alone.right.any()


def test_the_fit_names_what_it_rests_on_and_nothing_kept_out(
    exam: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "calibration.fit.json"
    monkeypatch.setattr(fit_confidence, "CALIBRATED", path)
    fit_confidence.main([str(exam), "--threshold", "0.8", "--write"])
    made = json.loads(path.read_text(encoding="utf-8"))
    assert made["soils"] == ["ash", "mould"]
    assert made["editions"] == {"made-up": 480}
    assert {font[:3] for font in made["fonts"]} == {"own"}
    assert made["readings"] == dict.fromkeys(fit_confidence.SOURCES, 160)
    assert set(made["calibrations"]["vision"]) == {"slope", "bias", "ground"}
    low, high = made["calibrations"]["vision"]["ground"][ROUGH.name]
    assert low == 0.0
    assert 0.98 < high < 1.0
    said = capsys.readouterr().out
    assert "| tar | 160 |" in said
    assert "| each soil | " in said
    assert "| all soils | " in said


def test_the_calibration_by_which_texts_were_drawn_comes_back() -> None:
    rng = np.random.default_rng(3)
    odds = rng.normal(1.0, 3.0, 20_000)
    right = rng.random(odds.size) < 1.0 / (1.0 + np.exp(-(0.6 * odds - 0.5)))
    beliefs = 1.0 / (1.0 + np.exp(-odds))
    made = fit([known(float(b), bool(r), "ash", "font0") for b, r in zip(beliefs, right, strict=True)])
    # some five standard errors of 20,000 readings
    assert made.slope == pytest.approx(0.6, abs=0.04)
    assert made.bias == pytest.approx(-0.5, abs=0.1)
    said = np.array([made.confidence(float(belief)) for belief in beliefs])
    assert said.mean() == pytest.approx(right.mean(), abs=1e-3)
    assert loss(said, right) < loss(beliefs, right)


def test_too_few_wrong_ones_fit_nothing() -> None:
    with pytest.raises(ValueError, match="9 wrong readings are too few"):
        fit([known(0.9, k >= 9, "ash", "font0") for k in range(100)])
