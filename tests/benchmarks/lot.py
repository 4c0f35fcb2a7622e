"""A lot with misreads among its serials: how many are caught, and how many good parts a person gets.

    python tests/benchmarks/lot.py [--parts 10000] [--misread 0.001] [--jump 5] [--seed 1]

Serials count up; one part in 200 was scrapped before, one pair in 200 comes in the other order. A misread has
character taken for another. The store is SQLite, its rules asked of every
part as `serve` has them: duplicates, sequence_jump, and an order that is the range of the lot.
"""

from __future__ import annotations

import tempfile
import time
from contextlib import closing
from pathlib import Path

import numpy as np

from pipeline.common.part_id import new_part_id
from pipeline.common.reading_records import ReadingRecord
from pipeline.common.records import PartState
from pipeline.common.serial_rules import SerialRules
from pipeline.formats.truth import read_order
from pipeline.store.store import Store

_EACH = 200
_ALPHABET = np.array(list("ABCDEFGHJKLMNPRSTUVWXYZ0123456789"))


def lot(rng: np.random.Generator, parts: int, misread: float) -> list[tuple[str, str]]:
    """(true, read) of every part, as they come."""
    numbers = np.cumsum(1 + (rng.random(parts) < 1 / _EACH)) + 407_000
    for k in np.flatnonzero(rng.random(parts - 1) < 1 / _EACH):
        numbers[[k, k + 1]] = numbers[[k + 1, k]]
    rows = []
    for number in numbers:
        true = read = f"KX{number:06d}"
        if rng.random() < misread:
            place = int(rng.integers(len(true)))
            read = true[:place] + str(rng.choice(_ALPHABET[true[place] != _ALPHABET])) + true[place + 1 :]
        rows.append((true, read))
    return rows


def main(*, parts: int = 10_000, misread: float = 0.001, jump: int = 5, seed: int = 1) -> None:
    """Print what was caught, by rule.

    Args:
        parts: of the lot.
        misread: share of them.
        jump: the most by which a serial may follow another.
        seed: of the lot.
    """
    rows = lot(np.random.default_rng(seed), parts, misread)
    with tempfile.TemporaryDirectory() as folder:
        order = Path(folder) / "lot.csv"
        order.write_text(f"serial\n{min(true for true, _ in rows)}..{max(true for true, _ in rows)}\n")
        kinds = {
            "duplicates": SerialRules(duplicates=True),
            "sequence": SerialRules(jump=jump),
            "order": SerialRules(order=read_order(order)),
            "all": SerialRules(True, jump, read_order(order)),
        }
        for name, rules in kinds.items():
            began = time.monotonic()
            with closing(Store.open(f"sqlite:///{folder}/{name}.db")) as store:
                reviewed = [_reviewed(store, rules, number, read) for number, (_, read) in enumerate(rows)]
            wrong = [sent for sent, (true, read) in zip(reviewed, rows, strict=True) if true != read]
            good = [sent for sent, (true, read) in zip(reviewed, rows, strict=True) if true == read]
            print(
                f"{name:10}  caught {sum(wrong)} of {len(wrong)} misreads,"
                f" sent {sum(good)} of {len(good)} good parts to a person,"
                f" {1000 * (time.monotonic() - began) / len(rows):.1f} ms a part",
                flush=True,
            )


def _reviewed(store: Store, rules: SerialRules, number: int, text: str) -> bool:
    part = store.add_part(
        part_id=new_part_id(),
        name=f"part {number}",
        state=PartState.ACCEPTED,
        readings=(ReadingRecord("vision", text, "accept", 0.999),),
        rules=rules,
    )
    return part.state is PartState.REVIEW


if __name__ == "__main__":
    from cyclopts import run

    run(main)
