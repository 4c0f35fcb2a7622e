"""`python -m pipeline` is `tactile-marks`."""

from __future__ import annotations

import sys

if __name__ == "__main__":  # workers import this module, too, and need nothing of the command
    from pipeline.cli.main import main

    sys.exit(main())
