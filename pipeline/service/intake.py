"""The path of a part through the service: receive, read, decide, keep, answer.

    receive   files in one work folder; a request that is sent again finds its part
    read      a worker reads the files, or feels the part pass by pass
    decide    one state: accepted, review, touch needed, shadow
    keep      files in the evidence folder, then one transaction: part, readings, outbox
    answer    metrics, log, OPC UA; the stored record is both answered and published

* A request is answered only after its part is on the disk.
* A request that fails because of a bad file or a lost machine leaves no part. Sent again with its idempotency
  key, it makes one part.
* If the camera is unsure, the part waits for touch (`touch_queue`); without a stage it goes to a person.
* In shadow mode nothing is decided, felt by the stage or published; the reader is not told the expected text.
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
from weakref import WeakValueDictionary

import structlog

from pipeline.common.names import check_visible, clean_name
from pipeline.common.part_id import new_part_id
from pipeline.common.people_records import Person
from pipeline.common.records import (
    EvidenceKind,
    EvidenceRecord,
    PartRecord,
    PartState,
    ShadowRecord,
    TouchWait,
)
from pipeline.common.serial_rules import SerialAlarm, SerialRules
from pipeline.formats.part_files import PartFiles
from pipeline.formats.truth import read_order
from pipeline.reading.bench_watch import BenchWatch
from pipeline.reading.part_orders import RECORDING, PartOrder
from pipeline.reading.triage import ReadPart, agreement_of
from pipeline.service.stage.devices import ScanOrder, camera_of, stage_of
from pipeline.service.stage.work import CameraWork, StageWork
from pipeline.service.touch_queue import TouchQueue
from pipeline.service.web.problem import OwnProblem, Problem, stopping
from pipeline.service.web.uploads import Upload
from pipeline.store.errors import AlreadyDoneError
from pipeline.store.parts import Added, IdempotencyKey
from pipeline.store.store import Store
from whisker_array.scan.stage_error import StageError

if TYPE_CHECKING:
    from pipeline.reading.part_pictures import Picture
    from pipeline.service.settings import ServiceSettings
    from pipeline.service.worker_calls import WorkerCalls
    from pipeline.store.evidence_folder import EvidenceFolder
    from whisker_array.scan.session import SessionStage

log = structlog.get_logger("tactile-marks")


class Touch(StrEnum):
    """Choice of the stage or the sender to feel a part, if the camera is unsure."""

    ASKED = "asked"
    """The service's stage, on a later request; without a stage the part goes to a person."""
    STAGE = "stage"
    """The service's stage, at once; without a stage the part goes to a person."""
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

    Raises:
        HiddenCharacterError: name or expected text has hidden characters.
    """

    name: str = ""
    expected: str = ""
    database: str = ""
    job: str = ""
    touch: Touch = Touch.ASKED

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", clean_name(self.name))
        check_visible(self.expected)


@dataclass(frozen=True)
class Received:
    """The outcome of a request.

    Attributes:
        part: the part with its present state.
        replayed: whether the same request had been answered before.
    """

    part: PartRecord
    replayed: bool = False


class Intake:
    """Receive parts, have them read, decide their state and keep them.

    Attributes:
        on_result: called when the outbox has something new.
        on_part: called with every part that was read.
        draining: the service is stopping and accepts no more parts.
        policy: rules for review by people.
        targets: targets of results: webhook, mqtt; none in shadow mode.
    """

    def __init__(
        self, settings: ServiceSettings, *, store: Store, evidence: EvidenceFolder, calls: WorkerCalls
    ) -> None:
        """Make the intake of a service.

        Raises:
            FileError: the production order is unreadable, or a folder of stage or camera does not exist.
            SettingsError: a driver of stage or camera does not exist.
        """
        stage, serials = settings.stage, settings.serials
        self._settings = settings
        self.store, self.evidence, self.calls, self.metrics = store, evidence, calls, calls.metrics
        self.stage = StageWork(stage_of(stage), timeout_s=stage.timeout_s)
        self.camera = CameraWork(camera_of(settings.camera), timeout_s=settings.camera.timeout_s)
        self.touching = TouchQueue(
            store,
            self._feel,
            give_up=self._give_up_touch,
            line=settings.line_name,
            stage=str(stage.folder or stage.bench or stage.driver),
            wait_s=stage.wait_s,
        )
        self.bench = BenchWatch()
        self.targets: tuple[str, ...] = ()
        self.policy = settings.review
        order = None if serials.order is None else read_order(serials.order)
        self._rules = SerialRules(serials.duplicates, serials.jump, order)
        # a lock lives as long as a request that holds it or waits for it
        self._locks: WeakValueDictionary[str, asyncio.Lock] = WeakValueDictionary()
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

    def can_read(self, job: str) -> bool:
        """Whether parts of a job can be read now."""
        return self.calls.pool.retry_after_s() is None and not self.calls.trouble(job)

    async def receive(
        self, new: NewPart, sent: Sequence[Upload], *, idempotency: IdempotencyKey | None = None
    ) -> Received:
        """Read a new part.

        Args:
            new: data of the part.
            sent: photographs, a recording or a height map, in the request's work folder.
            idempotency: key of the request.

        Raises:
            Problem: nothing to read, unusable files, a full queue, or a key that another request has used.
        """
        if not sent:
            raise Problem(
                422, "neither photo nor scan is given; send one or both of them as multipart/form-data"
            )
        if new.job and new.database:
            raise Problem(
                422, "both job and database are given; send only one, as a job has its own settings"
            )

        async def work() -> PartRecord:
            self._refuse_if_draining()
            part_id = new_part_id()
            done = await self._read(new, sent)
            write = partial(
                self.store.add_part,
                part_id=part_id,
                name=new.name,
                expected=new.expected,
                database=new.database,
                job=new.job,
                line=self._settings.line_name,
                idempotency=idempotency,
            )
            return await self._keep(write, done, sent, new)

        received = await self.carry_out(idempotency, work)
        part = received.part
        if part.touch is not None and part.touch.by_stage and not self.draining:
            # also if this is a retry because the service was killed at this point; a failure is noted in the
            # part's history, and the part waits for the next attempt
            with contextlib.suppress(Problem, StageError):
                part = await self.touching.attempt(part)
        return replace(received, part=part)

    async def add_scan(
        self, part_id: str, scan: Upload, *, idempotency: IdempotencyKey | None = None
    ) -> Received:
        """Read a part again with its scan, fused with the camera's reading.

        Raises:
            Problem: as in `receive`; the part does not exist, or a person has reviewed it.
        """

        async def work() -> PartRecord:
            part = await self._unreviewed_part(part_id)
            done = await self._read(part, [scan], earlier_photos=await self._photos_of(part))
            write = partial(self.store.add_readings, part.id, idempotency=idempotency)
            return await self._keep(write, done, [scan], part)

        return await self.carry_out(idempotency, work)

    async def touch(self, part_id: str) -> PartRecord:
        """Have the service's stage feel a part, and read it again.

        Raises:
            Problem: as in `add_scan`.
            StageError: the stage cannot feel the part.
        """
        part = await self._unreviewed_part(part_id)
        if part.touch is None or part.plan is None:
            raise Problem(409, f"the part {part.id} does not wait for touch; it is {part.state.value}")
        self._refuse_if_draining()
        if not part.touch.by_stage and self.stage.there:
            part = await asyncio.to_thread(
                self.store.ask_for_touch, part.id, line=self._settings.line_name, until=self.touching.until()
            )
        return await self.touching.attempt(part)

    async def trigger(self, name: str, job: str = "") -> PartRecord:
        """Photograph the part under the camera, read it with a job, and feel it if the camera is unsure.

        Raises:
            Problem: as in `receive`; a photograph cannot be read.
            StageError: the camera gives none.
        """
        self._refuse_if_draining()
        new = NewPart(name=name, job=job, touch=Touch.STAGE)
        with self.work_folder() as folder:
            try:
                photos = await self.camera.take(new.name, folder)
            except OSError as error:
                raise OwnProblem(
                    f"the camera's picture of {name} cannot be read ({error.strerror})"
                ) from error
            return (await self.receive(new, photos)).part

    async def carry_out(
        self, idempotency: IdempotencyKey | None, work: Callable[[], Awaitable[PartRecord]]
    ) -> Received:
        """Do the work of a request once, however often it is sent; while it is done, the same request waits for it.

        The store knows what other processes did, or this one before it was restarted.

        Args:
            idempotency: key of the request; without one it is not remembered.
            work: adds the part with the key in one transaction.

        Raises:
            Problem: the key was used for another request; whatever the work raises.
        """
        if idempotency is None:
            return Received(await work())
        lock = self._locks.setdefault(idempotency.key, asyncio.Lock())
        async with lock:
            known = await asyncio.to_thread(self.store.find_request, idempotency.key)
            if known is None:
                try:
                    return Received(await work())
                except AlreadyDoneError as error:  # another process was quicker
                    known = error.fingerprint, error.part_id
        fingerprint, part_id = known
        if fingerprint != idempotency.fingerprint:
            raise Problem(
                422, "this Idempotency-Key was used for another request; make a new one for every part"
            )
        return Received(await asyncio.to_thread(self.store.part, part_id), replayed=True)

    async def _unreviewed_part(self, part_id: str) -> PartRecord:
        part = await asyncio.to_thread(self.store.part, part_id)
        if part.state is PartState.REVIEWED:
            raise Problem(
                409, f"the part {part.id} was reviewed by a person; send it as a new part to read it again"
            )
        return part

    def _refuse_if_draining(self) -> None:
        if self.draining:
            raise stopping()

    # ------------------------------------------------------------------------------------------------------- read

    async def _read(
        self,
        part: NewPart | PartRecord,
        sent: Sequence[Upload],
        *,
        earlier_photos: tuple[Path, ...] = (),
        folder: Path | None = None,
        felt_by: tuple[SessionStage[ScanOrder], ScanOrder] | None = None,
    ) -> ReadPart:
        files = {upload.kind: str(upload.path) for upload in sent}
        photos = [str(upload.path) for upload in sent if upload.kind is EvidenceKind.PHOTO]
        order = PartOrder(
            folder or sent[0].path.parent,
            PartFiles(
                part.name or Path(sent[-1].name if sent else RECORDING).stem,
                files.get(EvidenceKind.HEIGHT_MAP, ""),
                files.get(EvidenceKind.SCAN, ""),
                tuple(photos) or tuple(map(str, earlier_photos)),
                expected="" if self._in_shadow(part) else part.expected,
            ),
            earlier=bool(earlier_photos),
            names={str(upload.path): upload.name for upload in sent},
        )
        return await self.calls.read(order, job=part.job, database=part.database, felt_by=felt_by)

    async def _feel(self, part: PartRecord) -> PartRecord:
        """Have the stage feel a part, and read it.

        Raises:
            StageError: the part could not be felt.
            Problem: the scan cannot be read.
        """
        if part.plan is None:
            raise ValueError(f"the part {part.id} has no plan for touch")
        order = ScanOrder(part_name=part.name, plan=part.plan)
        read = partial(self._read, part, earlier_photos=await self._photos_of(part))
        with self.work_folder() as folder:
            if self.stage.by_pass:
                async with self.stage.for_worker() as stage:
                    done = await read([], folder=folder, felt_by=(stage, order))
                sent = [Upload(folder / RECORDING, RECORDING, EvidenceKind.SCAN)]
            else:
                path = await self.stage.scan(order, folder)
                sent = [Upload(path, path.name, EvidenceKind.SCAN)]
                done = await read(sent)
            write = partial(self.store.add_readings, part.id)
            return await self._keep(write, done, sent, part)

    async def _photos_of(self, part: PartRecord) -> tuple[Path, ...]:
        def photos() -> tuple[Path, ...]:
            kept = self.store.evidence(part.id)
            return self.evidence.whole(e.sha256 for e in kept if e.kind is EvidenceKind.PHOTO and not e.gone)

        return await asyncio.to_thread(photos)

    # ----------------------------------------------------------------------------------------------------- decide

    def _decide(self, done: ReadPart, part: NewPart | PartRecord) -> Added:
        """Decide the state of a part; only the store's serial rules may still send it to a person."""
        decided: Added = {"state": done.state}
        if done.state is PartState.TOUCH_NEEDED and isinstance(part, NewPart):
            decided["plan"] = done.plan
            if part.touch is Touch.PLAN or self.stage.there:
                decided["touch"] = TouchWait(part.touch is Touch.STAGE, self.touching.until())
            else:
                decided |= {"state": PartState.REVIEW, "not_felt": "there is no stage to feel it"}
        if self._in_shadow(part):
            shadow = ShadowRecord(agreement_of(done.record, part.expected), decided["state"])
            return {"state": PartState.SHADOW, "shadow": shadow}
        return decided

    def _in_shadow(self, part: NewPart | PartRecord) -> bool:
        """Whether a part is in shadow mode; a part that was read in shadow mode stays in it."""
        return self._settings.shadow or (isinstance(part, PartRecord) and part.shadow is not None)

    async def _give_up_touch(self, part: PartRecord, why: str) -> None:
        give_up = partial(self.store.give_up_touch, part.id, why=why, targets=self.targets)
        self._announce(await asyncio.to_thread(give_up))

    # ------------------------------------------------------------------------------------------------------- keep

    async def _keep(
        self,
        write: Callable[..., PartRecord],
        done: ReadPart,
        sent: Sequence[Upload],
        part: NewPart | PartRecord,
    ) -> PartRecord:
        """Store the files, then write the decided part in one transaction; count and log it.

        Raises:
            FileError: no room for the files.
            StoreError: as in `write`.
        """

        def keep() -> PartRecord:
            files = [_evidence(one, self.evidence.keep(one.path, sha256=one.sha256)) for one in sent]
            files += [
                replace(_evidence(one, self.evidence.keep_content(one.content)), meta=one.meta)
                for one in done.pictures
            ]
            return write(
                **self._decide(done, part),
                readings=done.readings,
                evidence=files,
                targets=self.targets,
                audit=self.policy.draw_audit(),
                rules=self._rules,
            )

        kept = await asyncio.to_thread(keep)
        self._announce(kept)
        self._count(kept, done)
        return kept

    def _count(self, part: PartRecord, done: ReadPart) -> None:
        """Count a part's new readings, and log them with findings about serials, whiskers and drift."""
        for reason in part.reading.reasons if part.reading is not None else ():
            if reason.code in set(SerialAlarm):
                self.metrics.serial_alarms.inc()
                log.warning("serial alarm", part=part.id, name=part.name, text=part.text, why=reason.code)
        last, watch = done.record, self.calls.jobs.watch(part.job)
        if last.source != "vision" and self.bench.add(last.faults):
            log.warning("whiskers or bench faulty", why=self.bench.message())
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

    # ----------------------------------------------------------------------------------------------------- answer

    def review(self, part_id: str, person: Person, **said: Any) -> PartRecord:
        """Store a person's review of a part, and publish the part; arguments as in `Store.review`.

        Raises:
            StoreError: as in `Store.review`.
        """
        part = self.store.review(
            part_id, person=person, targets=self.targets, readers=self.policy.readers, **said
        )
        self.on_result()
        if part.state is PartState.REVIEWED and part.review is not None:
            self.metrics.reviews.labels(part.review.action.value).inc()
        return part

    def undo_review(self, part_id: str, person: Person) -> PartRecord:
        """Undo a person's own review.

        Raises:
            StoreError: as in `Store.undo_review`.
        """
        part = self.store.undo_review(part_id, person=person, targets=self.targets)
        self.on_result()
        return part

    def _announce(self, part: PartRecord) -> None:
        self.on_result()
        felt_at_once = part.touch is not None and part.touch.by_stage
        if self.on_part is not None and not felt_at_once:
            announcing = asyncio.ensure_future(self.on_part(part))
            self._announcing.add(announcing)  # a task without a reference may be garbage-collected
            announcing.add_done_callback(self._announcing.discard)
        self.metrics.parts.labels(part.state.value).inc()


def _evidence(file: Upload | Picture, kept: tuple[str, int]) -> EvidenceRecord:
    """The record of a kept file; `kept` is its hash and length."""
    return EvidenceRecord(file.kind, *kept, file.name, file.media_type)
