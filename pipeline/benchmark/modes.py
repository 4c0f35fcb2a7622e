"""The modes that are compared: each reads the same part with its own senses."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from pipeline.benchmark.mode import ModeReader, Readers, Senses
from pipeline.common.settings import SettingsError

if TYPE_CHECKING:
    from recognition.reading import Reading


class TactileMode:
    """Touch alone."""

    uses: tuple[str, ...] = ("touch",)

    def __init__(self, readers: Readers) -> None:
        _ = readers.touch  # a font that cannot be used is told before the run

    def read(self, senses: Senses) -> Reading:
        """What was felt."""
        return senses.felt.reading


class VisionMode:
    """The camera alone."""

    uses: tuple[str, ...] = ("vision",)

    def __init__(self, readers: Readers) -> None:
        _ = readers.vision

    def read(self, senses: Senses) -> Reading:
        """What was seen."""
        return senses.seen.reading


class FusedMode:
    """Touch and camera."""

    uses: tuple[str, ...] = ("touch", "vision")

    def __init__(self, readers: Readers) -> None:
        _ = readers.touch, readers.vision
        self.settings = readers.touch.settings

    def read(self, senses: Senses) -> Reading:
        """What was felt and seen, together."""
        from recognition.fuse import fuse

        return fuse(senses.felt, senses.seen, self.settings)


def _peer(engine: str, sense: str) -> Callable[[Readers], ModeReader]:
    def make(readers: Readers) -> ModeReader:
        from pipeline.benchmark.peers import open_peer

        return open_peer(engine, sense, mask=readers.settings.mask)

    return make


MODES: dict[str, Callable[[Readers], ModeReader]] = {
    "tactile": TactileMode,
    "vision": VisionMode,
    "fused": FusedMode,
}
"""The project's own modes by name."""
PEERS: dict[str, Callable[[Readers], ModeReader]] = {
    f"{engine} {sense}": _peer(engine, sense)
    for engine in ("rapidocr", "tesseract")
    for sense in ("photo", "touch")
}
"""Programs of others on the same parts, by name."""


def open_mode(name: str, readers: Readers) -> ModeReader:
    """The mode of that name.

    Raises:
        ModeUnavailableError: it cannot run here.
        SettingsError: no such mode, or a font or mask it cannot use.
    """
    makers = {**MODES, **PEERS}
    if name not in makers:
        raise SettingsError(f"there is no mode {name!r}", hint=f"the modes are {', '.join(MODES)}")
    return makers[name](readers)
