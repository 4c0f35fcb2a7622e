"""Make the library of faces: choose faces by k-medoids in the recogniser's features, and predict their prototypes::

    python -m recognition.learning.face_library FONTS MORE_FONTS --licences licences.tsv --work WORK
    python -m recognition.learning.face_library FONTS MORE_FONTS --same-faces --work WORK

    fonts --photograph, high lamp--> features --similarity of faces--> medoids --touch, five lamps--> prototypes

A face is as similar to another as the mean cosine of their characters. Faces are chosen one by one and then exchanged,
so that the first 10 or 40 of the library are a smaller library.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from glyphs.errors import MarksError
from glyphs.fonts.outlines import BUILTIN_FONTS, load_font
from glyphs.fonts.serials import SIGNS
from glyphs.stamping.faces import default_die
from recognition.glyph_match.face_library import LIBRARY, Sense
from recognition.glyph_match.predicted import (
    CANONICAL_HEIGHT_MM,
    ideal_plate,
    line_of,
    lit_views,
    predict_templates,
    template_key,
)
from recognition.glyph_match.prototypes import (
    LIGHTS,
    FeatureMap,
    Prototypes,
    half_steps,
    own_windows,
    plate_columns,
)
from recognition.language.remainders import ALPHANUMERIC
from recognition.learning.training_fonts import family, is_learnable
from recognition.recogniser.recogniser import Features, features_of
from whisker_array.whisker.touch import default_touch

CHARS = ALPHANUMERIC + SIGNS
COMPARED = "0123456789ABCEGJKMQRSW"
"""Characters by which faces are compared."""
FREE = re.compile(r"(SIL[- ])?OFL|sil-1|SIL Open|Apache|public-domain|CC0", re.I)
Floats = NDArray[np.float64]
Plate = tuple[Features, Floats, Features]
"""Features of a plate, columns of its characters, and half the widths of their windows."""


def candidates(
    folders: Iterable[Path], licences: Mapping[str, str], *, most_of_a_family: int = 2
) -> list[Path]:
    """Font files that may be in the library: upright ones with a free licence, a few of each family."""
    families: dict[str, list[Path]] = {}
    files = (
        path for folder in folders for path in folder.rglob("*") if path.suffix in (".ttf", ".otf", ".woff")
    )
    for path in sorted(files, key=lambda path: (not _USUAL.search(path.stem), path.stem)):
        free = FREE.match(licences.get(path.name, ""))
        letters = is_learnable(path) or path.stem.startswith("DSEG14")
        if free and letters and not _OTHER_STYLES.search(path.stem):
            families.setdefault(family(path)[:8], []).append(path)
    return sorted(path for files in families.values() for path in files[:most_of_a_family])


_USUAL = re.compile(r"regular|bold$|-[47]00-normal", re.I)
_OTHER_STYLES = re.compile(
    r"italic|oblique|slanted|inclined|outline|script|lobster|leckerli|lemonada|breip|averia|tomson|blankenburg|cardo"
    r"|gentium-i|^noto(?!sans-|serif-|mono)|^stix(?!general)",
    re.I,
)


def face_plates(path: str, work: Path, *, chars: str, senses: bool) -> tuple[list[str], list[Plate]]:
    """Characters of a face and its plates, kept in `work`, by touch and lamps. Raises FontError."""
    stored = work / f"{Path(path).stem}-{'all' if senses else 'high'}.npz"
    if not stored.exists():
        font = load_font(path)
        chars = "".join(char for char in chars if char in font.glyphs)
        die = default_die(CANONICAL_HEIGHT_MM, font=font)
        plate = ideal_plate(font, chars, die)
        views = list(lit_views(plate, LIGHTS if senses else LIGHTS[-1:]))
        if senses:
            touch = default_touch(CANONICAL_HEIGHT_MM)
            key = template_key(font, touch, height_mm=CANONICAL_HEIGHT_MM)
            views.insert(0, predict_templates(font, chars, key).view)
        line = line_of(plate.middles_mm)
        features = np.stack([features_of(view.strip(line)) for view in views]).astype(np.float16)
        np.savez(
            stored, features=features, columns=plate_columns(plate.middles_mm),
            half=half_steps(plate.half_width), chars=np.array(list(chars)),
        )  # fmt: skip
    with np.load(stored) as file:
        plates = [
            (features.astype(np.float32), file["columns"], file["half"]) for features in file["features"]
        ]
        return file["chars"].tolist(), plates


def fit_map(plates: Sequence[Plate], *, of_step: int, of_window: int) -> FeatureMap:
    """Fit the map of windows to plates: their features, columns and half widths."""
    sums, rows = np.zeros((3, len(plates[0][0]))), plates[0][0].shape[1]
    for features, _, _ in plates:
        sums += [(np.float64(features) ** power).sum(axis=(1, 2)) for power in (0, 1, 2)]
    mean, square = sums[1] / sums[0], sums[2] / sums[0]
    spread = np.sqrt(np.maximum(square - mean**2, 0.0)) + 1e-3
    mean, spread = (np.repeat(values, rows).astype(np.float32) for values in (mean, spread))
    identity = FeatureMap(
        mean, spread, np.eye(len(mean), dtype=np.float32), np.zeros((0, 0), dtype=np.float32)
    )
    moment = np.zeros((len(mean), len(mean)))
    for features, columns, half in plates:
        shown = own_windows(features, columns, half, identity).reshape(-1, len(mean))
        moment += shown.T @ shown
    step = _leading(moment, of_step)
    by_step = FeatureMap(mean, spread, step, identity.of_window)
    wide = np.concatenate([own_windows(*plate, by_step).reshape(len(plate[2]), -1) for plate in plates])
    return FeatureMap(mean, spread, step, _leading(wide.T @ wide, of_window))


def _leading(moment: NDArray[np.floating], count: int) -> Features:
    return np.asarray(np.linalg.eigh(moment)[1][:, ::-1][:, :count], dtype=np.float32)


def choose_faces(similarity: Floats, count: int, *, rounds: int = 4) -> list[int]:
    """Choose medoids of the (n, n) similarity: greedily, then by exchanges, in the order of what each adds."""
    chosen = _in_order(similarity, range(len(similarity)), count)
    for _ in range(rounds):
        before = list(chosen)
        for k in range(count):
            others = similarity[:, chosen[:k] + chosen[k + 1 :]].max(axis=1)
            chosen[k] = int(np.maximum(similarity, others[:, None]).sum(axis=0).argmax())
        if chosen == before:
            break
    return _in_order(similarity, chosen, count)


def _in_order(similarity: Floats, among: Iterable[int], count: int) -> list[int]:
    left, chosen, nearest = list(among), [], np.full(len(similarity), -1.0)
    for _ in range(count):
        best = max(left, key=lambda k: float(np.maximum(similarity[:, k], nearest).sum()))
        nearest = np.maximum(nearest, similarity[:, best])
        chosen.append(best)
        left.remove(best)
    return chosen


def compare_faces(paths: Sequence[str], work: Path, *, to_map: int = 60) -> tuple[list[str], Floats]:
    """The fonts that have all characters, and how similar they are: mean cosines of their characters."""
    plates: dict[str, Plate] = {}
    for path in paths:
        try:
            chars, (plate,) = face_plates(path, work, chars=COMPARED, senses=False)
        except (MarksError, ValueError, OSError) as error:
            print(f"{path}: {error}", flush=True)
            continue
        if "".join(chars) == COMPARED:
            plates[path] = plate
    map = fit_map(list(plates.values())[:: max(1, len(plates) // to_map)], of_step=64, of_window=128)
    numbers = np.stack([map.numbers(own_windows(*plate, map)) for plate in plates.values()])
    numbers /= np.linalg.norm(numbers, axis=2, keepdims=True)
    flat = numbers.reshape(len(numbers), -1)
    return list(plates), (flat @ flat.T).astype(np.float64) / len(COMPARED)


def predict_library(
    paths: Sequence[str], work: Path, *, of_step: int = 128, of_window: int = 96
) -> dict[str, Any]:
    """The arrays of the library's file, from the fonts that were chosen."""
    plates = {path: face_plates(path, work, chars=CHARS, senses=True) for path in paths}
    names = [load_font(path).name for path in paths]
    arrays: dict[str, Any] = {"names": np.array(names), "chars": np.array(list(CHARS))}
    for sense, views in VIEWS.items():
        every = [plate for _, of in plates.values() for plate in of[views]]
        map = fit_map(every, of_step=of_step, of_window=of_window)
        faces = [prototypes_of(chars, of[views], map) for chars, of in plates.values()]
        arrays["half"] = np.concatenate([face.half for face in faces]).astype(np.float16)
        arrays[f"{sense}_numbers"] = np.concatenate([face.numbers for face in faces]).astype(np.float16)
        arrays |= {f"{sense}_{name}": value.astype(np.float16) for name, value in vars(map).items()}
    return arrays


VIEWS: Mapping[Sense, slice] = {"tactile": slice(0, 1), "vision": slice(1, None)}
"""Views of `face_plates` by sense."""


def prototypes_of(
    chars: Sequence[str], plates: Sequence[Plate], map: FeatureMap, name: str = ""
) -> Prototypes:
    """Prototypes of a face, over `CHARS`, from its plates by one sense."""
    places = [CHARS.index(char) for char in chars]
    numbers = np.zeros((1, len(plates), len(CHARS), map.of_window.shape[1]), dtype=np.float32)
    half = np.zeros((1, len(CHARS)), dtype=np.float32)
    half[0, places] = plates[0][2]
    for light, plate in enumerate(plates):
        numbers[0, light, places] = map.numbers(own_windows(*plate, map))
    return Prototypes((name,), tuple(CHARS), numbers, half)


def main(
    *folders: Path,
    work: Path,
    licences: Path | None = None,
    same_faces: bool = False,
    faces: int = 80,
    of_window: int = 96,
) -> None:
    """Choose and predict the faces, and write the library with its manifest.

    Args:
        folders: folders of fonts.
        work: folder in which features are kept; an empty one for new weights of the recogniser.
        licences: table of the fonts' files, families, packages and licences, separated by tabs.
        same_faces: predict the faces of the present library again, for new weights.
        faces: number of faces.
        of_window: numbers of a prototype.
    """
    work.mkdir(parents=True, exist_ok=True)
    if same_faces:
        names = json.loads(LIBRARY.with_suffix(".fit.json").read_text("utf-8"))["fonts"]
        every = {path.stem: str(path) for folder in folders for path in folder.rglob("*") if path.is_file()}
        chosen = [every.get(name, name) for name in names]
        np.savez_compressed(LIBRARY, **predict_library(chosen, work, of_window=of_window))
        return
    if licences is None:
        raise MarksError("new faces need their licences", hint="--licences TABLE, or --same-faces")
    rows = (line.split("\t") for line in licences.read_text("utf-8").splitlines())
    sources = {Path(row[0]).name: (row[2], row[3].split(" |")[0]) for row in rows}
    files = candidates(folders, {name: licence for name, (_, licence) in sources.items()})
    paths, similarity = compare_faces([*BUILTIN_FONTS, *map(str, files)], work)
    chosen = [paths[k] for k in choose_faces(similarity, faces)]
    np.savez_compressed(LIBRARY, **predict_library(chosen, work, of_window=of_window))
    manifest = {
        "what": "library of faces (recognition/glyph_match/face_library.npz)",
        "command": "python -m recognition.learning.face_library FONTS --licences LICENCES --work WORK",
        "fonts": [Path(path).stem for path in chosen],
        "licences": [sources.get(Path(path).name, ("Hershey", "public domain")) for path in chosen],
        "chosen_from": len(paths),
        "soils": [],
        "editions": [],
    }
    LIBRARY.with_suffix(".fit.json").write_text(json.dumps(manifest, indent=1) + "\n", "utf-8")
    print(f"{len(chosen)} of {len(paths)} faces, {LIBRARY.stat().st_size / 1e6:.1f} MB")


if __name__ == "__main__":
    from cyclopts import run

    run(main)
