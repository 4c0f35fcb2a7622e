"""Metrics of the service for Prometheus."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram

_NAMESPACE = "tactile_marks"
_SECONDS = (0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 30.0, 60.0)


class Metrics:
    """Counters of one service; each service has a registry of its own."""

    def __init__(self) -> None:
        self.registry = CollectorRegistry()
        counter = partial(Counter, namespace=_NAMESPACE, registry=self.registry)
        histogram = partial(Histogram, namespace=_NAMESPACE, registry=self.registry, buckets=_SECONDS)
        self.requests = counter("http_requests", "Requests answered.", ("method", "route", "status"))
        self.request_seconds = histogram(
            "http_request_seconds",
            "Duration of a request, from its head to the end of the answer.",
            ("route",),
        )
        self.parts = counter("parts", "Parts read, by the state that they got.", ("state",))
        self.readings = counter("readings", "Readings made.", ("source", "decision"))
        self.reading_seconds = histogram(
            "reading_seconds", "Duration of a reading in its worker.", ("source",)
        )
        self.reviews = counter("reviews", "Reviews by people.", ("action",))
        self.refused = counter("refused", "Parts refused at a full queue.")
        self.serial_alarms = counter(
            "serial_alarms", "Serials read with certainty that fail a duplicate, order or sequence check."
        )
        self.lost_workers = counter("workers_lost", "Workers that died or took too long for a part.")

    def gauge(self, name: str, text: str, value: Callable[[], float]) -> None:
        Gauge(name, text, namespace=_NAMESPACE, registry=self.registry).set_function(value)
