"""A National Instruments card as converter, through nidaqmx and the NI-DAQmx driver. The stage's spare output is wired
to an analogue input beside the whiskers', so one task samples all with one clock."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any

import numpy as np

from glyphs.errors import MissingExtraError
from pipeline.bench.sampling import Record
from pipeline.bench.settings import DaqSettings
from whisker_array.scan.stage_error import StageError

_BUFFER_S = 60.0  # of the driver's buffer, more than any pass takes
_SYNC_V = 1.5  # above which the output is set: half of 3.3 V, and well below 5 V
_CLIPPED = 0.999


class NiDaq:
    """The card."""

    def __init__(self, settings: DaqSettings) -> None:
        """Make the task. Raises MissingExtraError: nidaqmx is not installed. StageError: no driver or card."""
        try:
            import nidaqmx
            from nidaqmx.constants import AcquisitionType
        except ModuleNotFoundError as error:
            raise MissingExtraError("an NI card", "nidaqmx", "nidaqmx") from error
        self._settings = settings
        self._errors: tuple[type[Exception], ...] = (nidaqmx.errors.Error,)
        self._task: Any = None
        with self._refusals_reported():
            self._task = nidaqmx.Task()
            rows = self._task.ai_channels
            for channels in (settings.channels, settings.sync_channel):
                rows.add_ai_voltage_chan(channels, min_val=-settings.range_v, max_val=settings.range_v)
            self._task.timing.cfg_samp_clk_timing(
                settings.rate_hz,
                sample_mode=AcquisitionType.CONTINUOUS,
                samps_per_chan=round(_BUFFER_S * settings.rate_hz),
            )
            self.whiskers = int(self._task.number_of_channels) - 1
            self._rate_hz = float(self._task.timing.samp_clk_rate)

    def describe(self) -> str:
        return f"{self._settings.channels} by NI-DAQmx, {self.whiskers} channels at {self._rate_hz:g} Hz"

    def start(self) -> None:
        with self._refusals_reported():
            self._task.start()

    def stop(self) -> Record:
        """Stop sampling and return all samples. Raises StageError: the driver reports an error."""
        from nidaqmx.constants import READ_ALL_AVAILABLE

        with self._refusals_reported():
            rows = np.asarray(
                self._task.read(READ_ALL_AVAILABLE, timeout=self._settings.answer_s), dtype=np.float64
            )
            self._task.stop()
        volts = rows[:-1].T
        return Record(
            volts=volts,
            sync=rows[-1] > _SYNC_V,
            rate_hz=self._rate_hz,
            clipped=np.abs(volts) >= _CLIPPED * self._settings.range_v,
        )

    def close(self) -> None:
        if self._task is not None:
            with contextlib.suppress(*self._errors):
                self._task.close()
            self._task = None

    @contextlib.contextmanager
    def _refusals_reported(self) -> Iterator[None]:
        try:
            yield
        except self._errors as error:
            self.close()
            what = " ".join(str(error).split())[:200]
            raise StageError(f"the card refuses ({what})", "see [daq] of the bench and NI MAX") from error
