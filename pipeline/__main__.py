"""`python -m pipeline` is `tactile-marks`."""

from __future__ import annotations

import sys

if __name__ == "__main__":  # worker processes import this module, too, and do not need the command line
    from pipeline.cli.main import main

    sys.exit(main())
