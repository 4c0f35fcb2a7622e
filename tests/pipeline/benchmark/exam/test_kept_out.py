"""What the exam keeps out is kept out: nothing in this repository is fitted to its fonts and soils.

Every fit leaves a manifest, `NAME.fit.json`, that names its fonts, soils and editions. One manifest may name the soils
that are kept out: that of the severities, which fits the exam's own scale and no reader.
"""

from __future__ import annotations

import ast
import json
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from glyphs.camera.photo import Photo
from glyphs.soiling.soil import Soil
from glyphs.surface.maps import HeightMap
from pipeline.benchmark.exam.design import Design, design_named, editions
from pipeline.benchmark.exam.specimens import Specimen
from tests.benchmarks.edition_digest import (
    STEPS,
    arithmetic,
    digest,
    digest_of,
    digests_file,
    listed,
    listed_with,
    parts_of,
    rounded,
)

ROOT = Path(__file__).parents[4]
FLOORS = ("glyphs", "whisker_array", "recognition", "pipeline")
SCALE = "glyphs/soiling/severity.fit.json"
FITTED_DATA = {".npz", ".npy", ".onnx", ".pkl", ".joblib", ".safetensors", ".pt"}
FITS = re.compile(r"\bsklearn\b|\btorch\b|curve_fit|\.fit\.json")


def kept_out_fonts() -> set[str]:
    """Names, files and hashes of the fonts that only sections kept out have."""
    fonts: set[str] = set()
    for design in map(design_named, editions()):
        for section in design.all_sections():
            if section.kept_out:
                fonts |= {word for font in fonts_of(design, section.part) for word in marks_of(design, font)}
    return fonts


def fonts_of(design: Design, part: dict[str, tuple[str | bool | float, ...]]) -> set[str]:
    return {str(font) for font in {**design.part, **part}["font"]}


def marks_of(design: Design, font: str) -> set[str]:
    if font not in design.fonts:
        return {font}
    packaged = design.fonts[font]
    return {font, Path(packaged.file).name, packaged.sha256, packaged.sha256[:12]}


def kept_out_soils() -> set[str]:
    return {soil for name in editions() for soil in design_named(name).kept_out_soils}


def manifests() -> list[Path]:
    return [path for floor in (*FLOORS, "tests") for path in sorted((ROOT / floor).rglob("*.fit.json"))]


def fitting_code() -> list[Path]:
    paths: set[Path] = set()
    for folder in (*FLOORS, "tests/benchmarks"):
        paths |= {path for path in (ROOT / folder).rglob("*.py") if FITS.search(path.read_text("utf-8"))}
    return sorted(paths)


def named_in(path: Path) -> set[str]:
    """Every word that a text of the code or of the manifest holds."""
    text = path.read_text("utf-8")
    if path.suffix == ".py":
        constants = (node.value for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Constant))
        text = "\n".join(value for value in constants if isinstance(value, str))
    return set(re.findall(r"[\w.\-]+", text))


def offences(path: Path) -> Iterator[str]:
    fonts = kept_out_fonts()
    if path.relative_to(ROOT).as_posix() not in (SCALE,):
        fonts = fonts | kept_out_soils()
    yield from sorted(fonts & named_in(path))


def test_the_editions_keep_something_out_and_no_section_shares_it() -> None:
    assert kept_out_soils() == {"weld", "mud"}
    assert len(kept_out_fonts()) >= 10
    for design in map(design_named, editions()):
        for section in design.all_sections():
            if not section.kept_out:
                assert not fonts_of(design, section.part) & kept_out_fonts()


@pytest.mark.parametrize("path", manifests(), ids=lambda p: p.name)
def test_no_manifest_names_what_is_kept_out(path: Path) -> None:
    manifest = json.loads(path.read_text("utf-8"))
    assert {"what", "fonts", "soils", "editions"} <= set(manifest)
    assert not list(offences(path))


@pytest.mark.parametrize("path", fitting_code(), ids=lambda p: p.name)
def test_no_code_that_fits_names_what_is_kept_out(path: Path) -> None:
    assert not list(offences(path))


def test_the_known_fits_are_among_those_looked_at() -> None:
    paths = {path.relative_to(ROOT).as_posix() for path in (*manifests(), *fitting_code())}
    assert {"tests/benchmarks/soil_severity.py", SCALE} <= paths


def test_every_fitted_file_has_a_manifest() -> None:
    """Data beside the code come from a fit; and so do the weights that scikit-learn gave."""
    data = (p for floor in FLOORS for p in (ROOT / floor).rglob("*") if p.suffix in FITTED_DATA)
    fitted = [
        p for p in data if p.parent.name != "__pycache__"
    ]  # what is kept beside kernels follows from the code
    fitted += [
        p for p in fitting_code() if p.parts[len(ROOT.parts)] != "tests" and "sklearn" in p.read_text("utf-8")
    ]
    for path in fitted:
        assert path.with_suffix(".fit.json").is_file(), f"{path} has no manifest"


def test_a_kept_out_font_or_soil_would_be_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(f"{__name__}.ROOT", tmp_path)
    design = design_named("marks-exam-1-1600")
    for word in ("Manrope-Bold.ttf", design.fonts["cmtt10"].sha256[:12], "mud"):
        path = tmp_path / "some.py"
        path.write_text(f"FITTED_TO = 'gothic, {word} and more'\n", "utf-8")
        assert list(offences(path)) == [word]


SMALL = {
    "marks-exam-1-40": ("first-0-0000", "first-0.9-0001", "dotted-0.9-0000"),
    "marks-exam-2-96": ("kept-out-0-weld-0000", "kept-out-0.6-mud-0001"),
}
KINDS = (*STEPS, "pixels")


def _values() -> dict[str, np.ndarray]:
    """Every array of a part, on multiples of the steps."""
    rng = np.random.default_rng(1)
    values = {name: rng.integers(1, 900, (12, 15)) * step for name, step in STEPS.items()}
    return {**values, "pixels": rng.integers(0, 250, (12, 15, 3)).astype(np.uint8)}


def _specimen(values: dict[str, np.ndarray], truth: str = "B4") -> Specimen:
    soil = Soil(values["soft_mm"], values["hardness_mpa"], values["friction"])
    height_map = HeightMap(values["z_mm"].astype(np.float32), 0.1)
    return Specimen("one", truth, height_map, soil, lambda: Photo(values["pixels"]), None)


def _digest(values: dict[str, np.ndarray]) -> str:
    return digest(rounded(_specimen(values)), "B4")


@pytest.mark.parametrize("kind", KINDS)
def test_one_step_of_one_sample_is_another_part(kind: str) -> None:
    values = _values()
    values[kind][3, 4] += STEPS.get(kind, 1)
    assert _digest(values) != _digest(_values())


@pytest.mark.parametrize("edition", SMALL)
def test_the_list_has_parts_of_the_edition(edition: str) -> None:
    assert set(SMALL[edition]) <= set(listed(digests_file(edition))) <= set(parts_of(edition)[1])


@pytest.mark.parametrize(
    ("edition", "part"), [(name, part) for name, parts in SMALL.items() for part in parts]
)
def test_the_edition_is_what_it_was(edition: str, part: str) -> None:
    """Fails when a soil, a die, an amount or the numbering of parts was changed without listing the parts anew."""
    path = digests_file(edition)
    if listed_with(path) != arithmetic():
        pytest.skip(f"listed with {listed_with(path)}; other arithmetic rounds a sample the other way")
    assert digest_of(edition, part) == listed(path)[part]
