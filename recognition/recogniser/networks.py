"""Open networks whose threads do not spin while they wait: that would slow other programs on a shared machine."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any


def open_network(path: Path, *, threads: int = 1) -> Any:
    """Open a session of an ONNX file on the CPU."""
    # set before the import: from 1.29 on the library otherwise sends telemetry and stores a device number
    os.environ["ORT_DISABLE_TELEMETRY"] = "1"
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = threads
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.log_severity_level = 4
    return onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
