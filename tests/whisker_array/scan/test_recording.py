"""Recordings: what is written is read, what a laboratory writes is read, and nothing damaged gets through."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from unittest.mock import Mock

import h5py
import numpy as np
import pytest

from glyphs.errors import FileError
from glyphs.surface.maps import TraceDirection
from tests.support.h5_edits import Edit, attribute, drop, put, unwritten
from tests.support.scans import ROUGH_PLAN, assert_same_scan, rough_plate
from whisker_array.scan.calibration import Calibration
from whisker_array.scan.recording import load_scan, save_calibration, save_scan
from whisker_array.scan.scan import Scan, trace_scan
from whisker_array.scan.sensor import draw_sensor_chain
from whisker_array.simulation.traces import Fidelity, SampleFlag
from whisker_array.whisker.touch import default_touch

ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def scan() -> Scan:
    rng = np.random.default_rng(3)
    return trace_scan(
        rough_plate(rng), touch=default_touch(5.0), plan=ROUGH_PLAN, fidelity=Fidelity.POINTWISE,
        sensor=draw_sensor_chain(3, rng=rng), rng=rng, part_id="plate ä 7",
    )  # fmt: skip


@pytest.fixture(scope="module")
def content(scan: Scan, tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("recording") / "scan.h5"
    save_scan(scan, path)
    return path.read_bytes()


def test_round_trip_is_exact(scan: Scan, tmp_path: Path) -> None:
    calibrated = replace(scan, calibration=Calibration(np.array([1.1, 0.9, 1.0]), np.array([0.1, -0.2, 0.0])))
    for number, one in enumerate((scan, calibrated)):
        path = tmp_path / f"{number}.h5"
        save_scan(one, path)
        assert_same_scan(one, load_scan(path))
    assert sorted(p.name for p in tmp_path.iterdir()) == ["0.h5", "1.h5"]


def test_the_stated_names_are_in_the_file(recording: Path) -> None:
    with h5py.File(recording) as file:
        assert file.attrs["format"] == "tactile-marks-scan"
        assert file.attrs["format_version"] == 1
        assert file.attrs["units"] == "N*mm"
        assert file["scan/signal"].dtype == np.float32
        assert file["scan/signal"].chunks is not None
        assert file["stage/position_mm"].shape == (file["scan/signal"].shape[0], 2)
        assert set(file["channels"]) == {"name", "whisker", "axis", "units", "range"}


def test_positions_stand_for_start_and_step(scan: Scan, recording: Path) -> None:
    with h5py.File(recording, "r+") as file:
        del file["passes/start_mm"], file["passes/step_mm"]
        del file["scan/flags"], file["channels"], file.attrs["line_pitch_mm"]
    loaded = load_scan(recording)
    for a, b in zip(scan.sweeps, loaded.sweeps, strict=True):
        assert a.plan.start_mm == pytest.approx(b.plan.start_mm, abs=1e-9)
        assert a.plan.step_mm == pytest.approx(b.plan.step_mm, abs=1e-9)
    assert loaded.line_pitch_mm == pytest.approx(scan.line_pitch_mm)


def test_the_example_of_the_documentation_runs_and_reads(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = (ROOT / "docs" / "pages" / "reference" / "recordings.md").read_text(encoding="utf-8")
    example = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    assert len(example) == 1
    monkeypatch.chdir(tmp_path)
    exec(compile(example[0], "docs/pages/reference/recordings.md", "exec"), {})
    path = tmp_path / "scan.h5"
    with pytest.raises(FileError, match="calibrate"):
        load_scan(path)
    raw = load_scan(path, raw=True)
    save_calibration(path, Calibration(np.array([0.5, 0.5]), np.array([0.02, 0.02])))
    scan = load_scan(path)
    assert scan.directions == (TraceDirection.FORWARD_X, TraceDirection.BACK_X)
    assert scan.calibration is None
    assert scan.part_id == "plate 7"
    assert scan.line_pitch_mm == pytest.approx(0.125)
    assert scan.sweeps[1].plan.start_mm == pytest.approx(22.0)
    assert raw.sweeps[0].air_n_mm.shape == (8, 2, 20)
    np.testing.assert_allclose(scan.sweeps[0].moment_n_mm, scan.touch.land_moment_n_mm(), rtol=1e-4)


@pytest.mark.parametrize(("units", "factor"), [("N*mm", 1.0), ("mN*m", 1.0), ("N*m", 1000.0)])
def test_scaled_integers_in_any_unit(scan: Scan, recording: Path, units: str, factor: float) -> None:
    with h5py.File(recording, "r+") as file:
        signal = file["scan/signal"][()]
        del file["scan/signal"]
        file["scan/signal"] = np.round(signal / 1e-3).astype(np.int16)
        file.attrs.update(scale_factor=1e-3 / factor, add_offset=0.25 / factor, units=units)
    loaded = load_scan(recording)
    np.testing.assert_allclose(
        loaded.sweeps[0].moment_n_mm, scan.sweeps[0].moment_n_mm + 0.25, atol=6e-4, rtol=0
    )


@pytest.mark.parametrize("overload", [-np.inf, 9.9e37, -9.9e37, 9.91e37, -1e30])
def test_moments_that_are_no_reading_are_zero_and_flagged_or_filled_in_the_air(
    recording: Path, overload: float
) -> None:
    with h5py.File(recording, "r+") as file:
        file["scan/signal"][7, 1] = np.nan
        file["scan/signal"][8, 2] = overload
        air = file["scan/signal"][:5, 0]
        file["scan/signal"][3, 0] = overload
        file.attrs["scale_factor"] = 1e-3
    sweep = load_scan(recording).sweeps[0]
    assert sweep.air_n_mm[0, 0, 3] == pytest.approx(1e-3 * np.median(np.delete(air, 3)), abs=1e-9)
    assert sweep.moment_n_mm[0, 1, 2] == 0.0
    assert sweep.flags[0, 1, 2] & SampleFlag.OUT_OF_RANGE
    assert sweep.flags[0, 2, 3] & SampleFlag.OUT_OF_RANGE


def test_channels_may_stand_in_any_order_with_others_between(scan: Scan, recording: Path) -> None:
    with h5py.File(recording, "r+") as file:
        signal = file["scan/signal"][()]
        flags = file["scan/flags"][()]
        del file["scan/signal"], file["scan/flags"], file["channels/whisker"]
        file["scan/signal"] = np.column_stack(
            [signal[:, 2], signal[:, 0] * 0 + 9.0, signal[:, 0], signal[:, 1]]
        )
        file["scan/flags"] = np.column_stack([flags[:, 2], flags[:, 0], flags[:, 0], flags[:, 1]])
        file["channels/whisker"] = [2, -1, 0, 1]
    assert_same_scan(scan, load_scan(recording))


def test_rows_between_passes_are_not_used(scan: Scan, recording: Path) -> None:
    with h5py.File(recording, "r+") as file:
        for name in ("scan/signal", "scan/flags", "stage/pass", "stage/phase", "stage/position_mm"):
            values = file[name][()]
            extra = np.full_like(values[:4], -1 if name == "stage/pass" else 1)
            del file[name]
            file[name] = np.concatenate([values[:50], extra, values[50:]])
    assert_same_scan(scan, load_scan(recording))


def test_a_calibration_leaves_the_rest_as_it_is(scan: Scan, recording: Path, tmp_path: Path) -> None:
    with h5py.File(recording, "r+") as file:
        file["laboratory/temperature_c"] = 21.5
    calibration = Calibration(np.array([1.0, 2.0, 3.0]), np.zeros(3))
    save_calibration(recording, calibration, out=tmp_path / "copy.h5")
    assert load_scan(recording).calibration is None
    save_calibration(recording, calibration)
    for path in (recording, tmp_path / "copy.h5"):
        loaded = load_scan(path)
        assert_same_scan(replace(scan, calibration=calibration), loaded)
        assert load_scan(path, raw=True).calibration is None
        with h5py.File(path) as file:
            assert file["laboratory/temperature_c"][()] == 21.5
    with pytest.raises(FileError, match="2"):
        save_calibration(recording, Calibration(np.ones(2), np.zeros(2)))


def _uneven(file: h5py.File) -> None:
    del file["passes/start_mm"]
    file["stage/position_mm"][20:30, 0] += 3.0


BROKEN: dict[str, tuple[Edit, str]] = {
    "no format": (lambda file: file.attrs.__delitem__("format"), "not a scan"),
    "foreign format": (attribute("format", "gwy"), "not a scan"),
    "newer": (attribute("format_version", 2), "newer"),
    "version no number": (attribute("format_version", "one"), "not a number"),
    "no signal": (drop("scan/signal"), "has no dataset /scan/signal"),
    "signal a group": (
        lambda f: (f.__delitem__("scan/signal"), f.create_group("scan/signal"))[0],
        "no dataset",
    ),
    "text signal": (put("scan/signal", ["a", "b"]), "not numbers"),
    "complex signal": (put("scan/signal", np.zeros((9, 3), complex)), "not numbers"),
    "flat signal": (put("scan/signal", np.zeros(9)), "has shape"),
    "empty signal": (put("scan/signal", np.zeros((0, 3))), "is empty"),
    "sparse signal": (unwritten("scan/signal", (100, 3), chunks=(64, 3)), "never written"),
    "vast signal": (unwritten("scan/signal", (10_000_000_000, 3), chunks=(4096, 3)), "over the limit"),
    "short pass": (put("stage/pass", np.zeros(5, int)), "has shape"),
    "fractional pass": (put("stage/pass", np.zeros(5)), "not whole numbers"),
    "pass unknown": (lambda file: file["stage/pass"].__setitem__(0, 999), "pass 999"),
    "no direction": (drop("passes/direction_deg"), "direction_deg"),
    "odd direction": (lambda file: file["passes/direction_deg"].__setitem__(0, 45), "0, 90, 180 and 270"),
    "lines not finite": (lambda file: file["passes/line_mm"].__setitem__(0, np.nan), "not finite"),
    "other whiskers": (put("channels/whisker", np.array([0, 1, 1])), "number them"),
    "uneven lengths": (lambda file: file["stage/pass"].__setitem__(12, 1), "same number"),
    "uneven positions": (_uneven, "evenly"),
    "step backward": (lambda file: file["passes/step_mm"].__setitem__(slice(None), -0.1), "positive"),
    "no step": (
        lambda f: (f.__delitem__("passes/step_mm"), f.__delitem__("stage/position_mm"))[0],
        "neither",
    ),
    "lead too long": (put("passes/n_lead", np.full(9, 10_000)), "n_lead"),
    "phases exchanged": (
        lambda f: f["stage/phase"].__setitem__(slice(None), 1 - f["stage/phase"][()]),
        "exchange 0 (lifted) and 1 (touching)",
    ),
    "no rate": (lambda file: file.attrs.__delitem__("sampling_rate_hz"), "sampling_rate_hz"),
    "positions in um": (
        lambda f: f["passes/step_mm"].__setitem__(slice(None), 1e4 * f["passes/step_mm"][()]),
        "give positions in mm",
    ),
    "zero rate": (attribute("sampling_rate_hz", 0.0), "sample_rate_hz"),
    "unknown unit": (attribute("units", "lbf*in"), "lbf"),
    "volts alone": (attribute("units", "V"), "calibrate"),
    "no preload": (attribute("preload_mm", -1.0, "whisker"), "preload"),
    "no compliance": (put("whisker/compliance_mm_per_n", -np.eye(3)), "whisker is impossible"),
    "dead gain": (
        lambda f: (put("calibration/gain", np.zeros(3))(f), put("calibration/offset_n_mm", np.zeros(3))(f))[
            0
        ],
        "calibrat",
    ),
    "flags of another shape": (put("scan/flags", np.zeros((4, 3), np.uint8)), "has shape"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_every_fault_is_named_with_the_file(case: str, recording: Path) -> None:
    change, message = BROKEN[case]
    with h5py.File(recording, "r+") as file:
        if case == "lead too long":
            change = put("passes/n_lead", np.full(file["passes/direction_deg"].shape, 10_000))
        change(file)
    with pytest.raises(FileError, match=re.escape(message)) as caught:
        load_scan(recording)
    assert str(recording) in str(caught.value)
    assert caught.value.hint


def test_missing_files_and_folders_are_refused(scan: Scan, tmp_path: Path) -> None:
    with pytest.raises(FileError, match="not there"):
        load_scan(tmp_path / "none.h5")
    with pytest.raises(FileError, match="not a file"):
        load_scan(tmp_path)
    with pytest.raises(FileError, match="cannot be written"):
        save_scan(scan, tmp_path / "none" / "scan.h5")


def test_a_failed_write_leaves_the_old_file(
    scan: Scan, recording: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = recording.read_bytes()

    monkeypatch.setattr("glyphs.atomic.os.replace", Mock(side_effect=OSError(28, "No space left on device")))
    with pytest.raises(FileError, match="space"):
        save_scan(scan, recording)
    assert recording.read_bytes() == before
    assert [p.name for p in recording.parent.iterdir()] == [recording.name]
