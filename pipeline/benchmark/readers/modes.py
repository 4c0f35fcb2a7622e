"""The modes that are compared: each reads the same part with its own senses."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

from pipeline.benchmark.readers.ablation import leave_out
from pipeline.benchmark.readers.experts import EXPERT_MODES, alone, experts_in
from pipeline.benchmark.readers.mode import Mode, PartReadings
from pipeline.benchmark.readers.own_reader import own_mode
from pipeline.benchmark.readers.plans import PLANS, TouchPlan, plan_mode
from pipeline.common.settings import SettingsError

if TYPE_CHECKING:
    from recognition.decision.reading import Reading
    from recognition.reader import Reader


WITHOUT = " without "
"""Between a mode and the rule of the decision that it goes without."""


def _sense(uses: tuple[str, ...], read: Callable[[PartReadings, Reader], Reading], reader: Reader) -> Mode:
    if "touch" in uses:
        _ = reader.touch  # settings that cannot be, before anything is read
    if uses != ("touch",):
        _ = reader.vision
    return Mode.of(uses, lambda senses: read(senses, reader))


def _changed(whole: str, change: Callable[[Reading], Reading], reader: Reader) -> Mode:
    """A mode of the project's own whose reading is changed afterwards."""
    mode = MODES[whole](reader)
    return Mode.of(mode.uses, lambda senses: change(mode.read(senses)[0]))


def _expert(name: str, reader: Reader) -> Mode:
    sense, expert = name.split()
    return _changed(sense, lambda reading: alone(reading, expert, reader.settings), reader)


def _peer(name: str, reader: Reader) -> Mode:
    from pipeline.benchmark.readers.peers import open_peer

    written = reader.settings.format
    return open_peer(*name.split(), format=written if isinstance(written, str) else None)


Maker = Callable[["Reader"], Mode]
MODES: dict[str, Maker] = {
    "tactile": partial(_sense, ("touch",), lambda senses, _: senses.touch),
    "vision": partial(_sense, ("vision",), lambda senses, _: senses.vision),
    "lights": partial(_sense, ("lights",), lambda senses, _: senses.lights),
    "fused": partial(_sense, ("touch", "vision"), lambda s, reader: reader.fuse(s.touch, s.vision)),
}
"""The project's own modes by name."""
PEERS: dict[str, Maker] = {
    name: partial(_peer, name)
    for engine in ("rapidocr", "tesseract")
    for name in (f"{engine} {picture}" for picture in ("photo", "edges", "relief", "ideal"))
}
"""Programs of others on the same parts, by name."""
EXPERTS: dict[str, Maker] = {name: partial(_expert, name) for name in EXPERT_MODES}
"""Every expert of the project's own modes by itself, by name."""


def expand_groups(named: tuple[str, ...], *, ablate: tuple[str, ...] = ()) -> tuple[str, ...]:
    """Replace groups among the names of modes: experts (of the other modes), peers, plans (of touch).

    Args:
        named: modes and groups.
        ablate: rules of the decision; each of the project's own modes is also read without each.
    """
    groups = {"experts": experts_in(named), "peers": tuple(PEERS), "plans": tuple(p.mode for p in PLANS)}
    single = tuple(name for name in named if name not in groups)
    more = dict.fromkeys(mode for name in named for mode in groups.get(name, ()))
    less = tuple(f"{mode}{WITHOUT}{rule}" for rule in ablate for mode in single if mode in MODES)
    return (*single, *(mode for mode in more if mode not in single), *less)


def open_mode(name: str, reader: Reader) -> Mode:
    """The mode of that name, a plan of touch, or the reader of one's own, `module:function`.

    Raises:
        ModeUnavailableError: it cannot run here.
        SettingsError: no such mode, or a font or format it cannot use.
    """
    if ":" in name:
        return own_mode(name, reader.settings)
    whole, _, rule = name.partition(WITHOUT)
    if rule and whole in MODES:
        return _changed(whole, leave_out(rule), reader)
    if (plan := TouchPlan.of(name)) is not None:
        return plan_mode(plan, reader)
    makers = {**MODES, **EXPERTS, **PEERS}
    if name not in makers:
        raise SettingsError(f"there is no mode {name!r}", hint=f"the modes are {', '.join(MODES)}")
    return makers[name](reader)
