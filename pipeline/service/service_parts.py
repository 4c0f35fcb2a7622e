"""What routes and pages need of the service."""

from __future__ import annotations

from typing import Protocol

from pipeline.service.connections import Connection
from pipeline.service.golden import GoldenPart
from pipeline.service.intake import Intake
from pipeline.service.job_folder import JobFolder
from pipeline.service.reviews import Reviews
from pipeline.service.settings import ServiceSettings
from pipeline.service.web.access import Access
from pipeline.store.evidence_folder import EvidenceFolder
from pipeline.store.store import Store


class ServiceParts(Protocol):
    """The parts of a service (`app.Service`)."""

    settings: ServiceSettings
    store: Store
    evidence: EvidenceFolder
    access: Access
    intake: Intake
    reviews: Reviews
    jobs: JobFolder
    golden: GoldenPart

    def connections(self) -> tuple[Connection, ...]:
        """The connections to other systems as they are now."""
