"""The tables that documents show, as Markdown: readers over all parts, and at every severity.

Shares are per cent with 95 % intervals: of characters by whole parts drawn again, of serials Wilson's; what was
accepted but wrong has the one-sided 95 % bound of Clopper and Pearson.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from pipeline.benchmark.analysis.groups import Cell
from pipeline.benchmark.analysis.statistics import Statistics
from pipeline.common.shares import Share


def text_tables(found: Statistics, *, command: str = "") -> str:
    """All of it.

    Args:
        found: the figures.
        command: by which it is made again.
    """
    severities = list(dict.fromkeys(g.key.severity for g in found.by_severity))
    made = [f"    {command}\n"] if command else []
    made.append(f"{given_words(found.given)}\n")
    made.append(_over_all(leaders(found.by_mode or found.by_severity)))
    if len(severities) > 1:
        made.append(_by_severity(found, severities))
    return "\n".join(made)


def given_words(given: Sequence[str]) -> str:
    """The sentence that says what readers know of a part before they read it."""
    return f"Readers are given {'; or '.join(one.replace(',', ', ') for one in given)}."


def leaders(groups: Iterable[Cell]) -> list[Cell]:
    """The groups, the fewest character errors first."""
    return sorted(groups, key=lambda group: (group.character_error_rate, -group.accepted.value))


def _over_all(groups: Sequence[Cell]) -> str:
    rows = [
        (
            group.key.reader,
            str(group.serials.total),
            _percent(group.character_error_rate),
            _with_interval(group.characters, group.characters_by_part),
            _with_interval(group.serials, (group.serials.low, group.serials.high)),
            _percent(group.accepted.value),
            _at_most(group.wrong_of_accepted),
        )
        for group in groups
    ]
    heading = ("reader", "parts", "CER, %", "characters", "serials", "accepted", "of these wrong (at most)")
    return _table(heading, rows)


def _by_severity(found: Statistics, severities: Sequence[float | None]) -> str:
    """Characters with their interval, serials and accepted."""
    rows = []
    for reader in dict.fromkeys(g.key.reader for g in found.by_severity):
        at = {g.key.severity: g for g in found.by_severity if g.key.reader == reader}
        rows.append((reader, *(_short(at[severity]) if severity in at else "-" for severity in severities)))
    heading = ("characters / serials / accepted (parts)", *(f"dirt {severity}" for severity in severities))
    return _table(heading, rows)


def _short(cell: Cell) -> str:
    characters = _with_interval(cell.characters, cell.characters_by_part)
    return f"{characters} / {_percent(cell.serials.value)} / {_percent(cell.accepted.value)} ({cell.serials.total})"


def _at_most(share: Share) -> str:
    return f"{share.count} of {share.total} ({_percent(share.high)})"


def _with_interval(share: Share, interval: tuple[float, float]) -> str:
    return f"{_percent(share.value)} ({_percent(interval[0])} to {_percent(interval[1])})"


def _percent(value: float) -> str:
    return f"{100.0 * value:.1f}"


def _table(heading: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [heading, ["---"] * len(heading), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)
