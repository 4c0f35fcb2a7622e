"""Fit the weights of recogniser, faces and depths, and show what each is worth::

    python tests/benchmarks/fit_experts.py LINES FONTS --work WORK [--write]

LINES is the folder of `expert_lines.py`, FONTS that of its fonts. Log loss of a character is shown for lines of a
generator and of fonts on which the weights were not fitted: without a named font, with the true one, and with others.
"""

from __future__ import annotations

import json
import pickle
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from glyphs.fonts.outlines import load_font
from pipeline.benchmark.analysis.estimates import ratio, resample
from recognition.glyph_match.combine import (
    FITTED,
    ExpertWeights,
    LineExperts,
    believe_faces,
    combine_experts,
    fitted_weights,
)
from recognition.glyph_match.face_library import Sense, face_library
from recognition.glyph_match.faces import compare_faces
from recognition.glyph_match.felt_line import FeltLine
from recognition.glyph_match.laid_line import depth_likelihoods
from recognition.glyph_match.prototypes import Floats, Prototypes
from recognition.language.lattice import Lattice
from recognition.learning.face_library import CHARS, VIEWS, face_plates, prototypes_of
from recognition.learning.training_fonts import family
from recognition.recogniser.recogniser import features_of
from tests.benchmarks.expert_lines import ExpertLine
from tests.benchmarks.risk_parts import GENERATORS, SEVERITIES, SOILS

START = ExpertWeights(
    sharpness=26.0, together=0.3, no_face=0.25, covered=0.1, named=1.0, network=1.1, network_fit=0.3,
    faces=0.2, faces_fit=0.2, depths=0.2, depths_fit=0.0, filled=0.1,
)  # fmt: skip
SCALES = {
    "sharpness": 4.0, "together": 0.1, "network": 0.3, "network_fit": 0.5,
    "faces": 0.2, "faces_fit": 0.5, "depths": 0.2,
}  # fmt: skip
"""Weights that are fitted, and their usual changes. The others keep their start: no log loss tells them apart."""
ALONE = replace(START, network_fit=0.0, faces=0.0, faces_fit=0.0, depths=0.0)
"""The recogniser alone, its posteriors scaled to what the format allows; only its power is fitted."""
SENSES: tuple[Sense, ...] = ("tactile", "vision")
SIZES = (10, 40)
"""Sizes of smaller libraries that are compared."""
OTHERS = 3
"""Fonts that are named beside the true one."""
FACES = 8 + OTHERS
ALLOWED = 26
"""Most characters that a format allows at a place."""
CONDITIONS = ("no font", "true font")
"""Conditions to which the weights are fitted."""


@dataclass(frozen=True, eq=False)
class Case:
    """A line with what experts say of it, under one condition.

    Attributes:
        sense, generator, font, severity: of the line.
        truth: (places,) index of the true character in `CHARS`.
        experts: what they say, over `CHARS`.
    """

    sense: str
    generator: str
    font: str
    severity: float
    truth: NDArray[np.intp]
    experts: LineExperts


def cases_of(
    part: Mapping[str, Any], line: ExpertLine, fonts: Mapping[str, Path], work: Path
) -> dict[str, Case]:
    """What the experts say of a line under each condition: libraries of several sizes, and fonts named."""
    library = face_library(line.sense)
    features = [features_of(strip.astype(np.float32)) for strip in line.strips]
    others = others_of(part["font"], sorted(fonts), seed=part["number"])

    def case(names: Sequence[str], size: int | None = None) -> Case:
        own = [font_prototypes(fonts[name], line.sense, work) for name in names]
        faces = library.faces.of(np.arange(len(library.faces.names))[:size])
        cosines = compare_faces(features, line.columns, own, faces, library.map, line.lattice)
        experts = cosines.experts(line.lattice)
        if line.depths is not None and names:
            best = int(cosines.fits[: len(own)].argmax())
            together = replace(
                line.lattice, log_belief=combine_experts(experts, believe_faces(experts, START), START)
            )
            depths = depth_likelihoods(together, felt_line_of(line), load_font(fonts[names[best]]))
            experts = replace(experts, depths=depths, depth_face=np.arange(len(cosines.names)) == best)
        truth = np.array([CHARS.index(char) for char in part["text"]])
        return Case(
            line.sense,
            part["generator"],
            part["font"],
            part["severity"],
            truth,
            over_all(experts, line.lattice),
        )

    named = {"true font": [part["font"]], "other fonts": others}
    return {
        "no font": case(()),
        **{name: case(names) for name, names in named.items()},
        **{f"library of {size}": case((), size) for size in SIZES},
    }


def over_all(experts: LineExperts, lattice: Lattice) -> LineExperts:
    """The experts over `CHARS`, with `FACES` faces."""
    to = [CHARS.index(char) for char in lattice.chars]
    network = np.full((lattice.n_places, len(CHARS)), -np.inf)
    network[:, to] = experts.network
    count = len(experts.cosines)
    cosines = np.full((FACES, *network.shape), np.nan)
    cosines[:count, :, to] = experts.cosines
    depths = np.full(network.shape, np.nan)
    if experts.depths is not None:
        depths[:, to] = experts.depths
    named, depth_face = np.zeros((2, FACES), dtype=np.bool_)
    named[:count] = experts.named
    if experts.depth_face is not None:
        depth_face[:count] = experts.depth_face
    return LineExperts(network, cosines, named, depths, depth_face)


def felt_line_of(line: ExpertLine) -> FeltLine:
    """The felt line with its depths; its view was not kept."""
    felt = FeltLine(None, line.line, line.columns, line.raised)  # type: ignore[arg-type]
    felt.__dict__["strip"] = line.depths
    return felt


def others_of(font: str, names: Sequence[str], *, seed: int) -> list[str]:
    """Some fonts of other families."""
    own = family(Path(font))[:5]
    rest = [name for name in names if family(Path(name))[:5] != own]
    return [str(name) for name in np.random.default_rng(seed).choice(rest, OTHERS, replace=False)]


@cache
def font_prototypes(path: Path, sense: Sense, work: Path) -> Prototypes:
    """Prototypes of a font at the canonical height, by the default touch or under all lamps."""
    chars, plates = face_plates(str(path), work, chars=CHARS, senses=True)
    return prototypes_of(chars, plates[VIEWS[sense]], face_library(sense).map, load_font(path).name)


@dataclass(frozen=True, eq=False)
class Batch:
    """Lines of as many places, together."""

    truth: NDArray[np.intp]
    experts: LineExperts

    @classmethod
    def of(cls, cases: Sequence[Case]) -> list[Batch]:
        """Batches of lines, by their number of places."""
        groups: dict[int, list[Case]] = {}
        for case in cases:
            groups.setdefault(len(case.truth), []).append(case)
        return [cls._of_one_length(group) for group in groups.values()]

    @classmethod
    def _of_one_length(cls, cases: Sequence[Case]) -> Batch:
        network, cosines, named, depths, depth_face = (
            np.stack([getattr(case.experts, name) for case in cases]) for name in asdict(cases[0].experts)
        )
        # only what the format allows: the sums are long
        order = np.argsort(~np.isfinite(network), axis=-1, kind="stable")[..., :ALLOWED]
        network, depths = (
            np.take_along_axis(log, order, axis=-1).astype(np.float32) for log in (network, depths)
        )
        cosines = np.take_along_axis(cosines, order[:, None], axis=-1).astype(np.float32)
        truth = (order == np.stack([case.truth for case in cases])[..., None]).argmax(axis=-1)
        return cls(truth, LineExperts(network, cosines, named, depths, depth_face))

    def log_loss(self, weights: ExpertWeights) -> Floats:
        """(lines, places) negative log probability of the true character."""
        return loss_of(
            combine_experts(self.experts, believe_faces(self.experts, weights), weights), self.truth
        )


def loss_of(log: Floats, truth: NDArray[np.intp], *, slip: float = 1e-4, most: float = 9.0) -> Floats:
    """Negative log probability of the true character, with the reader's slip.

    Args:
        log: (..., places, C) log posteriors.
        truth: (..., places) index of the true character.
        slip: share of the probability that all characters have alike.
        most: greatest loss: a line that was found at another place is no matter of weights.
    """
    own = np.take_along_axis(log, truth[..., None], axis=-1)[..., 0]
    allowed = np.isfinite(log).sum(axis=-1)
    slipped = np.logaddexp(own + np.log1p(-slip), np.log(slip / np.maximum(allowed, 1)))
    return np.asarray(np.minimum(-slipped, most))


def fit(
    cases: Sequence[Case],
    *,
    start: ExpertWeights = START,
    scales: Mapping[str, float] = SCALES,
    ridge: float = 1.0,
    steps: int = 10,
) -> ExpertWeights:
    """Weights with the least log loss.

    Args:
        cases: lines under several conditions.
        start: weights from which the fit starts, and towards which it is drawn.
        scales: weights that are fitted, and their usual changes.
        ridge: draw, nats per squared usual change.
        steps: most steps.
    """
    batches = Batch.of(cases)

    def weights(changes: Floats) -> ExpertWeights:
        pairs = zip(scales.items(), changes, strict=True)
        return replace(
            start, **{name: getattr(start, name) + scale * change for (name, scale), change in pairs}
        )

    def total(changes: Floats) -> float:
        losses = (float(batch.log_loss(weights(changes)).sum()) for batch in batches)
        return sum(losses) + ridge * float((changes**2).sum())

    bounds = [(-2.0, 6.0)] * len(scales)
    options = {"maxiter": steps, "eps": 0.02}
    return weights(
        minimize(total, np.zeros(len(scales)), method="L-BFGS-B", bounds=bounds, options=options).x
    )


def folds_of(cases: Sequence[Case]) -> Sequence[tuple[list[int], list[int]]]:
    """Lines to fit to and lines that were left out: those of each generator in one half of the fonts."""
    halves = [crc32(case.font[:5].encode()) % 2 for case in cases]
    folds = []
    for generator in GENERATORS:
        for half in (0, 1):
            left = [k for k, case in enumerate(cases) if case.generator == generator and halves[k] == half]
            learned = [k for k, case in enumerate(cases) if case.generator != generator and halves[k] != half]
            folds.append((learned, left))
    return folds


def losses_left_out(
    cases: Mapping[str, Sequence[Case]],
    *,
    start: ExpertWeights = START,
    scales: Mapping[str, float] = SCALES,
) -> dict[str, list[Floats]]:
    """Losses of each line under each condition, by weights of other generators and fonts.

    Args:
        cases: lines under each condition, in the same order.
        start, scales: as of `fit`.
    """
    lines = cases[CONDITIONS[0]]
    losses: dict[str, list[Floats]] = {name: [np.zeros(0)] * len(lines) for name in cases}
    for learned, left in folds_of(lines):
        weights = fit([cases[name][k] for name in CONDITIONS for k in learned], start=start, scales=scales)
        for name, of_name in cases.items():
            for k in left:
                (losses[name][k],) = losses_of([of_name[k]], weights)
    return losses


def losses_of(cases: Sequence[Case], weights: ExpertWeights) -> list[Floats]:
    """Losses of each line."""
    return [batch.log_loss(weights)[0] for case in cases for batch in Batch.of([case])]


def print_losses(rows: Mapping[str, Sequence[Floats]], lines: Sequence[Case]) -> None:
    """Print mean log losses of a character by severity, and by generator, and what each row adds to "no font"."""
    groups: dict[str, list[int]] = {
        str(s): [k for k, c in enumerate(lines) if c.severity == s] for s in SEVERITIES
    }
    groups |= {g: [k for k, c in enumerate(lines) if c.generator == g] for g in GENERATORS}
    groups["all"] = list(range(len(lines)))
    print("| | " + " | ".join(f"{name} ({len(of)})" for name, of in groups.items()) + " | more (95 %) |")
    print("|---" * (len(groups) + 2) + "|")
    for name, losses in rows.items():
        means = (np.concatenate([losses[k] for k in of]).mean() if of else np.nan for of in groups.values())
        interval = "" if name == "no font" else _difference(losses, rows["no font"])
        print(f"| {name} | {' | '.join(f'{mean:.4f}' for mean in means)} | {interval} |", flush=True)


def _difference(losses: Sequence[Floats], others: Sequence[Floats]) -> str:
    sums = [(own.sum() - other.sum(), own.size) for own, other in zip(losses, others, strict=True)]
    more = resample(np.array(sums), ratio, least=-1.0)
    return f"{more.value:+.4f} ({more.low:+.4f} to {more.high:+.4f})"


def main(lines: Path, fonts: Path, *, work: Path, write: bool = False) -> None:
    """Fit the weights, and print log losses of characters of lines that were left out.

    Args:
        lines: folder of `expert_lines.py`.
        fonts: folder of its fonts.
        work: folder in which comparisons are kept.
        write: write the weights to which all lines were fitted.
    """
    files = {path.stem: path for path in sorted(fonts.iterdir())}
    weights: dict[str, dict[str, float]] = {}
    parts = list(kept_cases(lines, files, work))
    for sense in SENSES:
        cases = {name: [of[sense][name] for of in parts if sense in of] for name in next(iter(parts))[sense]}
        weights[sense] = asdict(fit([case for name in CONDITIONS for case in cases[name]]))
        print(sense, json.dumps({name: round(value, 3) for name, value in weights[sense].items()}))
        network = [loss_of(case.experts.network, case.truth) for case in cases["no font"]]
        scales = {"network": SCALES["network"]}
        alone = losses_left_out({name: cases[name] for name in CONDITIONS}, start=ALONE, scales=scales)
        rows = {
            "recogniser": network,
            "recogniser to a fitted power": alone["no font"],
            **losses_left_out(cases),
            "present weights, no font": losses_of(cases["no font"], fitted_weights(sense)),
        }
        print_losses(rows, cases["no font"])
    if write:
        manifest = {
            "what": "weights of recogniser, faces and depths (recognition/glyph_match/combine.py)",
            "command": "python tests/benchmarks/fit_experts.py LINES FONTS --work WORK --write",
            "lines": len(parts),
            "fonts": sorted(
                {case.font for of in parts for case in (next(iter(next(iter(of.values())).values())),)}
            ),
            "soils": list(SOILS),
            "editions": [],
            "weights": weights,
        }
        FITTED.write_text(json.dumps(manifest, indent=1) + "\n", "utf-8")


def kept_cases(lines: Path, files: Mapping[str, Path], work: Path) -> Iterator[dict[str, dict[str, Case]]]:
    """The cases of each part by sense and condition, kept in a folder."""
    work.mkdir(parents=True, exist_ok=True)
    parts = {path: pickle.loads(path.read_bytes()) for path in sorted(lines.glob("*.pkl"))}
    fonts = {name: files[name] for name in {part["font"] for part in parts.values()}}
    for path, part in parts.items():
        kept = work / path.name
        if not kept.exists():
            of = {
                sense: cases_of(part, ExpertLine(**line), fonts, work)
                for sense, line in part["lines"].items()
                if line is not None and line["lattice"].n_places == len(part["text"])
            }
            kept.write_bytes(pickle.dumps(of))
        of = pickle.loads(kept.read_bytes())
        if of:
            yield of


if __name__ == "__main__":
    from cyclopts import run

    run(main)
