"""Certificates as labelled parts would earn them, without reading any."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.common.accepted_risk import proven_threshold, threshold_tests
from pipeline.common.settings import ReadSettings
from pipeline.common.version import reader_versions
from pipeline.reading.certificate import Certificate, settings_described, write_certificate
from pipeline.reading.certificate_statistics import KindOfParts
from recognition.decide.score import Measure


def measured(n: int, *, rough_um: float = 1.0, seed: int = 1) -> list[dict[Measure, float]]:
    """Parts whose land is so rough, give or take a fifth."""
    rng = np.random.default_rng(seed)
    return [{Measure.FINE: float(rough_um * rng.lognormal(0.0, 0.2))} for _ in range(n)]


def a_certificate(settings: ReadSettings | None = None, **changed: Any) -> Certificate:
    """Of 40 parts, 30 of which were accepted from 0.99, none of them wrong."""
    tests = threshold_tests([0.992] * 30, [True] * 30, risk=0.1, confidence=0.95, thresholds=(0.999, 0.99))
    chosen = proven_threshold(tests)
    fields = {
        "made_at": datetime(2026, 1, 2, 3, 4, tzinfo=UTC),
        "risk": 0.1,
        "confidence": 0.95,
        "threshold": chosen.threshold,
        "sources": ("tactile",),
        "parts": 40,
        "accepted": chosen.accepted,
        "wrong": chosen.wrong,
        "bound": chosen.bound,
        "tests": tests,
        "kind": KindOfParts.of(measured(40)),
        "data_sha256": "0" * 64,
        "settings": settings_described(settings or ReadSettings()),
        "versions": reader_versions(),
    }
    return Certificate(**{**fields, **changed})


def written(path: Path, settings: ReadSettings | None = None, **changed: Any) -> Path:
    """The same in a file."""
    write_certificate(a_certificate(settings, **changed), path)
    return path
