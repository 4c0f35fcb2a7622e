"""What each expert's belief is worth, fitted on parts whose text is known::

    python -m pipeline.benchmark.fit_beliefs FONTS ... --parts 300 --seed 900 --write

FONTS are folders of fonts; of them those of held-out families alone, which no network has learned from. Parts are
drawn as for learning (`recognition.learning.training_parts`), felt by plans drawn at random, photographed, and read
with the format of their text; fonts are named, so that templates have their say. A line that was not found teaches
nothing about experts. Beside the weights, the loss on every soil is told by weights that were fitted on the others.
"""

from __future__ import annotations

import argparse
import json
import logging
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from glyphs.errors import MarksError
from recognition.belief.weights import FITTED, ExpertWeights, weights_of
from recognition.learning.fit_weights import KnownLine, fit_weights, loss
from recognition.views.view import ViewKind

if TYPE_CHECKING:
    from recognition.decision.reading import Reading

_KINDS = (("felt", ViewKind.FELT), ("photo", ViewKind.PHOTO))
_FOUND = 0.6
"""Share of the characters that any expert must have right, or the line is taken not to have been found."""
_CLASSES = ("ABCDEFGHIJKLMNOPQRSTUVWXYZ", "0123456789", "abcdefghijklmnopqrstuvwxyz")
_log = logging.getLogger(__name__)


def known_lines(folders: Sequence[Path], *, parts: int, seed: int) -> Iterator[tuple[str, KnownLine]]:
    """Kind of view and line of every part that can be drawn and read."""
    from recognition import Grammar, Orientation, Reader
    from recognition.learning.training_fonts import find_fonts
    from recognition.learning.training_parts import draw_part

    fonts = find_fonts(folders).held_out
    for k in range(parts):
        rng = np.random.default_rng((seed, k))
        try:
            made = draw_part(fonts, rng)
            text = "".join(made.part.stamped.text.split())
            allowed = tuple(next((c for c in _CLASSES if char in c), char) for char in text)
            reader = Reader(fonts=(made.font,), format=Grammar(sets=allowed), orientation=Orientation.UPRIGHT)
            readings = [("felt", reader.touch.read_scan(made.scan))]
            if made.photo is not None:
                readings.append(("photo", reader.vision.read_photo(made.photo)))
        except (MarksError, ValueError) as error:  # drawn at random, some things cannot be
            _log.info("part %d: %s", k, error)
            continue
        group = "+".join(made.part.soiling.soils) or "clean"
        yield from ((kind, line) for kind, one in readings if (line := _known(one, text, group)) is not None)


def _known(reading: Reading, text: str, group: str) -> KnownLine | None:
    by_expert = reading.trace.by_expert
    if not by_expert or any(lattice.n_places != len(text) for lattice in by_expert.values()):
        return None
    right = []
    for lattice in by_expert.values():
        read = [lattice.chars[i] for i in lattice.log_belief.argmax(axis=1)]
        right.append(np.mean([a == b for a, b in zip(read, text, strict=True)]))
    return KnownLine(text, by_expert, group) if max(right) >= _FOUND else None


def held_out(lines: Sequence[KnownLine]) -> dict[str, tuple[float, float]]:
    """Of each group that is large enough: loss by weights of the others' fit, and by today's power of 0.6 each."""
    found = {}
    for group in sorted({line.group for line in lines}):
        own = [line for line in lines if line.group == group]
        if len(own) >= 10:
            fitted = fit_weights([line for line in lines if line.group != group])
            alone = min(loss([_only(line, name) for line in own], fitted) for name in fitted.powers)
            found[group] = (loss(own, fitted), alone)
    return found


def _only(line: KnownLine, name: str) -> KnownLine:
    own = {name: line.by_expert[name]} if name in line.by_expert else dict(line.by_expert)
    return KnownLine(line.text, own, line.group)


def _as_json(weights: ExpertWeights) -> dict[str, object]:
    return {"powers": {name: asdict(power) for name, power in weights.powers.items()}, "slip": weights.slip}


def main(arguments: Sequence[str] | None = None) -> None:
    """Fit, say what was found, and with --write keep it."""
    from recognition.learning.training_parts import SOILS_LEARNED

    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("fonts", type=Path, nargs="+", help="folders of TrueType or OpenType files")
    asked.add_argument("--parts", type=int, default=300)
    asked.add_argument("--seed", type=int, default=900)
    asked.add_argument("--write", action="store_true", help=f"replace {FITTED.name}")
    given = asked.parse_args(arguments)
    lines: dict[str, list[KnownLine]] = {kind: [] for kind, _ in _KINDS}
    for kind, line in known_lines(given.fonts, parts=given.parts, seed=given.seed):
        lines[kind].append(line)
    told: dict[str, object] = {}
    for kind, view in _KINDS:
        fitted = fit_weights(lines[kind])
        told[kind] = _as_json(fitted)
        print(
            f"{kind}: {len(lines[kind])} lines, loss {loss(lines[kind], weights_of(view)):.4f} by the weights in use,"
        )
        print(f"  {loss(lines[kind], fitted):.4f} fitted: {_as_json(fitted)}")
        for group, (others, alone) in held_out(lines[kind]).items():
            print(f"  {group}: {others:.4f} by weights of the others, {alone:.4f} by the best expert alone")
    command = (
        f"python -m pipeline.benchmark.fit_beliefs FONTS --parts {given.parts} --seed {given.seed} --write"
    )
    if given.write:
        manifest = {
            "what": "powers of the experts' beliefs (recognition/belief/weights.py)",
            "command": command,
            "made": date.today().isoformat(),
            "fonts": ["families of recognition.learning.training_fonts that are held out"],
            "soils": list(SOILS_LEARNED),
            "editions": {},
            "lines": {kind: len(own) for kind, own in lines.items()},
            "weights": told,
        }
        FITTED.write_text(json.dumps(manifest, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
