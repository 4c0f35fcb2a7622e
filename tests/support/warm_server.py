"""What the server of forked workers has done before it forks: loaded all libraries and kernels, by reading a part."""

from __future__ import annotations

import gc
import os

from pipeline.common.settings import Limits, ReadSettings
from pipeline.reading.warm_up import warm_up

warm_up(ReadSettings(format=("A9",), font=("gothic",), height_mm=4.0), Limits())
gc.freeze()  # shared by all workers for as long as nobody looks at it
if len(os.listdir("/proc/self/task")) > 1:
    raise RuntimeError("a thread of this process would be missing in those that are forked from it")
