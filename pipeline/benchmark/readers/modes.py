"""The modes that are compared: each reads the same part with its own senses."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

from pipeline.benchmark.readers.experts import EXPERT_MODES, alone
from pipeline.benchmark.readers.mode import ModeReader, PartReadings
from pipeline.benchmark.readers.own_reader import OwnMode
from pipeline.benchmark.readers.plans import PlanMode, TouchPlan
from pipeline.common.settings import SettingsError

if TYPE_CHECKING:
    from recognition.decision.reading import Reading
    from recognition.reader import Reader


@dataclass
class SenseMode:
    """A mode of the project's own senses.

    Attributes:
        uses: see `ModeReader`.
        read: makes its reading of what the senses read.
    """

    uses: tuple[str, ...]
    read: Callable[[PartReadings], Reading]


def _sense(
    uses: tuple[str, ...], read: Callable[[PartReadings, Reader], Reading], reader: Reader
) -> SenseMode:
    if "touch" in uses:
        _ = reader.touch  # settings that cannot be, before anything is read
    if uses != ("touch",):
        _ = reader.vision
    return SenseMode(uses, lambda senses: read(senses, reader))


def _expert(name: str, reader: Reader) -> ModeReader:
    sense, expert = name.split()
    whole = MODES[sense](reader)
    return SenseMode(whole.uses, lambda senses: alone(whole.read(senses), expert, reader.settings))


def _peer(name: str, reader: Reader) -> ModeReader:
    from pipeline.benchmark.readers.peers import open_peer

    written = reader.settings.format
    return open_peer(*name.split(), format=written if isinstance(written, str) else None)


MODES: dict[str, Callable[[Reader], SenseMode]] = {
    "tactile": partial(_sense, ("touch",), lambda senses, _: senses.touch),
    "vision": partial(_sense, ("vision",), lambda senses, _: senses.vision),
    "lights": partial(_sense, ("lights",), lambda senses, _: senses.lights),
    "fused": partial(_sense, ("touch", "vision"), lambda s, reader: reader.fuse(s.touch, s.vision)),
}
"""The project's own modes by name."""
PEERS: dict[str, Callable[[Reader], ModeReader]] = {
    name: partial(_peer, name)
    for engine in ("rapidocr", "tesseract")
    for name in (f"{engine} {picture}" for picture in ("photo", "edges", "relief", "ideal"))
}
"""Programs of others on the same parts, by name."""
EXPERTS: dict[str, Callable[[Reader], ModeReader]] = {name: partial(_expert, name) for name in EXPERT_MODES}
"""Every expert of the project's own modes by itself, by name."""


def open_mode(name: str, reader: Reader) -> ModeReader:
    """The mode of that name, a plan of touch, or the reader of one's own, `module:function`.

    Raises:
        ModeUnavailableError: it cannot run here.
        SettingsError: no such mode, or a font or format it cannot use.
    """
    makers: dict[str, Callable[[Reader], ModeReader]] = {**MODES, **EXPERTS, **PEERS}
    if ":" in name:
        return OwnMode(name, reader.settings)
    if (plan := TouchPlan.of(name)) is not None:
        return PlanMode(plan, reader)
    if name not in makers:
        raise SettingsError(f"there is no mode {name!r}", hint=f"the modes are {', '.join(MODES)}")
    return makers[name](reader)
