"""Build, start and stop the service, and its inputs and outputs beside HTTP."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import AsyncIterator, Callable, Coroutine
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import structlog
from fastapi import FastAPI

from glyphs.errors import FileError
from pipeline.common.private import private_folder
from pipeline.common.settings import SettingsError
from pipeline.reading.bench_watch import ALERT as BENCH_ALERT
from pipeline.reading.warm_up import warm_up
from pipeline.service.connections import log_failed_accepts_sparingly
from pipeline.service.golden import GoldenPart
from pipeline.service.intake import Intake
from pipeline.service.jobs import GlyphDatabases, JobFolder
from pipeline.service.metrics import Metrics
from pipeline.service.outputs.dispatch import Connection, Dispatcher, Sender
from pipeline.service.tasks import end_tasks, repeat
from pipeline.service.web.access import Access
from pipeline.service.web.problem import Problem, without_folders
from pipeline.service.worker_calls import WorkerCalls
from pipeline.store.alerts import REJECT_RATE, REVIEW_RATE
from pipeline.store.errors import StoreError, UnwritableError
from pipeline.store.evidence_folder import EvidenceFolder, SweepClock
from pipeline.store.store import Store
from pipeline.workers.machine import Machine
from pipeline.workers.options import PoolSettings
from pipeline.workers.pool import WorkPool

if TYPE_CHECKING:
    from pipeline.common.records import PartRecord
    from pipeline.common.settings import ReadSettings
    from pipeline.service.inputs.watch_folder import WatchedFolder
    from pipeline.service.settings import ServiceSettings

log = structlog.get_logger("tactile-marks")
SWEEP_EVERY_S = 3600.0
# Seconds between checks of jobs and glyph databases that were unusable.
RECHECK_EVERY_S = 1.0
LOOK_AT_WORKERS_S = 0.05
LOOK_AT_TOUCH_S = 1.0
# Seconds between looks for alerts; a window of parts takes longer.
LOOK_FOR_ALERTS_S = 5.0
# Longest time of a check of readiness, s: shorter than the usual patience of those who ask.
READY_S = 2.0
# Age, s, at which a file that no record names is removed; a younger one may belong to a running transaction.
ORPHAN_AGE_S = 3600.0
# Days after which a request that is sent again makes a new part.
KEYS_KEPT_DAYS = 7.0
# Days after which a file that has left the watched folder, and comes back unchanged, makes a new part.
FILE_KEYS_KEPT_DAYS = 90.0
# Least seconds after which a worker gives up a part; twice its limit_s if that is more.
PART_TIMEOUT_S = 120.0
# Seconds that running requests have to end, and results to be sent, when the service stops.
GRACE_S = 20.0
SEND_GRACE_S = 10.0


# Latest parts from which the rates of an alert are computed.
ALERT_WINDOW = 200


class Input(Protocol):
    """Bring parts to the intake; `title` is its name in the log, `trouble` says why it brings none."""

    title: str
    trouble: str

    async def start(self) -> dict[str, object]:
        """Start; return its address or folder for the log. Raise OSError for an address that is not available."""

    async def stop(self, *, grace_s: float) -> None:
        """Stop; parts being read get `grace_s`."""


class Ports:
    """Inputs and the dispatcher of one service."""

    def __init__(self, settings: ServiceSettings, intake: Intake, *, most_bytes: int, at_once: int) -> None:
        self._intake = intake
        senders: dict[str, Sender] = {}
        if settings.webhook.url:
            from pipeline.service.outputs.webhook import WebhookSender

            senders["webhook"] = WebhookSender(settings.webhook)
        if settings.mqtt.url:
            from pipeline.service.inputs.mqtt_calls import MqttCalls
            from pipeline.service.outputs.mqtt import MqttSender

            senders["mqtt"] = MqttSender(settings.mqtt, MqttCalls(intake).answer)
        intake.targets = () if settings.shadow else tuple(senders)
        self._dispatcher = Dispatcher(intake.store, senders)
        self._inputs: dict[str, Input] = {}
        self._watched: WatchedFolder | None = None
        self._on_review: Callable[[PartRecord], Coroutine[None, None, None]] | None = None
        self._open: list[Connection] = []
        if settings.tcp.port is not None:
            from pipeline.service.inputs.tcp import TcpPort

            self._inputs["tcp"] = TcpPort(settings.tcp, intake)
        if settings.opcua.port is not None:
            from pipeline.service.inputs.opcua import OpcUaPort

            self._inputs["opcua"] = opcua = OpcUaPort(settings.opcua_server, intake)
            intake.on_part, self._on_review = opcua.show, opcua.tell
        if settings.watch.folder is not None:
            from pipeline.service.inputs.watch_folder import WatchedFolder

            self._inputs["watch"] = self._watched = WatchedFolder(
                settings.watch, intake, most_bytes=most_bytes, at_once=at_once
            )

    @property
    def trouble(self) -> str:
        return "; ".join(port.trouble for port in self._inputs.values() if port.trouble)

    def renew_keys(self, *, before: datetime) -> bool:
        """Renew the keys of files as in `WatchedFolder`; return whether those of other files may be forgotten."""
        return self._watched is None or self._watched.renew_keys(before=before)

    def connections(self) -> tuple[Connection, ...]:
        states = self._dispatcher.states
        waiting = self._intake.store.waiting_results() if states else {}
        targets = (replace(state, waiting=waiting.get(target)) for target, state in states.items())
        return (*targets, *self._open)

    @contextlib.asynccontextmanager
    async def opened(self) -> AsyncIterator[None]:
        """Open the inputs and send waiting results; on leaving, running work may finish. Raises OSError."""
        async with contextlib.AsyncExitStack() as stack:
            self._dispatcher.start()
            # threads add results and reviews as well
            loop, on_review = asyncio.get_running_loop(), self._on_review
            self._intake.on_result = partial(loop.call_soon_threadsafe, self._dispatcher.wake)
            if on_review is not None:
                self._intake.on_review = lambda part: asyncio.run_coroutine_threadsafe(on_review(part), loop)
            stack.push_async_callback(self._dispatcher.stop, grace_s=SEND_GRACE_S)
            for key, port in self._inputs.items():
                place = await port.start()
                stack.push_async_callback(port.stop, grace_s=GRACE_S)
                log.info(port.title, **place)
                if "port" in place:
                    address = f"{place['host']}:{place['port']}"
                    self._open.append(Connection(key, port.title, datetime.now(UTC), address))
            yield


class Service:
    """One running service with its open resources."""

    def __init__(
        self,
        settings: ServiceSettings,
        reading: ReadSettings,
        workers: PoolSettings | None = None,
        *,
        machine: Machine | None = None,
        started_s: float | None = None,
    ) -> None:
        """Open store and folders, and start to warm up the workers; `started_s` is by the monotonic clock. Raises
        StoreError, FileError: store, folder, certificate or job is unusable. SettingsError: settings contradict it."""
        self.settings = settings
        workers = workers or PoolSettings()
        machine = machine or Machine.of(workers.processes)
        self.upload_bytes = machine.upload_bytes
        self._started_s = time.monotonic() if started_s is None else started_s
        self._logged_why = ""
        self._checker = ThreadPoolExecutor(1)
        self._readiness: Future[tuple[str, dict[str, str]]] | None = None
        self.evidence = EvidenceFolder(settings.evidence_folder)
        self.sweeps = SweepClock(settings.evidence_folder / "swept")
        self.store = Store.open(settings.store_url)
        self.evidence.check_is_that_of(self.store)
        self.metrics = Metrics()
        self.access = Access(self.store, required=settings.tokens_asked, own_user=settings.tokens == "auto")
        self.jobs = JobFolder(
            settings.job_files,
            default=reading,
            databases=GlyphDatabases(settings.databases_folder, default=reading.database),
            needed=settings.watch.job,
            call=lambda *called: self.intake.calls.call_blocking(*called),
        )
        if settings.watch.job:
            try:
                self.jobs.settings(settings.watch.job)
            except Problem as problem:
                raise SettingsError(f"watch.job: {problem.detail}") from problem
        self.pool = WorkPool(
            workers.processes,
            queue=machine.waiting_parts,
            timeout_s=max(PART_TIMEOUT_S, 2.0 * (reading.limit_s or 0.0)),
            memory_mb=machine.worker_memory_mb,
            warm_up=partial(warm_up, reading, machine.files),
        )
        calls = WorkerCalls(self.pool, self.jobs, machine.files, self.metrics)
        self.intake = Intake(settings, store=self.store, evidence=self.evidence, calls=calls)
        self.ports = Ports(settings, self.intake, most_bytes=machine.upload_bytes, at_once=workers.processes)
        self.golden = GoldenPart(settings.golden, self.store, calls, line=settings.line_name)
        self._add_gauges()

    def _add_gauges(self) -> None:
        gauge, bench = self.metrics.gauge, self.intake.bench
        gauge("jobs_waiting", "Parts that wait for a worker.", lambda: self.pool.waiting)
        gauge("jobs_running", "Parts that workers are reading.", lambda: self.pool.running)
        gauge("workers_ready", "1 while parts can be read.", self.pool.ready)
        if self.jobs.drifts():
            gauge("drift", "1 while parts are unlike the certified ones.", lambda: bool(self.jobs.drift))
        gauge(
            "bench_fault",
            "1 while felt parts show a fault of whiskers or bench.",
            lambda: bool(bench.message()),
        )
        gauge("alerts", "Alerts that are raised.", lambda: len(self.store.alerts()))
        gauge(
            "targets_troubled",
            "Targets of results that cannot be reached or refuse results.",
            lambda: sum(bool(connection.why) for connection in self.ports.connections()),
        )
        gauge("outbox", "Results not yet published.", self.store.undelivered)

    async def readiness(self) -> tuple[str, dict[str, str]]:
        """Reason why parts cannot be read, without paths (empty if they can), and the answer of /readyz, within
        `READY_S`: one check runs at a time, and later callers wait for it."""
        if self._readiness is None or self._readiness.done():
            self._readiness = self._checker.submit(self._check_readiness)
        checked, _ = await asyncio.wait([asyncio.wrap_future(self._readiness)], timeout=READY_S)
        silent = f"store or disk have not answered for {READY_S:g} s: locked, or too busy"
        why, state = checked.pop().result() if checked else (silent, {})
        if why not in ("", self._logged_why):
            log.warning("not ready", why=why)
        self._logged_why = why
        return without_folders(why), state

    def _check_readiness(self) -> tuple[str, dict[str, str]]:
        why = self._why_not_ready()
        return why, {} if why else self.state()

    def _why_not_ready(self) -> str:
        intake = self.intake
        if intake.draining:
            return "the service is stopping"
        try:
            self.store.check_writable()
        except UnwritableError as error:
            return str(error)
        except StoreError as error:
            log.error("store", why=str(error))
            return "the store does not answer; the service's log says why"
        try:
            self.evidence.check_room()
        except FileError as error:
            return f"a file {error.what}; {error.hint}"
        trouble = intake.stage.thread.trouble or intake.camera.thread.trouble or self.ports.trouble
        trouble = trouble or intake.calls.trouble("") or intake.calls.trouble(self.settings.watch.job)
        return trouble or ("" if self.pool.ready() else self.pool.trouble or "the workers are warming up")

    def state(self) -> dict[str, str]:
        targets = [connection for connection in self.ports.connections() if not connection.address]
        bench, troubles = self.intake.bench, self.intake.calls.troubles
        answer = {
            "status": "ready" if not any(target.why for target in targets) else "degraded",
            "mode": "shadow" if self.settings.shadow else "",
            **{target.key: target.summary for target in targets},
            "drift": (self.jobs.drift or "none") if self.jobs.drifts() else "",
            "bench": (bench.message() or "none") if bench.parts else "",
            "unusable": without_folders("; ".join(troubles.values())),
            "touch": self.intake.touching.trouble,
            "sweep": self.sweeps.trouble,
        }
        return {name: text for name, text in answer.items() if text}

    def look_for_alerts(self) -> None:
        limits = self.settings.alerts
        raised = self.store.look_for_alerts(
            limits={REJECT_RATE: limits.reject_rate, REVIEW_RATE: limits.review_rate},
            window=ALERT_WINDOW,
            drifts=self.jobs.drifts(),
            others={
                **self.golden.faults(),
                BENCH_ALERT: self.intake.bench.status(),
                "watched_folder": self.ports.trouble,
            },
            targets=self.intake.targets,
        )
        for alert in raised:
            log.warning("alert", alert=alert.name, why=alert.message)
        self.intake.on_result()

    def drain(self) -> None:
        self.intake.draining = True

    def sweep(self) -> None:
        """Remove files that no record names, and expired ones; nothing if the clock has jumped."""
        latest = self.store.parts(limit=1)
        if not self.sweeps.may_sweep(latest[0].created_at if latest else None):
            return
        days, now, expired = self.settings.retention_days, datetime.now(UTC), 0
        if days:
            expired = self.store.expire_evidence(now - timedelta(days=days))
        n_removed = self.evidence.sweep(self.store, older_than_s=ORPHAN_AGE_S)
        renewed = self.ports.renew_keys(before=now - timedelta(days=1))
        self.store.forget_keys(
            now - timedelta(days=KEYS_KEPT_DAYS),
            files_before=now - timedelta(days=FILE_KEYS_KEPT_DAYS) if renewed else None,
        )
        if n_removed or expired:
            log.info("evidence swept", expired=expired, removed=n_removed)

    @contextlib.asynccontextmanager
    async def running(self, _: FastAPI | None = None) -> AsyncIterator[None]:
        log_failed_accepts_sparingly()
        works = [
            repeat("sweep", lambda: asyncio.to_thread(self.sweep), every_s=SWEEP_EVERY_S),
            repeat("check of what was unusable", self.intake.calls.recheck, every_s=RECHECK_EVERY_S),
            repeat("look at parts that wait for touch", self.intake.touching.look, every_s=LOOK_AT_TOUCH_S),
            self._say_ready(),
        ]
        if not self.settings.shadow:  # in shadow mode nothing is decided, so there are no rates
            look = partial(asyncio.to_thread, self.look_for_alerts)
            works.append(repeat("look for alerts", look, every_s=LOOK_FOR_ALERTS_S))
        try:  # before any call begins
            await self.intake.touching.begin()
        except StoreError as error:  # their own time limits end their wait
            log.error("store", why=str(error))
        beside = [asyncio.create_task(work) for work in works]
        try:
            async with self.ports.opened():
                yield
        finally:
            await end_tasks(beside)
            await self.intake.touching.stop()
            await asyncio.to_thread(self.close)

    def close(self) -> None:
        self._checker.shutdown(wait=False)
        self.pool.close(GRACE_S)
        self.store.close()

    async def _say_ready(self) -> None:
        while not self.pool.all_ready():
            await asyncio.sleep(LOOK_AT_WORKERS_S)
        seconds = round(time.monotonic() - self._started_s, 1)
        log.info("ready", seconds=seconds, workers=self.pool.workers)


def check_folder(settings: ServiceSettings) -> Path:
    """Make the service's folder, with subfolders for glyph databases and jobs. Raises FileError: it cannot be made."""
    try:
        private_folder(settings.folder)
        settings.databases_folder.mkdir(exist_ok=True)
        settings.job_files.mkdir(exist_ok=True)
    except OSError as error:
        raise FileError(
            settings.folder, f"cannot be made ({error.strerror})", "name another with --folder"
        ) from error
    return settings.folder
