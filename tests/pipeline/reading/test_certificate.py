"""Certificates in files, for what they hold, and parts that are unlike the certified ones."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from glyphs.errors import FileError
from pipeline.common.settings import ReadSettings, SettingsError
from pipeline.reading.certificate import acceptance_of, certificate_of, load_certificate
from pipeline.reading.certificate_statistics import LEAST_PARTS, KindOfParts, unlike
from pipeline.reading.drift import EVERY, DriftWatch
from pipeline.reading.readers import open_reader
from recognition.decide.measures import roughness
from recognition.decide.score import Measure
from tests.support.certificates import a_certificate, measured, written

SETTINGS = ReadSettings(format=("AA99",))


def test_a_certificate_comes_back_as_it_was_written(tmp_path: Path) -> None:
    path = written(tmp_path / "c.json", SETTINGS)
    assert load_certificate(path) == a_certificate(SETTINGS)
    assert (
        "Of serials that are accepted from confidence 0.99, at most 1 in 10 are wrong: shown with "
        in a_certificate().describe()
    )


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"bound": 0.0001}, "is at most"),
        ({"risk": 0.01}, "is at most"),
        ({"wrong": 3}, "is at most"),
        ({"accepted": 50}, "cannot be"),
        ({"threshold": 0.9}, "not the one that its tests certify"),
        ({"threshold": "0.99"}, "threshold: Input should be a valid number"),
        ({"vouched_by": "me"}, "vouched_by"),
        ({"format_version": 2}, "format version 2"),
    ],
)
def test_a_file_that_was_changed_is_refused(change: dict[str, Any], says: str, tmp_path: Path) -> None:
    path = written(tmp_path / "c.json")
    path.write_text(json.dumps({**json.loads(path.read_text(encoding="utf-8")), **change}), encoding="utf-8")
    with pytest.raises(FileError, match=says) as caught:
        load_certificate(path)
    assert "tactile-marks certify" in caught.value.hint


def test_it_holds_for_the_settings_that_it_was_made_with(tmp_path: Path) -> None:
    path = written(tmp_path / "c.json", SETTINGS)
    # senses stand in the certificate itself, and the unit is the file's
    same = SETTINGS.model_copy(update={"certificate": path, "mode": "tactile", "unit": "um"})
    assert certificate_of(same) is not None
    found = open_reader(same).settings.certified
    assert found is not None
    assert (found.confidence, found.sources) == (0.99, ("tactile",))
    for changed in ({"orientation": "upright"}, {"rows": "top-first"}, {"format": ("A999",)}):
        other = same.model_copy(update=changed)
        with pytest.raises(SettingsError, match=rf"made with other settings.*{next(iter(changed))}"):
            certificate_of(other)
    # a part with a format of its own, in the midst of a run
    nothing = acceptance_of(other)
    assert nothing is not None
    assert nothing.sources == ()
    assert acceptance_of(SETTINGS) is None


def test_a_lexicon_counts_by_what_it_holds(tmp_path: Path) -> None:
    for name, text in (("a.txt", "AB12\n"), ("same.txt", "AB12\n"), ("other.txt", "AB13\n")):
        (tmp_path / name).write_text(text, encoding="utf-8")
    settings = ReadSettings(lexicon=tmp_path / "a.txt")
    settings = settings.model_copy(update={"certificate": written(tmp_path / "c.json", settings)})
    assert certificate_of(settings.model_copy(update={"lexicon": tmp_path / "same.txt"})) is not None
    with pytest.raises(SettingsError, match="lexicon"):
        certificate_of(settings.model_copy(update={"lexicon": tmp_path / "other.txt"}))


def test_it_does_not_hold_for_other_networks(tmp_path: Path) -> None:
    versions = {**a_certificate().versions, "find/finder.onnx": "another"}
    settings = ReadSettings(certificate=written(tmp_path / "c.json", versions=versions))
    for use in (certificate_of, acceptance_of):
        with pytest.raises(SettingsError, match=r"is not valid for this program \(find/finder.onnx"):
            use(settings)


def test_parts_that_change_are_told_of_once_until_they_are_alike_again() -> None:
    watch = DriftWatch(a_certificate())
    told = [watch.add("tactile", part) for part in measured(2 * EVERY, seed=2)]
    assert not any(told)
    assert watch.message() == ""
    told = [watch.add("tactile", part) for part in measured(10 * EVERY, rough_um=3.0, seed=3)]
    assert sum(told) == 1
    assert "fine roughness" in watch.message()
    assert "certify again" in watch.first
    told = [watch.add("tactile", part) for part in measured(10 * EVERY, seed=4)]
    assert not any(told)
    assert watch.message() == ""


def test_only_parts_of_the_certified_senses_are_compared() -> None:
    watch = DriftWatch(a_certificate())
    for part in measured(3 * EVERY, rough_um=9.0):
        assert not watch.add("vision", part)
        assert not watch.add("tactile", {})
    assert not watch.compare()
    assert watch.parts == 0


def parts(n: int, seed: int, *, rough_um: float = 1.0) -> list[dict[Measure, float]]:
    rng = np.random.default_rng(seed)
    return [
        {
            Measure.CONFIDENCE: float(np.round(1.0 - 0.1 * rng.beta(1, 8), 6)),
            Measure.FINE: float(rough_um * rng.lognormal(0.0, 0.2)),
        }
        for _ in range(n)
    ]


def test_rougher_parts_are_unlike_and_it_says_in_what() -> None:
    kind = KindOfParts.of(parts(40, 1))
    (found,) = unlike(kind, parts(20, 2, rough_um=3.0))
    assert found.measure is Measure.FINE
    assert found.certified == pytest.approx(1.0, rel=0.15)
    assert found.now == pytest.approx(3.0, rel=0.2)
    assert "fine roughness" in str(found)


def test_too_few_parts_are_not_judged() -> None:
    kind = KindOfParts.of(parts(40, 1))
    assert not unlike(kind, parts(LEAST_PARTS - 1, 2, rough_um=9.0))
    assert not KindOfParts.of(parts(LEAST_PARTS - 1, 1)).values


def test_parts_of_the_same_kind_are_hardly_ever_called_unlike() -> None:
    # 300 tests at 1 in 10,000: one false alarm has a chance of 3 %, two of 0.04 %
    alarms = sum(bool(unlike(KindOfParts.of(parts(60, 2 * k)), parts(40, 2 * k + 1))) for k in range(300))
    assert alarms <= 1


def test_of_many_parts_quantiles_are_kept() -> None:
    kind = KindOfParts.of(parts(3000, 1), most_kept=200)
    assert {len(values) for values in kind.values.values()} == {200}
    assert not unlike(kind, parts(200, 2))
    assert unlike(kind, parts(200, 3, rough_um=1.3))


def test_values_that_are_no_summary_are_refused() -> None:
    with pytest.raises(ValueError, match="not finite"):
        KindOfParts({Measure.FINE: (0.0, float("nan"))})
    with pytest.raises(ValueError, match="are not ascending"):
        KindOfParts({Measure.FINE: (1.0, 0.0)})


def test_roughness_is_that_of_the_land_and_not_of_the_marks() -> None:
    rng = np.random.default_rng(5)
    land = rng.normal(0.0, 2.0, (200, 300))
    tilted = land + np.arange(300) * 0.7
    tilted[80:120, ::30] -= 200.0
    # a median of 1e5 dependent values; grooves over 0.7 % of the samples add a little
    assert roughness(tilted, 2) == pytest.approx(2.0, rel=0.05)
    tilted[:, 250:] = np.nan
    assert roughness(tilted, 2) == pytest.approx(2.0, rel=0.05)
    assert np.isnan(roughness(np.zeros((2, 2)), 4))
