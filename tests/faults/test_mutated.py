"""Files of every kind, changed at random: a few of the campaign in `mutated`."""

from __future__ import annotations

from pathlib import Path

from tests.faults.mutated import KINDS, READ_OR_REFUSED, campaign

EACH = 5


def test_a_damaged_file_is_read_or_refused_by_its_name(tmp_path: Path) -> None:
    found = campaign(tuple(KINDS), EACH, 7, 1, tmp_path)
    assert {kind: set(tally) - set(READ_OR_REFUSED) for kind, tally in found.items()} == {
        key: set() for key in KINDS
    }
    assert all(sum(tally.values()) == EACH for tally in found.values())
    # the changes are neither harmless nor all beyond recognition
    total = sum((tally for tally in found.values()), start=type(found["map.npz"])())
    assert all(total[came] > len(KINDS) // 2 for came in READ_OR_REFUSED)
