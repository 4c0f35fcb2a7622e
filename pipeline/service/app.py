"""The service: everything that answers, put together and taken apart again in the right order."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import AsyncIterator, Callable
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import structlog
from fastapi import FastAPI, Request
from fastapi.responses import Response
from starlette.middleware.trustedhost import TrustedHostMiddleware
from uvicorn.middleware.proxy_headers import ProxyHeadersMiddleware

from glyphs.errors import FileError
from pipeline.common.private import private_folder
from pipeline.common.serial_rules import SerialRules
from pipeline.common.settings import SettingsError
from pipeline.common.version import program_version
from pipeline.formats.order_file import read_order
from pipeline.formats.touch_file import Limits
from pipeline.reading.bench_watch import ALERT as BENCH_ALERT
from pipeline.reading.warm_up import warm_up
from pipeline.service.alerts import AlertWatch
from pipeline.service.api.answers import problems
from pipeline.service.api.export import export_router
from pipeline.service.api.golden import golden_router
from pipeline.service.api.jobs import jobs_router
from pipeline.service.api.lookup import lookup_router
from pipeline.service.api.parts import parts_router
from pipeline.service.glyph_databases import GlyphDatabases
from pipeline.service.golden import GoldenPart
from pipeline.service.job_folder import JobFolder
from pipeline.service.metrics import CONTENT_TYPE_LATEST, Metrics
from pipeline.service.pages.frame import Frame
from pipeline.service.pages.routes import pages_router
from pipeline.service.part_service import PartService
from pipeline.service.ports import Ports
from pipeline.service.reading_orders import ReadingOrders, called_by
from pipeline.service.review_policy import ReviewPolicy
from pipeline.service.stage.devices import Camera, FolderCamera, NoCamera, NoStage, SimulatedStage, Stage
from pipeline.service.stage.stage_driver import load_driver
from pipeline.service.stage_work import CameraWork, StageWork
from pipeline.service.web.access import Access
from pipeline.service.web.door import DoorLayer
from pipeline.service.web.middleware import RequestLayer
from pipeline.service.web.openapi import described
from pipeline.service.web.problem import Problem, without_folders
from pipeline.service.web.problem_responses import add_problem_handlers
from pipeline.service.web.uploads import SMALL_BODY
from pipeline.store.evidence_folder import EvidenceFolder
from pipeline.store.store import Store, StoreError
from pipeline.store.sweep_clock import SweepClock
from pipeline.workers.pool import WorkPool

if TYPE_CHECKING:
    from pipeline.common.settings import ReadSettings
    from pipeline.service.settings import ServiceSettings

SWEEP_EVERY_S = 3600.0
RECHECK_EVERY_S = 1.0
"""Between looks at jobs and glyph databases that were of no use."""
CHECK_S = 10.0
"""A job may take to be checked; most take a tenth of a second."""
LOOK_S = 0.05
"""Between looks at workers that warm up."""
ORPHAN_AGE_S = 3600.0
"""A file that no record names is left alone for so long: its transaction may be on the way."""
KEYS_KEPT_DAYS = 7.0
"""A request that is sent again later makes a new part."""
log = structlog.get_logger("tactile-marks")


class Service:
    """One running service and all that it holds open."""

    def __init__(
        self, settings: ServiceSettings, reading: ReadSettings, *, started_s: float | None = None
    ) -> None:
        """Open store and folders, and begin to warm up the workers.

        Args:
            settings: of the service.
            reading: how parts are read.
            started_s: when the program was started, by the monotonic clock; now unless given.

        Raises:
            StoreError: a store that cannot be opened.
            FileError: folders that cannot be made, a certificate that is none, a job that cannot be used.
            SettingsError: a certificate that does not hold for this program and these settings, a watched folder's job
                that is not there.
            ValueError: settings that cannot be.
        """
        self.settings = settings
        self._started_s = time.monotonic() if started_s is None else started_s
        self._said = ""
        self.evidence = EvidenceFolder(settings.evidence_folder)
        self.sweeps = SweepClock(settings.evidence_folder / "swept")
        self.store = Store.open(settings.store_url)
        self.metrics = Metrics()
        self.access = Access(self.store, required=settings.tokens_asked, own_user=settings.tokens == "auto")
        self.databases = GlyphDatabases(settings.databases_folder, default=reading.database)
        self.jobs = JobFolder(
            settings.job_files,
            own=reading,
            databases=self.databases,
            needed=settings.watch_job,
            call=self._call_worker,
        )
        if settings.watch_job:
            self._check_job(settings.watch_job)
        limits = Limits(
            max_photo_pixels=settings.max_photo_pixels,
            max_map_samples=settings.max_map_samples,
        )
        self.pool = WorkPool(
            settings.jobs,
            queue=settings.queue,
            timeout_s=settings.part_timeout_s,
            memory_mb=settings.worker_memory_mb,
            warm_up=partial(warm_up, reading, limits),
        )
        self.ports = Ports(settings)
        self.policy = ReviewPolicy(2 if settings.second_reader else 1, settings.audit_per_thousand / 1000.0)
        orders = ReadingOrders(
            evidence=self.evidence,
            pool=self.pool,
            databases=self.databases.path,
            settings=self.jobs.settings,
            limits=limits,
            metrics=self.metrics,
        )
        self.parts = PartService(
            store=self.store,
            evidence=self.evidence,
            orders=orders,
            stage=StageWork(
                _stage(settings), orders, active=settings.active_stage, timeout_s=settings.stage_timeout_s
            ),
            camera=CameraWork(_camera(settings), timeout_s=settings.camera_timeout_s),
            metrics=self.metrics,
            line=settings.line,
            touch_wait_s=settings.touch_wait_s,
            targets=tuple(self.ports.senders),
            watch=self.jobs.watch,
            shadow=settings.shadow,
            rules=SerialRules(
                settings.duplicates,
                settings.sequence_jump,
                None if settings.order is None else read_order(settings.order),
            ),
            policy=self.policy,
        )
        self.metrics.gauge("jobs_waiting", "Parts that wait for a worker.", lambda: self.pool.waiting)
        self.metrics.gauge("jobs_running", "Parts that workers are at.", lambda: self.pool.running)
        self.metrics.gauge("workers_ready", "1 while parts can be read.", lambda: float(self.pool.ready()))
        if self.jobs.watched:
            self.metrics.gauge(
                "drift", "1 while parts are unlike the certified ones.", lambda: float(bool(self.jobs.drift))
            )
        self.metrics.gauge(
            "bench_fault",
            "1 while felt parts show a fault of whiskers or bench.",
            lambda: float(bool(self.parts.bench.message())),
        )
        self.golden = GoldenPart(
            self.store, orders, relief=settings.golden, every_h=settings.golden_every_h, line=settings.line
        )
        self.alerts = AlertWatch(
            self.store,
            settings,
            drifts=self.jobs.drifts,
            others=lambda: {**self.golden.faults(), BENCH_ALERT: self.parts.bench.told()},
            targets=tuple(self.ports.senders),
            sent=lambda: self.parts.on_result(),
        )
        self.metrics.gauge("alerts", "Alerts that are raised.", lambda: float(len(self.store.alerts())))
        self.metrics.gauge(
            "targets_troubled",
            "Targets of results that cannot be reached or refuse results.",
            lambda: float(sum(not one.works for one in self.ports.connections(self.store))),
        )
        self.metrics.gauge("outbox", "Results not yet published.", self.store.undelivered)

    def _call_worker(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """What a function returns that a worker calls, for a thread that may wait."""
        return called_by(self.pool, function, *arguments, timeout_s=CHECK_S)

    def _check_job(self, name: str) -> None:
        try:
            self.jobs.settings(name)
        except Problem as problem:
            raise SettingsError(f"watch_job: {problem.detail}") from problem

    def why_not_ready(self) -> str:
        """What keeps it from reading parts, without paths: it is asked without a token. Empty where nothing does."""
        why = self._why_not_ready()
        if why not in ("", self._said):
            log.warning("not ready", why=why)
        self._said = why
        return without_folders(why)

    def _why_not_ready(self) -> str:
        if self.parts.draining:
            return "the service is stopping"
        try:
            self.store.ping()
        except StoreError as error:
            log.error("store", why=str(error))
            return "the store does not answer; the service's log says why"
        try:
            self.evidence.check_room()
        except FileError as error:
            return f"a file {error.what}; {error.hint}"
        orders = self.parts.orders
        trouble = self.parts.stage.trouble or self.parts.camera.trouble
        trouble = trouble or orders.trouble("") or orders.trouble(self.settings.watch_job)
        return trouble or ("" if self.pool.ready() else self.pool.trouble or "the workers are warming up")

    def drain(self) -> None:
        """Take no more parts, and say so at /readyz; what is at work goes on."""
        self.parts.draining = True

    def sweep(self) -> None:
        """Throw away files that no record names, and those whose time is up; nothing where the clock has leapt."""
        latest = self.store.parts(limit=1)
        if not self.sweeps.may_sweep(latest[0].created_at if latest else None):
            return
        n = self.evidence.sweep(self.store, older_than_s=ORPHAN_AGE_S)
        expired = 0
        if self.settings.retention_days:
            before = datetime.now(UTC) - timedelta(days=self.settings.retention_days)
            expired = self.evidence.expire(self.store, before=before)
        self.store.forget_keys(datetime.now(UTC) - timedelta(days=KEYS_KEPT_DAYS))
        if n or expired:
            log.info("evidence swept", orphans=n, expired=expired)

    @contextlib.asynccontextmanager
    async def running(self, _: FastAPI | None = None) -> AsyncIterator[None]:
        """Everything that runs beside the requests."""
        works = [
            self._sweep_for_ever(),
            self._say_ready(),
            self._recheck_for_ever(),
            self.parts.touching.run(),
        ]
        if not self.settings.shadow:  # nothing is decided, so no rate of it says anything
            works.append(self.alerts.run())
        beside = [asyncio.create_task(work) for work in works]
        try:
            async with self.ports.opened(self.parts):
                yield
        finally:
            for task in beside:
                task.cancel()
            await asyncio.gather(*beside, return_exceptions=True)
            await self.parts.touching.stop()
            await asyncio.to_thread(self.close)

    def close(self) -> None:
        """End the workers and close the store."""
        self.pool.close(self.settings.shutdown_grace_s)
        self.store.close()

    async def _say_ready(self) -> None:
        while not self.pool.all_ready():
            await asyncio.sleep(LOOK_S)
        log.info("ready", seconds=round(time.monotonic() - self._started_s, 1), workers=self.settings.jobs)

    async def _recheck_for_ever(self) -> None:
        while True:
            await asyncio.sleep(RECHECK_EVERY_S)
            try:
                await self.parts.orders.recheck()
            except Exception:
                log.exception("look at what was of no use failed")

    async def _sweep_for_ever(self) -> None:
        while True:
            try:
                await asyncio.to_thread(self.sweep)
            except Exception:
                log.exception("sweep failed")
            await asyncio.sleep(SWEEP_EVERY_S)


def create_app(service: Service) -> FastAPI:
    """The web application of a service."""
    settings = service.settings
    app = FastAPI(
        title="tactile-marks",
        summary="Reads die-stamped serials: by camera first, by touch when the camera is unsure.",
        version=program_version(),
        license_info={"name": "Apache-2.0", "identifier": "Apache-2.0"},
        docs_url=None,  # its pages would load scripts from the internet; ours is pages.interface
        redoc_url=None,
        openapi_url="/openapi.json",
        lifespan=service.running,
        max_body_size=settings.max_upload_mb * 1_000_000,
        telemetry={"tracing": False, "metrics": False, "logs": False},
        redirect_slashes=False,
    )
    app.include_router(parts_router(service.parts, service.access, root_path=settings.root_path))
    app.include_router(golden_router(service.golden, service.parts.orders, service.access))
    app.include_router(export_router(service.store, service.access), max_body_size=SMALL_BODY)
    app.include_router(
        lookup_router(service.parts, service.access, root_path=settings.root_path), max_body_size=SMALL_BODY
    )
    app.include_router(jobs_router(service.jobs, service.access), max_body_size=SMALL_BODY)
    frame = Frame(
        service.store,
        service.evidence,
        service.access,
        review=service.parts.review,
        undo=service.parts.undo_review,
        policy=service.policy,
        shadow=settings.shadow,
        outside_format=service.parts.orders.outside_format,
    )
    app.state.problem_page = frame.refusal
    pages = pages_router(
        frame,
        drift=lambda: service.jobs.drift,
        golden=service.golden.scans,
        connections=lambda: service.ports.connections(service.store),
        jobs=service.jobs,
        interface=lambda: app.openapi(),
    )
    app.include_router(pages, max_body_size=SMALL_BODY)
    _add_service_routes(app, service)
    add_problem_handlers(app)
    app.openapi = lambda: described(app, asked=service.access.required, root_path=settings.root_path)  # type: ignore[method-assign]
    # the last one lies outermost
    app.add_middleware(TrustedHostMiddleware, allowed_hosts=_names(settings), www_redirect=False)
    if settings.trusted_proxies:
        app.add_middleware(ProxyHeadersMiddleware, trusted_hosts=list(settings.trusted_proxies))
    app.add_middleware(
        DoorLayer,
        access=service.access,
        proxies=settings.trusted_proxies,
        busy=lambda: service.parts.orders.busy,
        refused=service.metrics.refused.inc,
        most_bytes=settings.max_upload_mb * 1_000_000,
    )
    app.add_middleware(RequestLayer, metrics=service.metrics, root_path=settings.root_path)
    return app


def _names(settings: ServiceSettings) -> tuple[str, ...]:
    """Names that the service answers to; any where tokens are asked for and no list is given."""
    if settings.tokens_asked and not settings.hosts:
        return ("*",)
    names = (*settings.hosts, settings.host, "localhost", "127.0.0.1", "::1")
    return tuple(f"[{name}]" if ":" in name and not name.startswith("[") else name for name in names)


def _add_service_routes(app: FastAPI, service: Service) -> None:
    @app.get(
        "/healthz", tags=["service"], summary="Whether the service is alive", response_model=dict[str, str]
    )
    async def healthz() -> Any:
        return {"status": "alive"}

    @app.get(
        "/readyz",
        tags=["service"],
        summary="Whether parts can be read",
        response_model=dict[str, str],
        responses={503: {**problems(503)[503], "description": "not yet; the detail says why"}},
    )
    def readyz() -> Any:
        why = service.why_not_ready()
        if why:
            raise Problem(503, why, headers={"Retry-After": "1"})
        mode = {"mode": "shadow"} if service.settings.shadow else {}
        troubles = service.parts.orders.troubles
        targets = [
            one for one in service.ports.connections(service.store) if one.key in service.ports.senders
        ]
        return {
            "status": "ready" if all(one.works for one in targets) else "degraded",
            **mode,
            **{one.key: one.summary for one in targets},
            **({"drift": service.jobs.drift or "none"} if service.jobs.watched else {}),
            **({"bench": service.parts.bench.message() or "none"} if service.parts.bench.parts else {}),
            **({"of_no_use": without_folders("; ".join(troubles.values()))} if troubles else {}),
            **({"sweep": service.sweeps.trouble} if service.sweeps.trouble else {}),
        }

    @app.get(
        "/metrics",
        tags=["service"],
        summary="Numbers for Prometheus",
        response_class=Response,
        responses={200: {"content": {"text/plain": {}}}},
    )
    def metrics() -> Any:
        return Response(service.metrics.page(), media_type=CONTENT_TYPE_LATEST)

    @app.get(
        "/v1/databases",
        tags=["service"],
        summary="Glyph databases that a part may be read with",
        response_model=list[dict[str, Any]],
        responses=problems(401, 403),
    )
    def databases(request: Request) -> Any:
        from pipeline.common.records import Scope

        service.access.caller(request, Scope.READ)
        return service.databases.listed()


def _stage(settings: ServiceSettings) -> Stage:
    if settings.stage_driver:
        driver: Stage = load_driver(
            settings.stage_driver, verbs=("open", "feel") if settings.active_stage else ("feel",)
        )
        return driver
    if settings.bench is not None:
        from pipeline.bench.settings import read_bench
        from pipeline.service.stage.bench_stage import BenchStage

        return BenchStage(read_bench(settings.bench))
    return NoStage() if settings.stage is None else SimulatedStage(_there(settings.stage, "height maps"))


def _camera(settings: ServiceSettings) -> Camera:
    if settings.camera_driver:
        driver: Camera = load_driver(settings.camera_driver, verbs=("take",))
        return driver
    return NoCamera() if settings.camera is None else FolderCamera(_there(settings.camera, "photographs"))


def _there(folder: Path, what: str) -> Path:
    """The folder of a simulated device.

    Raises:
        FileError: there is none.
    """
    if not folder.is_dir():
        raise FileError(folder, "is no folder", f"name the folder of the parts' {what}, or make it first")
    return folder


def check_folder(settings: ServiceSettings) -> Path:
    """Make the service's folder, and in it those for glyph databases and jobs.

    Raises:
        FileError: it cannot be made.
    """
    try:
        private_folder(settings.folder)
        if settings.databases is None:
            settings.databases_folder.mkdir(exist_ok=True)
        if settings.jobs_folder is None:
            settings.job_files.mkdir(exist_ok=True)
    except OSError as error:
        raise FileError(
            settings.folder, f"cannot be made ({error.strerror})", "name another with --folder"
        ) from error
    return settings.folder
