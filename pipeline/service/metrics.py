"""What the service counts, for Prometheus."""

from __future__ import annotations

from collections.abc import Callable

from prometheus_client import (
    CONTENT_TYPE_LATEST,
    CollectorRegistry,
    Counter,
    Gauge,
    Histogram,
    generate_latest,
)

__all__ = ["CONTENT_TYPE_LATEST", "Metrics"]

_SECONDS = (0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 30.0, 60.0)


class Metrics:
    """Counters of one service; each service has a registry of its own."""

    def __init__(self) -> None:
        registry = self.registry = CollectorRegistry()
        self.requests = Counter(
            "tactile_marks_http_requests",
            "Requests answered.",
            ("method", "route", "status"),
            registry=registry,
        )
        self.request_seconds = Histogram(
            "tactile_marks_http_request_seconds",
            "From the request's head to the end of the answer.",
            ("route",),
            buckets=_SECONDS,
            registry=registry,
        )
        self.parts = Counter(
            "tactile_marks_parts", "Parts read, by how far that took them.", ("state",), registry=registry
        )
        self.readings = Counter(
            "tactile_marks_readings", "Readings made.", ("source", "decision"), registry=registry
        )
        self.reading_seconds = Histogram(
            "tactile_marks_reading_seconds",
            "Time that a reading took in its worker.",
            ("source",),
            buckets=_SECONDS,
            registry=registry,
        )
        self.reviews = Counter("tactile_marks_reviews", "Reviews by people.", ("action",), registry=registry)
        self.refused = Counter("tactile_marks_refused", "Parts refused at a full queue.", registry=registry)
        self.serial_alarms = Counter(
            "tactile_marks_serial_alarms", "Serials read surely that others speak against.", registry=registry
        )
        self.lost_workers = Counter(
            "tactile_marks_workers_lost", "Workers that died or took too long over a part.", registry=registry
        )
        self._registry = registry

    def gauge(self, name: str, text: str, value: Callable[[], float]) -> None:
        """Tell a value that is looked up whenever somebody asks."""
        Gauge(f"tactile_marks_{name}", text, registry=self._registry).set_function(value)

    def page(self) -> bytes:
        """All of it in Prometheus' text format."""
        return generate_latest(self._registry)
