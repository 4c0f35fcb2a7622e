"""The regression gate: the edition of 48 is read, and nothing may be read worse than the floors say.

    marks-exam-1-48 --read--> trials --scored--> counts, against marks-exam-1-48.floors.json

- A floor is a count of this edition's parts, so nothing of chance is in it: the same program gives the same counts. On
  another processor sums may be rounded otherwise; `SLACK` is what that may cost.
- Characters, serials and accepted may not fall below their floor by more; accepted-wrong may not rise at all.
- `raised` only ever tightens. Floors are raised in a commit that changes nothing else; a test reads the history.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from importlib.resources import files
from pathlib import Path

from glyphs.atomic import replacing
from glyphs.errors import FileError
from pipeline.benchmark.analysis.confusion import characters_right
from pipeline.benchmark.trials.journal import Trial

EDITION = "marks-exam-1-48"
FLOORS_FILE = Path(str(files("pipeline.benchmark.exam") / "designs" / f"{EDITION}.floors.json"))
MODES = ("tactile", "tactile templates", "rapidocr relief")
"""Who is read at every change: touch, its templates by themselves, and the peer to beat, on the felt relief."""
CAMERA_MODES = ("vision", "fused")
"""Who has floors, too, but takes twice as long."""


SLACK = {"characters": 3, "serials": 1, "accepted": 1}


@dataclass(frozen=True)
class Counts:
    """What one mode made of the edition.

    Attributes:
        characters: right.
        serials: right as a whole.
        accepted: vouched for.
        accepted_wrong: of these, wrong.
    """

    characters: int
    serials: int
    accepted: int
    accepted_wrong: int

    @classmethod
    def of(cls, trials: Sequence[Trial]) -> Counts:
        """Count the trials of one mode."""
        return cls(
            characters=sum(characters_right(t) for t in trials),
            serials=sum(t.right for t in trials),
            accepted=sum(t.accepted for t in trials),
            accepted_wrong=sum(t.accepted and not t.right for t in trials),
        )

    def below(self, floor: Counts) -> Iterator[str]:
        """What is worse than the floor, in words."""
        for name, slack in SLACK.items():
            found, least = getattr(self, name), getattr(floor, name)
            if found < least - slack:
                yield f"{name} {found}, the floor is {least} (less {slack} for rounding)"
        if self.accepted_wrong > floor.accepted_wrong:
            yield f"accepted but wrong {self.accepted_wrong}, the limit is {floor.accepted_wrong}"

    def raised(self, found: Counts) -> Counts:
        """The tighter of this floor and what was found, number by number."""
        return Counts(
            characters=max(self.characters, found.characters),
            serials=max(self.serials, found.serials),
            accepted=max(self.accepted, found.accepted),
            accepted_wrong=min(self.accepted_wrong, found.accepted_wrong),
        )


Floors = dict[str, Counts]


def counts_of(trials: Sequence[Trial]) -> Floors:
    """The counts of every mode."""
    modes = dict.fromkeys(t.mode for t in trials)
    return {mode: Counts.of([t for t in trials if t.mode == mode]) for mode in modes}


def load_floors(path: Path = FLOORS_FILE) -> Floors:
    """The stored floors; none where there is no file yet.

    Raises:
        FileError: a file that does not hold floors.
    """
    if not path.exists():
        return {}
    try:
        return {mode: Counts(**counts) for mode, counts in json.loads(path.read_text("utf-8")).items()}
    except (ValueError, TypeError, AttributeError) as error:
        raise FileError(path, f"does not hold floors ({error})", "restore it from the history") from error


def save_floors(floors: Floors, path: Path = FLOORS_FILE) -> None:
    """Write the floors.

    Raises:
        FileError: it cannot be written.
    """
    with replacing(path) as temporary:
        temporary.write_text(
            json.dumps({mode: asdict(counts) for mode, counts in floors.items()}, indent=1) + "\n", "utf-8"
        )


def objections(found: Floors, floors: Floors) -> list[str]:
    """What is worse than the floors, a line each; a mode without a floor is one."""
    lines: list[str] = []
    for mode, counts in found.items():
        if mode not in floors:
            lines.append(f"{mode}: has no floor yet (give it one with --raise)")
        else:
            lines += [f"{mode}: {line}" for line in counts.below(floors[mode])]
    return lines


def raised(found: Floors, floors: Floors) -> Floors:
    """The floors, tightened to what was found; a mode without a floor gets one."""
    return {**floors, **{mode: floors.get(mode, counts).raised(counts) for mode, counts in found.items()}}
