"""The desk: takes parts in, has them read, keeps what came of it, and sends them on.

    photo, scan --> work folder --> worker: readings, pictures --> evidence folder --> store: one transaction --> answer

Nothing is answered before it is on the disk. What ends on the way, by a bad file or a lost machine, leaves no part;
the sender asks again, with the same idempotency key, and one part comes of it.
"""

from __future__ import annotations

import asyncio
import contextlib
import shutil
from collections.abc import Awaitable, Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import structlog

from glyphs.errors import FileError
from pipeline.common.part_id import new_part_id
from pipeline.common.records import (
    EvidenceKind,
    EvidenceRecord,
    PartRecord,
    PartState,
)
from pipeline.reading.job_reading import read_job
from pipeline.reading.jobs import Done, Job
from pipeline.reading.triage import state_after
from pipeline.service.idempotency import Once, Received
from pipeline.service.problem import Problem
from pipeline.service.stage import Camera, ScanOrder, SimulatedStage, Stage, StageError
from pipeline.service.uploads import Upload
from pipeline.store.store import IdempotencyKey, Store
from pipeline.workers.pool import BusyError, WorkerLostError

if TYPE_CHECKING:
    from pipeline.common.settings import ReadSettings
    from pipeline.reading.jobs import Limits
    from pipeline.service.metrics import Metrics
    from pipeline.store.evidence_folder import EvidenceFolder
    from pipeline.workers.pool import WorkPool

T = TypeVar("T")
log = structlog.get_logger("tactile-marks")


@dataclass(frozen=True)
class NewPart:
    """What is told of a part beside its files.

    Attributes:
        name: what the line calls it.
        expected: text that it should bear; empty where none is.
        database: name of the glyph database; empty for the service's own choice.
        touch: have the stage feel it at once where the camera is unsure.
    """

    name: str = ""
    expected: str = ""
    database: str = ""
    touch: bool = False


class PartService:
    """Takes parts in and has them read."""

    def __init__(
        self,
        *,
        store: Store,
        evidence: EvidenceFolder,
        pool: WorkPool,
        stage: Stage,
        camera: Camera,
        databases: Callable[[str], Path | None],
        reading: ReadSettings,
        limits: Limits,
        metrics: Metrics,
        targets: Sequence[str] = (),
    ) -> None:
        """Take what it works with.

        Args:
            store: where records are kept.
            evidence: where files are kept.
            pool: where parts are read.
            stage: feels what the camera is unsure of.
            camera: photographs a part when a trigger comes.
            databases: file of the glyph database of a name; raises Problem for one that is not there.
            reading: how parts are read.
            limits: of files.
            metrics: what is counted.
            targets: of results: webhook, mqtt; `on_result` is called when there is something for them,
                `on_part` with every part that was read.
        """
        self.store, self.evidence, self.pool, self.metrics = store, evidence, pool, metrics
        self.stage, self.camera = stage, camera
        self._databases, self._reading, self._limits = databases, reading, limits
        self._targets = tuple(targets)
        self.on_result: Callable[[], object] = lambda: None
        self.on_part: Callable[[PartRecord], Awaitable[None]] | None = None
        self._telling: set[asyncio.Future[None]] = set()
        self._once = Once(store)
        self._one_at_the_stage = asyncio.Lock()

    @property
    def busy(self) -> float | None:
        """Seconds after which to ask again, while no more parts are taken in; None while they are."""
        return self.pool.retry_after_s()

    async def receive(
        self,
        new: NewPart,
        *,
        photo: Upload | None = None,
        scan: Upload | None = None,
        idempotency: IdempotencyKey | None = None,
    ) -> Received:
        """Read a new part.

        Raises:
            Problem: nothing to read, files that cannot be used, no room in the queue, a key used for another request.
        """
        if photo is None and scan is None:
            raise Problem(
                422, "there is neither photo nor scan; send one of them, or both, as multipart/form-data"
            )

        async def work() -> PartRecord:
            part_id = new_part_id()
            done, kept = await self._read(
                {"photo": photo, "scan": scan}, name=new.name, expected=new.expected, database=new.database
            )
            state = state_after(done.readings[-1])
            part = await self._stored(
                self.store.add_part,
                part_id=part_id,
                name=new.name,
                state=state,
                readings=done.readings,
                evidence=kept,
                expected=new.expected,
                database=new.database,
                plan=done.plan if state is PartState.TOUCH_NEEDED else None,
                targets=self._targets,
                idempotency=idempotency,
            )
            self._count(part, done)
            if new.touch and part.state is PartState.TOUCH_NEEDED:
                with contextlib.suppress(Problem):  # told in its history; the part still waits for touch
                    return await self.touch(part.id)
            return part

        return await self._once.done(idempotency, work)

    async def add_scan(
        self, part_id: str, scan: Upload, *, idempotency: IdempotencyKey | None = None
    ) -> Received:
        """Read a part again with what was felt of it, fused with what the camera saw.

        Raises:
            Problem: as `receive`; no such part, or one that a person has reviewed.
        """

        async def work() -> PartRecord:
            part = await self._stored(self.store.part, part_id)
            _not_reviewed(part)
            return await self._read_felt(part, scan, idempotency)

        return await self._once.done(idempotency, work)

    async def touch(self, part_id: str) -> PartRecord:
        """Have the service's own stage feel a part, and read it again.

        Raises:
            Problem: as `add_scan`; a stage that cannot feel it.
        """
        part = await self._stored(self.store.part, part_id)
        _not_reviewed(part)
        if part.plan is None:
            raise Problem(409, f"the part {part.id} does not wait for touch; it is {part.state.value}")
        with self._work_folder() as folder:
            order = ScanOrder(part_name=part.name, plan=part.plan)
            try:
                path = await self._feel(order, folder)
            except StageError as error:
                await self._stored(self.store.note_event, part.id, "touch_failed", {"why": str(error)})
                raise Problem(422, str(error)) from error
            return await self._read_felt(part, Upload(path, path.name), None)

    async def trigger(self, name: str) -> PartRecord:
        """Photograph and read the part under the camera; feel it where the camera is unsure.

        Raises:
            Problem: as `receive`; no photograph and nothing to feel.
        """
        with self._work_folder() as folder:
            try:
                taken = await asyncio.to_thread(self.camera.take, name)
                copy = folder / f"taken{taken.suffix.lower()}"
                await asyncio.to_thread(shutil.copyfile, taken, copy)
            except StageError as error:
                raise Problem(422, str(error)) from error
            except OSError as error:
                raise Problem(
                    422, f"the camera's picture of {name} cannot be read ({error.strerror})"
                ) from error
            done = await self.receive(NewPart(name=name, touch=True), photo=Upload(copy, taken.name))
        return done.part

    def say(self, part_id: str, **said: Any) -> PartRecord:
        """Keep what a person says of a part, and send it on; arguments as `Store.review`.

        Raises:
            StoreError: as `Store.review`.
        """
        part = self.store.review(part_id, targets=self._targets, **said)
        self.on_result()
        if part.review is not None:
            self.metrics.reviews.labels(part.review.action.value).inc()
        return part

    async def _feel(self, order: ScanOrder, folder: Path) -> Path:
        """The recording; a stage of iron feels one part at a time, a simulated one as many as there are workers."""
        if isinstance(self.stage, SimulatedStage):
            return await self._in_worker(self.stage.feel, order, folder)
        async with self._one_at_the_stage:
            return await asyncio.to_thread(self.stage.feel, order, folder)

    async def _read_felt(
        self, part: PartRecord, scan: Upload, idempotency: IdempotencyKey | None
    ) -> PartRecord:
        records = await self._stored(self.store.evidence, part.id)
        before: dict[EvidenceKind, Path] = {}
        for record in records:
            if not record.gone and record.kind in (EvidenceKind.VISION, EvidenceKind.PHOTO):
                before[record.kind] = self.evidence.path(record.sha256)
        seen = before if EvidenceKind.VISION in before else {}
        done, kept = await self._read(
            {"scan": scan},
            name=part.name,
            expected=part.expected,
            database=part.database,
            vision=seen.get(EvidenceKind.VISION),
            photo=seen.get(EvidenceKind.PHOTO) if part.expected else None,
        )
        told = await self._stored(
            self.store.add_readings,
            part.id,
            readings=done.readings,
            state=state_after(done.readings[-1]),
            evidence=kept,
            targets=self._targets,
            idempotency=idempotency,
        )
        self._count(told, done)
        return told

    async def _read(
        self,
        uploads: dict[str, Upload | None],
        *,
        name: str,
        expected: str,
        database: str,
        vision: Path | None = None,
        photo: Path | None = None,
    ) -> tuple[Done, list[EvidenceRecord]]:
        """Read the files in a worker; keep them and what was made of them."""
        given = {role: upload for role, upload in uploads.items() if upload is not None}
        with self._work_folder() as folder:
            raw = {upload.kind(role): upload for role, upload in given.items()}
            paths = {kind: upload.path for kind, upload in raw.items()}
            job = Job(
                folder=folder,
                photo=paths.get(EvidenceKind.PHOTO, photo),
                scan=paths.get(EvidenceKind.SCAN),
                height_map=paths.get(EvidenceKind.HEIGHT_MAP),
                vision=vision,
                part_name=name,
                expected=expected,
                database=self._databases(database),
                names={kind.value: upload.name for kind, upload in raw.items()},
            )
            done = await self._in_worker(read_job, job, self._reading, self._limits)
            try:
                return done, await asyncio.to_thread(self._keep, raw, done)
            except FileError as problem:
                log.error("evidence not kept", why=str(problem))
                busy = "the service cannot keep what was sent; its log tells why"
                raise Problem(503, busy, headers={"Retry-After": "30"}) from problem

    def _keep(self, raw: dict[EvidenceKind, Upload], done: Done) -> list[EvidenceRecord]:
        kept = []
        for kind, upload in raw.items():
            sha256, n_bytes = self.evidence.keep(upload.path)
            kept.append(
                EvidenceRecord(kind, sha256, n_bytes, name=upload.name, media_type=upload.media_type(kind))
            )
        for made in done.made:
            sha256, n_bytes = self.evidence.keep(made.path)
            kept.append(
                EvidenceRecord(made.kind, sha256, n_bytes, media_type=made.media_type, meta=made.meta)
            )
        return kept

    async def _in_worker(self, function: Callable[..., T], *arguments: Any) -> T:
        try:
            future = self.pool.submit(function, *arguments)
        except BusyError as error:
            self.metrics.refused.inc()
            seconds = max(1, round(error.retry_after_s))
            raise Problem(503, str(error), headers={"Retry-After": str(seconds)}) from error
        try:
            return await asyncio.wrap_future(future)
        except FileError as problem:
            raise Problem(422, str(problem)) from problem
        except WorkerLostError as error:
            self.metrics.lost_workers.inc()
            log.warning("worker lost", why=str(error))
            raise Problem(422, str(error)) from error

    async def _stored(self, function: Callable[..., T], *arguments: Any, **options: Any) -> T:
        return await asyncio.to_thread(function, *arguments, **options)

    def _count(self, part: PartRecord, done: Done) -> None:
        self.on_result()
        if self.on_part is not None and part.state is not PartState.TOUCH_NEEDED:
            telling = asyncio.ensure_future(self.on_part(part))
            self._telling.add(telling)  # a task that nobody holds may vanish
            telling.add_done_callback(self._telling.discard)
        self.metrics.parts.labels(part.state.value).inc()
        for reading in done.readings:
            self.metrics.readings.labels(reading.source, reading.decision).inc()
            self.metrics.reading_seconds.labels(reading.source).observe(reading.seconds)
        log.info(
            "part read",
            part=part.id,
            name=part.name,
            state=part.state.value,
            text=part.text,
            readings=[f"{r.source}: {r.decision}" for r in done.readings],
        )

    @contextlib.contextmanager
    def _work_folder(self) -> Iterator[Path]:
        folder = self.evidence.new_work_folder()
        try:
            yield folder
        finally:
            shutil.rmtree(folder, ignore_errors=True)


def _not_reviewed(part: PartRecord) -> None:
    if part.state is PartState.REVIEWED:
        raise Problem(
            409, f"the part {part.id} was reviewed by a person; send it as a new part to read it again"
        )
