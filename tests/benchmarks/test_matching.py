"""Matching against the matrix products that it stands for: pytest -m benchmark -n 0."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.benchmark

MOST_PRODUCTS = 3.0


def test_matching_costs_at_most_three_matrix_products() -> None:
    """Threads are counted when numpy is loaded, so this is a process of its own."""
    one = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL", "NUMBA")}
    told = subprocess.run(
        [sys.executable, str(Path(__file__).with_name("matching.py"))],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, **one, "PYTHONPATH": str(Path(__file__).parents[2])},
    ).stdout
    ratios = [float(line.rsplit(" ", 1)[1]) for line in told.splitlines()]
    assert len(ratios) == 2
    assert max(ratios) <= MOST_PRODUCTS, told
