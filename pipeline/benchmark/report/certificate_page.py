"""The page of a certificate: its statement, its evidence, and its scope."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pipeline.benchmark.report.page import render
from pipeline.common.output_paths import write_text
from pipeline.reading.certificate import Certificate
from recognition.decision.accepted_risk import Shown
from recognition.decision.likeness import LEAST_PARTS, P_VALUE, KindOfParts


def write_certificate_page(certificate: Certificate, path: Path) -> None:
    """Write the page.

    Args:
        certificate: of which.
        path: of the page.

    Raises:
        FileError: the file cannot be written.
    """
    page = render(
        "certificate.html.j2",
        title="Certificate of acceptance",
        c=certificate,
        tests=[test for test in certificate.tests if test.shown is not Shown.NOT_TESTED],
        measures=_spread(certificate.kind),
        p_value=P_VALUE,
        least_parts=LEAST_PARTS,
    )
    write_text(path, page)


def _spread(kind: KindOfParts) -> list[tuple[str, list[str]]]:
    """Every measure with its 5th, 50th and 95th percentile."""
    return [
        (name.value, [f"{v:.4g}" for v in np.percentile(values, [5, 50, 95])])
        for name, values in kind.values.items()
    ]
