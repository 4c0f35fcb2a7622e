"""The path of a part through the service: receive, read, decide, keep, answer.

* A request is answered only after its part is on the disk: files in the evidence folder, then one transaction.
* A request that fails because of a bad file or a lost machine leaves no part, and may be sent again. A photograph of
  the camera or the watched folder is a part for a person if it cannot be read.
* If the camera is unsure, the part waits for touch (`touch_queue`), or without a stage goes to a person.
* In shadow mode nothing is decided, felt by the stage or published; the reader is not told the expected text.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
import shutil
import time
from collections.abc import Awaitable, Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any
from weakref import WeakValueDictionary

import structlog

from pipeline.common.names import check_visible, clean_name
from pipeline.common.part_id import is_part_id, new_part_id
from pipeline.common.people_records import Person
from pipeline.common.reading_records import ReadingRecord, ReasonRecord
from pipeline.common.records import (
    EvidenceKind,
    EvidenceRecord,
    PartRecord,
    PartState,
    ShadowRecord,
    TouchWait,
)
from pipeline.common.serial_format import serial_format
from pipeline.common.serial_rules import SerialAlarm, SerialRules
from pipeline.formats.part_files import PartFiles
from pipeline.formats.truth import read_order
from pipeline.reading.bench_watch import BenchWatch
from pipeline.reading.part_job import RECORDING, PartJob
from pipeline.reading.triage import ReadPart, agreement_of
from pipeline.service.stage.devices import ScanOrder, camera_of, stage_of
from pipeline.service.stage.work import NO_LIMIT, CameraWork, StageWork, TouchCall
from pipeline.service.tasks import start
from pipeline.service.touch_queue import TouchQueue
from pipeline.service.web.problem import (
    OwnProblem,
    Problem,
    UnreadableProblem,
    UnverifiableProblem,
    stopping,
)
from pipeline.service.web.uploads import Upload
from pipeline.store.errors import AlreadyDoneError
from pipeline.store.parts import Added, IdempotencyKey
from pipeline.store.store import Store
from whisker_array.scan.stage_error import StageError

if TYPE_CHECKING:
    from pipeline.service.settings import ServiceSettings
    from pipeline.service.worker_calls import WorkerCalls
    from pipeline.store.evidence_folder import EvidenceFolder
    from whisker_array.scan.session import SessionStage

log = structlog.get_logger("tactile-marks")


class Touch(StrEnum):
    """Choice of the stage or the sender to feel a part, if the camera is unsure."""

    # the service's stage, on a later request; without a stage the part goes to a person
    ASKED = "asked"
    # the service's stage, at once; without a stage the part goes to a person
    STAGE = "stage"
    # the sender, by the plan in the answer
    PLAN = "plan"


@dataclass(frozen=True)
class NewPart:
    """A part beside its files; job: empty for the service's own settings. Raises HiddenCharacterError."""

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
    """The outcome of a request; `replayed` if the same request had been answered before."""

    part: PartRecord
    replayed: bool = False


class Intake:
    """Receive parts, have them read, decide their state and keep them."""

    def __init__(
        self, settings: ServiceSettings, *, store: Store, evidence: EvidenceFolder, calls: WorkerCalls
    ) -> None:
        """Make stage, camera, queue and serial rules. Raises FileError, SettingsError: one of them cannot be used."""
        stage, serials = settings.stage, settings.serials
        self._settings = settings
        self.store, self.evidence, self.calls, self.metrics = store, evidence, calls, calls.metrics
        self.stage = StageWork(stage_of(stage, calls.jobs.settings("")), timeout_s=settings.device_timeout_s)
        self.camera = CameraWork(camera_of(settings.camera), timeout_s=settings.device_timeout_s)
        self.touching = TouchQueue(
            store,
            self._feel,
            give_up=self._give_up_touch,
            line=settings.line_name,
            stage=stage.device,
            knows_place=self.stage.knows_place,
            wait_s=stage.wait_s,
        )
        self.bench = BenchWatch()
        self.targets: tuple[str, ...] = ()  # webhook, mqtt; none in shadow mode
        self.policy = settings.review
        order = None
        if serials.order is not None:
            order = read_order(serials.order, serial_format(calls.jobs.settings("")))
        self._rules = SerialRules(serials.duplicates, serials.jump, order)
        # a lock lives as long as a request that holds it or waits for it
        self._locks: WeakValueDictionary[str, asyncio.Lock] = WeakValueDictionary()
        self._announcing: set[asyncio.Future[Any]] = set()
        self.on_result: Callable[[], object] = lambda: None  # the outbox has something new
        self.on_part: Callable[[PartRecord], Awaitable[None]] | None = None  # with every part that was read
        # with every part that a person has decided, in any thread
        self.on_review: Callable[[PartRecord], object] = lambda _: None
        self.draining = False

    # ---------------------------------------------------------------------------------------------------- receive

    @contextlib.contextmanager
    def work_folder(self) -> Iterator[Path]:
        folder = self.evidence.new_work_folder()
        try:
            yield folder
        finally:
            shutil.rmtree(folder, ignore_errors=True)

    def can_read(self, job: str) -> bool:
        return self.calls.pool.retry_after_s() is None and not self.calls.trouble(job)

    async def receive(
        self,
        new: NewPart,
        sent: Sequence[Upload],
        *,
        idempotency: IdempotencyKey | None = None,
        call: TouchCall = NO_LIMIT,  # that brings the part, during which it may be felt
        keep_unreadable: bool = False,  # a person gets an unreadable part; otherwise the sender the Problem
        unreadable: str = "",  # why files cannot even be taken; a person gets the part without them
    ) -> Received:
        """Read a new part. Raises Problem: nothing to read, unusable files, full queue, or key of another request."""
        if not sent and not unreadable:
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
            try:
                done = _unread(unreadable) if unreadable else await self._read(new, sent)
            except UnreadableProblem as problem:
                if self.draining or not keep_unreadable:  # workers are lost at the service's end, too
                    raise
                done = await self._read_for_person(new, sent, problem)
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
        if part.touch is not None and part.touch.by_stage:
            try:
                part = await self.touching.attempt(part, call)
            except (Problem, StageError):  # the part's history has it
                part = await asyncio.to_thread(self.store.part, part.id)
        return replace(received, part=part)

    async def add_scan(
        self, part_id: str, scan: Upload, *, idempotency: IdempotencyKey | None = None
    ) -> Received:
        """Read a part again, with its scan and photographs. Raises Problem: as in `receive`, or it is reviewed."""

        async def work() -> PartRecord:
            part = await self._unreviewed_part(part_id)
            done = await self._read(part, [scan], earlier_photos=await self._photos_of(part))
            write = partial(self.store.add_readings, part.id, idempotency=idempotency)
            return await self._keep(write, done, [scan], part)

        return await self.carry_out(idempotency, work)

    async def touch(self, part_id: str, call: TouchCall = NO_LIMIT) -> PartRecord:
        """Release a part that lies under the whiskers: the stage feels it, and it is read again. Raises Problem: as in
        `add_scan`. StageError: the stage cannot feel the part."""
        part = await self._unreviewed_part(part_id)
        if part.plan is None or part.shadow is not None:
            raise Problem(409, f"the part {part.id} does not wait for touch; it is {part.state.value}")
        return await self.touching.attempt(part, call)

    async def trigger(
        self, name: str, job: str = "", *, expected: str = "", within_s: float = math.inf
    ) -> PartRecord:
        """Photograph the part under the camera, read it with a job, and feel it within `within_s` if the camera is
        unsure. Raises Problem: as in `receive`. StageError: the camera gives no photograph."""
        self._refuse_if_draining()
        call = TouchCall(time.monotonic() + within_s)
        new = NewPart(name=name, expected=expected, job=job, touch=Touch.STAGE)
        # before the camera: a picture is taken once, and would be used up
        looked_for = "" if self._in_shadow(new) else new.expected
        await asyncio.to_thread(self.calls.check_expected, looked_for, new.job)
        with self.work_folder() as folder:
            try:
                pictures = await self.camera.take(new.name, folder, known=self.store.known_keys)
            except OSError as error:
                raise OwnProblem(
                    f"the camera's picture of {name} cannot be read ({error.strerror})"
                ) from error
            received = await self.receive(
                new,
                pictures.photos,
                idempotency=IdempotencyKey.of_files(pictures.keys) if pictures.keys else None,
                call=call,
                keep_unreadable=True,
            )
        return received.part

    async def release(self, part: str, *, within_s: float = math.inf) -> PartRecord:
        """Have a part felt that lies under the whiskers, as in `touch`; `part`: its id, or the latest one's name."""
        call = TouchCall(time.monotonic() + within_s)
        return await self.touch((await self.look_up(part)).id, call)

    async def look_up(self, part: str) -> PartRecord:
        """The part with an id, or the latest one with a name. Raises NotFoundError: there is none."""
        if is_part_id(part):
            return await asyncio.to_thread(self.store.part, part)
        return await asyncio.to_thread(self.store.latest_named, clean_name(part))

    async def carry_out(
        self, idempotency: IdempotencyKey | None, work: Callable[[], Awaitable[PartRecord]]
    ) -> Received:
        """Do the work of a request once; the same request waits for it. Raises Problem: another request's key."""
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
        job = PartJob(
            PartFiles(
                part.name or Path(sent[-1].name if sent else RECORDING).stem,
                files.get(EvidenceKind.HEIGHT_MAP, ""),
                files.get(EvidenceKind.SCAN, ""),
                tuple(photos) or tuple(map(str, earlier_photos)),
            ),
            expected="" if self._in_shadow(part) else part.expected,
            earlier=bool(earlier_photos),
            folder=folder or sent[0].path.parent,
            names={str(upload.path): upload.name for upload in sent},
        )
        return await self.calls.read(job, job=part.job, database=part.database, felt_by=felt_by)

    async def _read_for_person(
        self, new: NewPart, sent: Sequence[Upload], problem: UnreadableProblem
    ) -> ReadPart:
        """Read a part that nobody waits for, without the text expected of it if the problem is that text."""
        if not isinstance(problem, UnverifiableProblem):
            return _unread(problem.detail)
        try:
            done = await self._read(replace(new, expected=""), sent)
        except UnreadableProblem as unreadable:
            return _unread(unreadable.detail)
        messages = (*done.record.messages, f"not verified: {problem.detail}")
        reasons = (*done.record.reasons, ReasonRecord("not_verified"))
        record = replace(done.record, messages=messages, reasons=reasons)
        return replace(done, readings=(*done.readings[:-1], record), unverified=True)

    async def _feel(self, part: PartRecord, call: TouchCall) -> PartRecord:
        if part.plan is None:
            raise ValueError(f"the part {part.id} has no plan for touch")
        self._refuse_if_draining()
        order = ScanOrder(part_name=part.name, plan=part.plan)
        read = partial(self._read, part, earlier_photos=await self._photos_of(part))
        with self.work_folder() as folder:
            if self.stage.by_pass:
                async with self.stage.for_worker(part.name, call) as stage:
                    done = await read([], folder=folder, felt_by=(stage, order))
                sent = [Upload(folder / RECORDING, RECORDING, EvidenceKind.SCAN)]
            else:
                path = await self.stage.scan(order, folder, call)
                sent = [Upload(path, path.name, EvidenceKind.SCAN)]
                done = await read(sent)
            write = partial(self.store.add_readings, part.id)
            return await self._keep(write, done, sent, part)

    async def _photos_of(self, part: PartRecord) -> tuple[Path, ...]:
        def photos() -> tuple[Path, ...]:
            photographs = [e for e in self.store.evidence(part.id) if e.kind is EvidenceKind.PHOTO]
            paths = self.evidence.whole(e.sha256 for e in photographs if not e.gone)
            if photographs and not paths:
                what = f"the photographs of part {part.id} are no longer kept whole"
                raise Problem(409, f"{what}; send photograph and scan together as a new part")
            return paths

        return await asyncio.to_thread(photos)

    # ----------------------------------------------------------------------------------------------------- decide

    def _decide(self, done: ReadPart, part: NewPart | PartRecord) -> Added:
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
        def keep() -> tuple[PartRecord, str]:
            files = [
                _evidence(upload, self.evidence.keep(upload.path, sha256=upload.sha256)) for upload in sent
            ]
            files += self.evidence.keep_pictures(done.pictures)
            written = write(
                **self._decide(done, part),
                readings=done.readings,
                evidence=files,
                targets=self.targets,
                audit=self.policy.draw_audit(),
                rules=self._rules,
            )
            watch = self.calls.jobs.watch(written.job)
            drifts = watch is not None and watch.add(done.record.source, done.measures)
            return written, watch.message() if watch is not None and drifts else ""

        stored, drift = await asyncio.to_thread(keep)
        self._announce(stored)
        self._count(stored, done, drift)
        return stored

    def _count(self, part: PartRecord, done: ReadPart, drift: str) -> None:
        for reason in part.reading.reasons if part.reading is not None else ():
            if reason.code in set(SerialAlarm):
                self.metrics.serial_alarms.inc()
                log.warning("serial alarm", part=part.id, name=part.name, text=part.text, why=reason.code)
        if done.record.source != "vision" and self.bench.add(done.record.faults):
            log.warning("whiskers or bench faulty", why=self.bench.message())
        if drift:
            log.warning("parts unlike the certified ones", job=part.job, why=drift)
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

    def review(self, part_id: str, person: Person, **answer: Any) -> PartRecord:
        part = self.store.review(
            part_id, person=person, targets=self.targets, readers=self.policy.readers, **answer
        )
        self.on_result()
        if part.state is PartState.REVIEWED and part.review is not None:
            self.metrics.reviews.labels(part.review.action.value).inc()
            self.on_review(part)
        return part

    def undo_review(self, part_id: str, person: Person) -> PartRecord:
        part = self.store.undo_review(part_id, person=person, targets=self.targets)
        self.on_result()
        return part

    def _announce(self, part: PartRecord) -> None:
        self.on_result()
        felt_at_once = part.touch is not None and part.touch.by_stage
        if self.on_part is not None and not felt_at_once:
            start(self.on_part(part), self._announcing)
        self.metrics.parts.labels(part.state.value).inc()


def _unread(why: str) -> ReadPart:
    what = f"photograph cannot be read: {why}"
    reasons = (ReasonRecord("unreadable_photo"),)
    return ReadPart(
        (ReadingRecord("vision", "", "reject", 0.0, messages=(what,), reasons=reasons, error=why),)
    )


def _evidence(file: Upload, content: tuple[str, int]) -> EvidenceRecord:
    return EvidenceRecord(file.kind, *content, file.name, file.media_type)
