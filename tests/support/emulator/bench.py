"""A whole emulated bench: a part on its plate, a controller, a converter, and settings that lead a driver to them."""

from __future__ import annotations

from types import TracebackType
from typing import Self

import numpy as np

from glyphs.surface.maps import HeightMap
from pipeline.bench.settings import BenchSettings
from tests.support.emulator.boards import EmulatedGrbl, EmulatedMarlin
from tests.support.emulator.daq import EmulatedDaq
from tests.support.emulator.firmware import Firmware
from tests.support.emulator.world import Amplifier, World

_RANGE_LAND_MOMENTS = 3.0
"""Range of the converter, in moments on the land. Gains in the bench file are ignored: the driver must find them."""
_GAIN_SD, _OFFSET_SD, _NOISE = 0.03, 0.01, 1e-4
"""Spread of gains; spread of offsets and noise, as shares of the converter's range; as in `draw_sensor_chain`."""


class EmulatedBench:
    """Emulated bench as a context manager; it runs within its `with` block.

    Attributes:
        settings: the settings given, with the pseudo-terminals' names as ports.
        world, stage, daq: its components.
    """

    def __init__(self, part: HeightMap, settings: BenchSettings, *, seed: int, pace: float = 0.0) -> None:
        """Put it together.

        Args:
            part: on the plate, its corner at (0, 0).
            settings: of the bench that it stands for.
            seed: of gains, offsets and noise.
            pace: seconds of ours for one of the bench; 0: as fast as may be.

        Raises:
            MapError: a part that cannot be felt.
        """
        rng = np.random.default_rng(seed)
        n, daq = settings.comb.n_whiskers, settings.daq
        nominal = daq.range_v / (_RANGE_LAND_MOMENTS * abs(settings.fitting().touch.land_moment_n_mm()))
        amplifier = Amplifier(
            gain_v_per_n_mm=nominal * (1.0 + _GAIN_SD * np.clip(rng.standard_normal(n), -3.0, 3.0)),
            offset_v=_OFFSET_SD * daq.range_v * rng.standard_normal(n),
        )
        self.world = World(part, settings, amplifier, pace=pace)
        made = {"grbl": EmulatedGrbl, "marlin": EmulatedMarlin}[settings.stage.firmware]
        self.stage: Firmware = made(self.world, settings.stage)
        self.daq = EmulatedDaq(
            self.world, whiskers=n, noise_v=_NOISE * daq.range_v, range_v=daq.range_v, seed=seed + 1
        )
        at = {"stage": self.stage.terminal.name, "daq": self.daq.terminal.name}
        self.settings = settings.model_copy(
            update={
                "stage": settings.stage.model_copy(update={"port": at["stage"]}),
                "daq": settings.daq.model_copy(update={"kind": "line", "port": at["daq"]}),
            }
        )

    def __enter__(self) -> Self:
        self.daq.start()
        self.stage.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stage.close()
        self.daq.close()
