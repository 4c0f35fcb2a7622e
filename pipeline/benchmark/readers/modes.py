"""The modes that are compared: each reads the same part with its own senses."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

from pipeline.benchmark.readers.experts import EXPERT_MODES, ExpertMode
from pipeline.benchmark.readers.mode import ModeReader, PartReadings
from pipeline.benchmark.readers.own_reader import OwnMode
from pipeline.common.settings import SettingsError

if TYPE_CHECKING:
    from recognition.decision.reading import Reading
    from recognition.reader import Reader


class TactileMode:
    """Touch alone."""

    uses: tuple[str, ...] = ("touch",)

    def __init__(self, reader: Reader) -> None:
        _ = reader.touch

    def read(self, senses: PartReadings) -> Reading:
        """The reading of touch."""
        return senses.touch


class VisionMode:
    """The camera alone."""

    uses: tuple[str, ...] = ("vision",)

    def __init__(self, reader: Reader) -> None:
        _ = reader.vision

    def read(self, senses: PartReadings) -> Reading:
        """The reading of vision."""
        return senses.vision


class LightsMode:
    """The camera alone, under several lights."""

    uses: tuple[str, ...] = ("lights",)

    def __init__(self, reader: Reader) -> None:
        _ = reader.vision

    def read(self, senses: PartReadings) -> Reading:
        """The reading of all photographs together."""
        return senses.lights


class FusedMode:
    """Touch and camera."""

    uses: tuple[str, ...] = ("touch", "vision")

    def __init__(self, reader: Reader) -> None:
        _ = reader.touch, reader.vision
        self.reader = reader

    def read(self, senses: PartReadings) -> Reading:
        """Both readings fused."""
        return self.reader.fuse(senses.touch, senses.vision)


def _peer(engine: str, picture: str) -> Callable[[Reader], ModeReader]:
    def make(reader: Reader) -> ModeReader:
        from pipeline.benchmark.readers.peers import open_peer

        written = reader.settings.format
        return open_peer(engine, picture, format=written if isinstance(written, str) else None)

    return make


MODES: dict[str, Callable[[Reader], ModeReader]] = {
    "tactile": TactileMode,
    "vision": VisionMode,
    "lights": LightsMode,
    "fused": FusedMode,
}
"""The project's own modes by name."""
PEERS: dict[str, Callable[[Reader], ModeReader]] = {
    f"{engine} {picture}": _peer(engine, picture)
    for engine in ("rapidocr", "tesseract")
    for picture in ("photo", "edges", "relief", "ideal")
}
"""Programs of others on the same parts, by name."""


EXPERTS: dict[str, Callable[[Reader], ModeReader]] = {
    name: partial(ExpertMode, name) for name in EXPERT_MODES
}
"""Every expert of the project's own modes by itself, by name."""


def open_mode(name: str, reader: Reader) -> ModeReader:
    """The mode of that name, or the reader of one's own, `module:function`.

    Raises:
        ModeUnavailableError: it cannot run here.
        SettingsError: no such mode, or a font or format it cannot use.
    """
    makers = {**MODES, **EXPERTS, **PEERS}
    if ":" in name:
        return OwnMode(name, reader.settings)
    if name not in makers:
        raise SettingsError(f"there is no mode {name!r}", hint=f"the modes are {', '.join(MODES)}")
    return makers[name](reader)
