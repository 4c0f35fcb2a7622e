"""The way of a part through the service: received, read, decided, kept, answered.

    receive   files in one work folder; a request that is sent again finds its part
    read      a worker reads the files, or feels the part pass by pass
    decide    one state: accepted, review, touch needed, shadow
    keep      files in the evidence folder, then one transaction: part, readings, outbox
    answer    metrics, log, OPC UA; the stored record is what is answered and published

* Nothing is answered before it is on the disk.
* A request that fails, by a bad file or a lost machine, leaves no part; sent again with its idempotency key, it makes
  one part.
* A part of which the camera is unsure waits for touch (`touch_queue`); without a stage a person gets it.
* In shadow mode nothing is decided, felt by the stage, or published; the reading does not know the text expected.
"""

from __future__ import annotations

import asyncio
import contextlib
import shutil
from collections.abc import Awaitable, Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import structlog

from glyphs.errors import FileError
from pipeline.common.part_id import new_part_id
from pipeline.common.people_records import Person
from pipeline.common.reading_records import ScanPlanRecord
from pipeline.common.records import (
    EvidenceKind,
    EvidenceRecord,
    PartRecord,
    PartState,
    ShadowRecord,
    TouchWait,
)
from pipeline.common.serial_rules import SerialAlarm, SerialRules
from pipeline.formats.order_file import read_order
from pipeline.reading.bench_watch import BenchWatch
from pipeline.reading.part_orders import Done, PartOrder
from pipeline.reading.triage import compared
from pipeline.service.review_policy import ReviewPolicy
from pipeline.service.stage.devices import Camera, ScanOrder, Stage
from pipeline.service.stage.driver_thread import StageDownError
from pipeline.service.stage.work import CameraWork, StageWork
from pipeline.service.touch_queue import TouchQueue
from pipeline.service.web.idempotency import IdempotentRequests, Received
from pipeline.service.web.problem import OwnProblem, Problem, no_room, stopping
from pipeline.service.web.uploads import Upload
from pipeline.store.store import IdempotencyKey, Store
from whisker_array.scan.stage_error import StageError

if TYPE_CHECKING:
    from pipeline.reading.drift import DriftWatch
    from pipeline.reading.part_pictures import MadeFile
    from pipeline.service.metrics import Metrics
    from pipeline.service.settings import ServiceSettings
    from pipeline.service.worker_calls import WorkerCalls
    from pipeline.store.evidence_folder import EvidenceFolder
    from whisker_array.scan.session import SessionStage

log = structlog.get_logger("tactile-marks")


class Touch(StrEnum):
    """Who feels a part of which the camera is unsure."""

    ASKED = "asked"
    """The service's stage, on a later request; without a stage a person gets the part."""
    STAGE = "stage"
    """The service's stage, at once; without a stage a person gets the part."""
    PLAN = "plan"
    """The sender, by the plan in the answer."""


@dataclass(frozen=True)
class NewPart:
    """Data of a part beside its files.

    Attributes:
        name: name on the line.
        expected: text that it should read; empty if unknown.
        database: name of the glyph database; empty for the service's own.
        job: name of the job that says how to read; empty for the service's own settings.
        touch: stage or sender that feels it if the camera is unsure.
    """

    name: str = ""
    expected: str = ""
    database: str = ""
    job: str = ""
    touch: Touch = Touch.ASKED


@dataclass(frozen=True)
class Decision:
    """Decision about a part after a reading.

    Attributes:
        state: new state of the part.
        shadow: comparison with the line's own reader, in shadow mode.
        plan: scan plan.
        touch: wait for touch.
        not_felt: why it is not felt, though the camera is unsure.
    """

    state: PartState
    shadow: ShadowRecord | None = None
    plan: ScanPlanRecord | None = None
    touch: TouchWait | None = None
    not_felt: str = ""


class Intake:
    """Takes parts in.

    Attributes:
        on_result: called when the outbox has something new.
        on_part: called with every part that was read.
        draining: the service is stopping and accepts no more parts.
        policy: rules of agreement and of blind reading.
        targets: targets of results: webhook, mqtt; none in shadow mode.
    """

    def __init__(
        self,
        settings: ServiceSettings,
        *,
        store: Store,
        evidence: EvidenceFolder,
        calls: WorkerCalls,
        stage: Stage,
        camera: Camera,
        metrics: Metrics,
        policy: ReviewPolicy,
        targets: Sequence[str] = (),
        watch: Callable[[str], DriftWatch | None] = lambda _: None,
    ) -> None:
        """Make the intake of a service.

        Args:
            settings: of the service.
            store: of records.
            evidence: folder of files.
            calls: of workers.
            stage: driver of the whisker stage.
            camera: driver of the camera.
            metrics: counters.
            policy: of review by people.
            targets: of results.
            watch: drift watch of a job; None for one that is not certified.

        Raises:
            FileError: an unreadable production order.
        """
        self._settings = settings
        self.store, self.evidence, self.calls, self.metrics = store, evidence, calls, metrics
        self.stage = StageWork(stage, active=settings.stage.active, timeout_s=settings.stage.timeout_s)
        self.camera = CameraWork(camera, timeout_s=settings.camera.timeout_s)
        self.touching = TouchQueue(
            store, self._feel, give_up=self._give_up_touch, line=settings.line, wait_s=settings.stage.wait_s
        )
        self.bench = BenchWatch()
        self.targets = () if settings.shadow else tuple(targets)
        self._watch, self.policy = watch, policy
        serials = settings.serials
        order = None if serials.order is None else read_order(serials.order)
        self._rules = SerialRules(serials.duplicates, serials.jump, order)
        self._requests = IdempotentRequests(store)
        self._announcing: set[asyncio.Future[None]] = set()
        self.on_result: Callable[[], object] = lambda: None
        self.on_part: Callable[[PartRecord], Awaitable[None]] | None = None
        self.draining = False

    # ---------------------------------------------------------------------------------------------------- receive

    @contextlib.contextmanager
    def work_folder(self) -> Iterator[Path]:
        """The work folder of one request, on the disk of the evidence folder; removed at its end."""
        folder = self.evidence.new_work_folder()
        try:
            yield folder
        finally:
            shutil.rmtree(folder, ignore_errors=True)

    def takes(self, job: str) -> bool:
        """Whether parts of a job can be read now."""
        return self.calls.busy is None and not self.calls.trouble(job)

    async def receive(
        self,
        new: NewPart,
        *,
        photos: Sequence[Upload] = (),
        scan: Upload | None = None,
        idempotency: IdempotencyKey | None = None,
    ) -> Received:
        """Read a new part.

        Args:
            new: its data.
            photos: in the request's work folder.
            scan: recording or height map, there, too.
            idempotency: key of the request.

        Raises:
            Problem: nothing to read, unusable files, a full queue, a key of another request.
        """
        if not photos and scan is None:
            raise Problem(
                422, "there is neither photo nor scan; send one of them, or both, as multipart/form-data"
            )
        if new.job and new.database:
            raise Problem(422, "there are job and database; a job says what to read with, send one of them")

        async def work() -> PartRecord:
            self._refuse_at_the_end()
            part_id = new_part_id()
            done = await self._read(new, photos=photos, scan=scan)
            decision = self._decide(done, new)
            write = partial(
                self.store.add_part,
                part_id=part_id,
                name=new.name,
                expected=new.expected,
                database=new.database,
                job=new.job,
                line=self._settings.line,
                plan=decision.plan,
                touch=decision.touch,
                not_felt=decision.not_felt,
                idempotency=idempotency,
            )
            return await self._keep(write, done, _with_kinds(photos, scan), decision)

        received = await self._requests.carry_out(idempotency, work)
        part = received.part
        if part.touch is not None and part.touch.by_stage and not self.draining:
            # also where the request was sent again because the service was killed here
            with contextlib.suppress(Problem):  # noted in its history; it still waits, and is tried again
                part = await self.touching.felt(part)
        return replace(received, part=part)

    async def add_scan(
        self, part_id: str, scan: Upload, *, idempotency: IdempotencyKey | None = None
    ) -> Received:
        """Read a part again with its scan, fused with the camera's reading.

        Raises:
            Problem: as `receive`; no such part, or a reviewed one.
        """

        async def work() -> PartRecord:
            part = await asyncio.to_thread(self.store.part, part_id)
            _refuse_reviewed(part)
            done = await self._read(part, scan=scan, earlier_photos=await self._photos_of(part))
            write = partial(self.store.add_readings, part.id, idempotency=idempotency)
            return await self._keep(write, done, _with_kinds((), scan), self._decide(done, part))

        return await self._requests.carry_out(idempotency, work)

    async def touch(self, part_id: str) -> PartRecord:
        """Have the service's stage feel a part, and read it again.

        Raises:
            Problem: as `add_scan`; a stage that cannot feel it.
        """
        part = await asyncio.to_thread(self.store.part, part_id)
        _refuse_reviewed(part)
        if part.touch is None or part.plan is None:
            raise Problem(409, f"the part {part.id} does not wait for touch; it is {part.state.value}")
        self._refuse_at_the_end()
        if not part.touch.by_stage and self.stage.there:
            part = await asyncio.to_thread(
                self.store.ask_for_touch, part.id, line=self._settings.line, until=self.touching.until()
            )
        return await self.touching.felt(part)

    async def trigger(self, name: str, job: str = "") -> PartRecord:
        """Photograph and read the part under the camera by a job; feel it if the camera is unsure.

        Raises:
            Problem: as `receive`; no photograph.
        """
        self._refuse_at_the_end()
        with self.work_folder() as folder:
            try:
                photos = await self.camera.take(name, folder)
            except StageError as error:
                raise _stage_problem(error) from error
            except OSError as error:
                raise OwnProblem(
                    f"the camera's picture of {name} cannot be read ({error.strerror})"
                ) from error
            done = await self.receive(NewPart(name=name, job=job, touch=Touch.STAGE), photos=photos)
        return done.part

    # ------------------------------------------------------------------------------------------------------- read

    async def _read(
        self,
        part: NewPart | PartRecord,
        *,
        photos: Sequence[Upload] = (),
        scan: Upload | None = None,
        earlier_photos: tuple[Path, ...] = (),
        folder: Path | None = None,
        felt_by: tuple[SessionStage[ScanOrder], ScanOrder] | None = None,
    ) -> Done:
        sent = _with_kinds(photos, scan)
        felt = {kind: upload.path for kind, upload in sent}
        order = PartOrder(
            folder=folder or sent[0][1].path.parent,
            photos=tuple(photo.path for photo in photos),
            scan=felt.get(EvidenceKind.SCAN),
            height_map=felt.get(EvidenceKind.HEIGHT_MAP),
            earlier_photos=earlier_photos,
            part_name=part.name,
            expected="" if self._hidden(part) else part.expected,
            names={upload.path: upload.name for _, upload in sent},
        )
        return await self.calls.read(order, job=part.job, database=part.database, felt_by=felt_by)

    async def _feel(self, part: PartRecord) -> PartRecord:
        """Have the stage feel a part, and read it.

        Raises:
            Problem: it could not be felt; its history says why.
        """
        if part.plan is None:
            raise ValueError(f"the part {part.id} has no plan of what to feel")
        order = ScanOrder(part_name=part.name, plan=part.plan)
        photos = await self._photos_of(part)
        with self.work_folder() as folder:
            scan = None
            try:
                if self.stage.by_pass:
                    async with self.stage.for_worker() as stage:
                        done = await self._read(
                            part, folder=folder, earlier_photos=photos, felt_by=(stage, order)
                        )
                else:
                    path = await self.stage.scan(order, folder, self.calls.call)
                    scan = Upload(path, path.name)
                    done = await self._read(part, scan=scan, earlier_photos=photos)
            except StageError as error:
                await asyncio.to_thread(self._note_failure, part, str(error))
                raise _stage_problem(error) from error
            write = partial(self.store.add_readings, part.id)
            return await self._keep(write, done, _with_kinds((), scan), self._decide(done, part))

    async def _photos_of(self, part: PartRecord) -> tuple[Path, ...]:
        def whole() -> tuple[Path, ...]:
            kept = self.store.evidence(part.id)
            return self.evidence.whole(e.sha256 for e in kept if e.kind is EvidenceKind.PHOTO and not e.gone)

        return await asyncio.to_thread(whole)

    def _note_failure(self, part: PartRecord, why: str) -> None:
        *_, last = self.store.history(part.id)
        if (last.kind, last.data) != ("touch_failed", {"why": why}):  # once, however often it is tried
            self.store.note_event(part.id, "touch_failed", {"why": why})

    # ----------------------------------------------------------------------------------------------------- decide

    def _decide(self, done: Done, part: NewPart | PartRecord) -> Decision:
        """The only place where a state is given; the store's rules of serials may still send a part to a person."""
        if self._hidden(part):
            return Decision(PartState.SHADOW, compared(done.readings[-1], part.expected))
        if done.state is not PartState.TOUCH_NEEDED or isinstance(part, PartRecord):
            return Decision(done.state)
        if part.touch is not Touch.PLAN and not self.stage.there:
            return Decision(PartState.REVIEW, plan=done.plan, not_felt="there is no stage to feel it")
        wait = TouchWait(part.touch is Touch.STAGE, self.touching.until())
        return Decision(PartState.TOUCH_NEEDED, plan=done.plan, touch=wait)

    def _hidden(self, part: NewPart | PartRecord) -> bool:
        """Whether a part is in shadow mode; one that was read so stays so."""
        return self._settings.shadow or (isinstance(part, PartRecord) and part.shadow is not None)

    def review(self, part_id: str, **said: Any) -> PartRecord:
        """Keep a person's review of a part, and publish it; arguments as `Store.review`.

        Raises:
            StoreError: as `Store.review`.
        """
        targets = self._targets_of(self.store.part(part_id))
        part = self.store.review(part_id, targets=targets, readers=self.policy.readers, **said)
        self.on_result()
        if part.state is PartState.REVIEWED and part.review is not None:
            self.metrics.reviews.labels(part.review.action.value).inc()
        return part

    def undo_review(self, part_id: str, person: Person) -> PartRecord:
        """Take a person's own review back, and publish the part as it stands.

        Raises:
            StoreError: as `Store.undo_review`.
        """
        targets = self._targets_of(self.store.part(part_id))
        part = self.store.undo_review(part_id, person=person, targets=targets)
        self.on_result()
        return part

    async def _give_up_touch(self, part: PartRecord, why: str) -> None:
        targets = self._targets_of(part)
        self._announce(await asyncio.to_thread(self.store.give_up_touch, part.id, why=why, targets=targets))

    def _targets_of(self, part: PartRecord) -> tuple[str, ...]:
        return () if self._hidden(part) else self.targets

    def _refuse_at_the_end(self) -> None:
        if self.draining:
            raise stopping()

    # ------------------------------------------------------------------------------------------------------- keep

    async def _keep(
        self,
        write: Callable[..., PartRecord],
        done: Done,
        sent: Sequence[tuple[EvidenceKind, Upload]],
        decision: Decision,
    ) -> PartRecord:
        """Keep the files, then write the part in one transaction; count and log it.

        Raises:
            Problem: no room for the files.
            StoreError: as `write`.
        """

        def kept() -> PartRecord:
            try:
                files = [
                    self._kept(upload, kind, upload.media_type(kind), upload.sha256) for kind, upload in sent
                ]
                files += [
                    replace(self._kept(one, one.kind, one.media_type), meta=one.meta) for one in done.made
                ]
            except FileError as error:
                raise no_room(error) from error
            return write(
                readings=done.readings,
                state=decision.state,
                evidence=files,
                targets=() if decision.shadow is not None else self.targets,
                shadow=decision.shadow,
                audit=self.policy.draw_audit(),
                rules=self._rules,
            )

        part = await asyncio.to_thread(kept)
        self._announce(part)
        self._count(part, done)
        return part

    def _kept(
        self, file: Upload | MadeFile, kind: EvidenceKind, media_type: str, sha256: str = ""
    ) -> EvidenceRecord:
        sha256, n_bytes = self.evidence.keep(file.path, sha256=sha256)
        return EvidenceRecord(kind, sha256, n_bytes, name=file.name, media_type=media_type)

    # ----------------------------------------------------------------------------------------------------- answer

    def _announce(self, part: PartRecord) -> None:
        self.on_result()
        felt_at_once = part.touch is not None and part.touch.by_stage
        if self.on_part is not None and not felt_at_once:
            announcing = asyncio.ensure_future(self.on_part(part))
            self._announcing.add(announcing)  # a task without a reference may be garbage-collected
            announcing.add_done_callback(self._announcing.discard)
        self.metrics.parts.labels(part.state.value).inc()

    def _count(self, part: PartRecord, done: Done) -> None:
        for reason in part.reading.reasons if part.reading is not None else ():
            if reason.code in set(SerialAlarm):
                self.metrics.serial_alarms.inc()
                log.warning("serial alarm", part=part.id, name=part.name, text=part.text, why=reason.code)
        last = done.readings[-1]
        if last.source != "vision" and self.bench.add(last.faults):
            log.warning("whiskers or bench faulty", why=self.bench.message())
        watch = self._watch(part.job)
        if watch is not None and watch.add(last.source, done.measures):
            log.warning("parts unlike the certified ones", job=part.job, why=watch.message())
        for reading in done.readings:
            self.metrics.readings.labels(reading.source, reading.decision).inc()
            self.metrics.reading_seconds.labels(reading.source).observe(reading.seconds)
        log.info(
            "part read",
            part=part.id,
            name=part.name,
            job=part.job,
            state=part.state.value,
            text=part.text,
            readings=[f"{r.source}: {r.decision}" for r in done.readings],
        )


def _with_kinds(photos: Sequence[Upload], scan: Upload | None) -> list[tuple[EvidenceKind, Upload]]:
    return [
        *((EvidenceKind.PHOTO, photo) for photo in photos),
        *(((scan.touch_kind(), scan),) if scan is not None else ()),
    ]


def _stage_problem(error: StageError) -> Problem:
    """The answer to a fault of stage or camera: a driver that does not answer is not the caller's mistake."""
    if isinstance(error, StageDownError):
        return Problem(503, str(error), headers={"Retry-After": "30"})
    return Problem(422, str(error))


def _refuse_reviewed(part: PartRecord) -> None:
    if part.state is PartState.REVIEWED:
        raise Problem(
            409, f"the part {part.id} was reviewed by a person; send it as a new part to read it again"
        )
