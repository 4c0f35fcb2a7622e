"""Metrics of the service for Prometheus."""

from __future__ import annotations

from collections.abc import Callable

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram

_SECONDS = (0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 30.0, 60.0)


class Metrics:
    """Counters of one service; each service has a registry of its own."""

    def __init__(self) -> None:
        self.registry = CollectorRegistry()
        self.requests = self._counter("http_requests", "Requests answered.", "method", "route", "status")
        self.request_seconds = self._histogram(
            "http_request_seconds", "Duration of a request, from its head to the end of the answer.", "route"
        )
        self.parts = self._counter("parts", "Parts read, by the state that they got.", "state")
        self.readings = self._counter("readings", "Readings made.", "source", "decision")
        self.reading_seconds = self._histogram(
            "reading_seconds", "Duration of a reading in its worker.", "source"
        )
        self.reviews = self._counter("reviews", "Reviews by people.", "action")
        self.refused = self._counter("refused", "Parts refused at a full queue.")
        self.serial_alarms = self._counter(
            "serial_alarms", "Serials read with certainty that fail a duplicate, order or sequence check."
        )
        self.lost_workers = self._counter("workers_lost", "Workers that died or took too long for a part.")

    def gauge(self, name: str, text: str, value: Callable[[], float]) -> None:
        Gauge(f"tactile_marks_{name}", text, registry=self.registry).set_function(value)

    def _counter(self, name: str, text: str, *labels: str) -> Counter:
        return Counter(f"tactile_marks_{name}", text, labels, registry=self.registry)

    def _histogram(self, name: str, text: str, *labels: str) -> Histogram:
        return Histogram(f"tactile_marks_{name}", text, labels, buckets=_SECONDS, registry=self.registry)
