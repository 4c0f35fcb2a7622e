"""The service's work with parts: takes them in, has them read, keeps what came of it, and sends them on.

    photo, scan --> reading order: readings, files --> store: one transaction --> answer, outbox

* Nothing is answered before it is on the disk.
* What ends on the way, by a bad file or a lost machine, leaves no part; the sender asks again, with the same
  idempotency key, and one part comes of it.
* Where the camera is unsure, the part waits for touch (`touch_queue`); where nobody can feel it, it goes to a person.
* In shadow mode parts are read without knowing what the line's own reader says, then compared with it; nothing is
  decided, felt by the stage, or published.
* A stage that fails on the way costs no pass: the part is read from those before, for a person to look at.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import structlog

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
from pipeline.common.serial_rules import SerialRules
from pipeline.reading.bench_watch import BenchWatch
from pipeline.reading.part_orders import Done
from pipeline.reading.triage import compared, state_after
from pipeline.service.reading_orders import ReadingOrders
from pipeline.service.review_policy import ReviewPolicy
from pipeline.service.stage.driver_thread import StageDownError
from pipeline.service.stage_work import CameraWork, StageWork
from pipeline.service.touch_queue import TouchQueue
from pipeline.service.web.idempotency import IdempotentRequests, Received
from pipeline.service.web.problem import OwnProblem, Problem, stopping
from pipeline.service.web.uploads import Upload
from pipeline.store.parts import ANY_SERIAL
from pipeline.store.store import IdempotencyKey, Store
from whisker_array.scan.stage_error import StageError

if TYPE_CHECKING:
    from pipeline.reading.drift import DriftWatch
    from pipeline.service.metrics import Metrics
    from pipeline.store.evidence_folder import EvidenceFolder

T = TypeVar("T")
log = structlog.get_logger("tactile-marks")


class Touch(StrEnum):
    """Who feels a part that the camera is unsure of."""

    ASKED = "asked"
    """The service's stage, once it is asked to; without a stage a person gets the part."""
    STAGE = "stage"
    """The service's stage, at once; without a stage a person gets the part."""
    PLAN = "plan"
    """Whoever sent it, by the plan that the answer holds."""


@dataclass(frozen=True)
class NewPart:
    """What is known of a part beside its files.

    Attributes:
        name: what the line calls it.
        expected: text that it should read; empty where none is.
        database: name of the glyph database; empty for the service's own choice.
        job: name of the job that says how to read; empty for the service's own settings.
        touch: who feels it where the camera is unsure.
    """

    name: str = ""
    expected: str = ""
    database: str = ""
    job: str = ""
    touch: Touch = Touch.ASKED


class PartService:
    """Takes parts in and has them read."""

    def __init__(
        self,
        *,
        store: Store,
        evidence: EvidenceFolder,
        orders: ReadingOrders,
        stage: StageWork,
        camera: CameraWork,
        metrics: Metrics,
        line: str = "",
        touch_wait_s: float = 900.0,
        targets: Sequence[str] = (),
        watch: Callable[[str], DriftWatch | None] = lambda _: None,
        shadow: bool = False,
        policy: ReviewPolicy = ReviewPolicy(),  # noqa: B008 - frozen
        rules: SerialRules = ANY_SERIAL,
    ) -> None:
        """Take what it works with.

        Args:
            store: where records are kept.
            evidence: where files are kept.
            orders: who has files read and keeps them.
            stage: feels what the camera is unsure of.
            camera: photographs a part when a trigger comes.
            metrics: what is counted.
            line: that parts come from; kept with them.
            touch_wait_s: how long a part waits for touch before a person gets it.
            targets: of results: webhook, mqtt; `on_result` is called when there is something for them,
                `on_part` with every part that was read.
            watch: what compares parts with the certified ones, by the name of their job.
            shadow: read and compare with the line's own reader; decide and publish nothing.
            policy: who must agree on a part, and what share of accepted parts is audited.
            rules: what is asked of serials among serials.
        """
        self._policy, self._rules = policy, rules
        self.store, self.evidence, self.orders, self.metrics = store, evidence, orders, metrics
        self.stage, self.camera, self.line = stage, camera, line
        self.bench = BenchWatch()
        self._targets, self._watch, self._shadow = () if shadow else tuple(targets), watch, shadow
        self.on_result: Callable[[], object] = lambda: None
        self.on_part: Callable[[PartRecord], Awaitable[None]] | None = None
        self._announcing: set[asyncio.Future[None]] = set()
        self._requests = IdempotentRequests(store)
        self.draining = False
        self.touching = TouchQueue(
            store, self._felt, give_up=self._give_up_touch, line=line, wait_s=touch_wait_s
        )

    async def receive(
        self,
        new: NewPart,
        *,
        photos: Sequence[Upload] = (),
        scan: Upload | None = None,
        idempotency: IdempotencyKey | None = None,
    ) -> Received:
        """Read a new part.

        Raises:
            Problem: nothing to read, files that cannot be used, no room in the queue, a key used for another request.
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
            done, kept = await self.orders.read(
                photos,
                scan,
                name=new.name,
                expected="" if self._shadow else new.expected,
                database=new.database,
                job_name=new.job,
            )
            state, shadow = _standing(done, new.expected, shadow=self._shadow)
            touch, not_felt = None, ""
            plan = done.plan if state is PartState.TOUCH_NEEDED else None
            if state is PartState.TOUCH_NEEDED:
                if new.touch is Touch.PLAN or self.stage.there:
                    touch = TouchWait(new.touch is Touch.STAGE, self.touching.until())
                else:
                    state, not_felt = PartState.REVIEW, "there is no stage to feel it"
            part = await self._stored(
                self.store.add_part,
                part_id=part_id,
                name=new.name,
                state=state,
                readings=done.readings,
                evidence=kept,
                expected=new.expected,
                database=new.database,
                job=new.job,
                line=self.line,
                plan=plan,
                touch=touch,
                not_felt=not_felt,
                targets=self._targets,
                idempotency=idempotency,
                shadow=shadow,
                audit=self._policy.draw_audit(),
                rules=self._rules,
            )
            self._count(part, done)
            return part

        received = await self._requests.carry_out(idempotency, work)
        part = received.part
        if part.touch is not None and part.touch.by_stage and not self.draining:
            # also where the request was sent again because the service was killed at this place
            with contextlib.suppress(Problem):  # its history says so; it still waits, and is tried again
                part = await self.touching.felt(part)
        return replace(received, part=part)

    async def add_scan(
        self, part_id: str, scan: Upload, *, idempotency: IdempotencyKey | None = None
    ) -> Received:
        """Read a part again with its scan, fused with the camera's reading.

        Raises:
            Problem: as `receive`; no such part, or one that a person has reviewed.
        """

        async def work() -> PartRecord:
            part = await self._stored(self.store.part, part_id)
            _not_reviewed(part)
            return await self._read_scan(part, scan, idempotency)

        return await self._requests.carry_out(idempotency, work)

    async def touch(self, part_id: str) -> PartRecord:
        """Have the service's own stage scan a part, and read it again.

        Raises:
            Problem: as `add_scan`; a stage that cannot scan it.
        """
        part = await self._stored(self.store.part, part_id)
        _not_reviewed(part)
        if part.touch is None or part.plan is None:
            raise Problem(409, f"the part {part.id} does not wait for touch; it is {part.state.value}")
        self._refuse_at_the_end()
        if not part.touch.by_stage and self.stage.there:
            part = await self._stored(
                self.store.ask_for_touch, part.id, line=self.line, until=self.touching.until()
            )
        return await self.touching.felt(part)

    async def trigger(self, name: str, job: str = "") -> PartRecord:
        """Photograph and read the part under the camera by a job; feel it where the camera is unsure.

        Raises:
            Problem: as `receive`; no photograph and nothing to scan.
        """
        self._refuse_at_the_end()
        with self.orders.work_folder() as folder:
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

    def review(self, part_id: str, **said: Any) -> PartRecord:
        """Keep a person's review of a part, and send it on; arguments as `Store.review`.

        Raises:
            StoreError: as `Store.review`.
        """
        targets = () if self._in_shadow(self.store.part(part_id)) else self._targets
        part = self.store.review(part_id, targets=targets, readers=self._policy.readers, **said)
        self.on_result()
        if part.state is PartState.REVIEWED and part.review is not None:
            self.metrics.reviews.labels(part.review.action.value).inc()
        return part

    def undo_review(self, part_id: str, person: Person) -> PartRecord:
        """Take a person's own review back, and send on how the part stands.

        Raises:
            StoreError: as `Store.undo_review`.
        """
        targets = () if self._in_shadow(self.store.part(part_id)) else self._targets
        part = self.store.undo_review(part_id, person=person, targets=targets)
        self.on_result()
        return part

    async def _felt(self, part: PartRecord) -> PartRecord:
        """The part, felt by the stage and read.

        Raises:
            Problem: it could not be felt; its history says why.
        """
        hidden = self._in_shadow(part)
        try:
            done, kept = await self.stage.feel(
                part, expected="" if hidden else part.expected, earlier_photos=await self._photos_of(part)
            )
        except StageError as error:
            *_, last = await self._stored(self.store.history, part.id)
            why = {"why": str(error)}
            if (last.kind, last.data) != ("touch_failed", why):  # once, however often it is tried
                await self._stored(self.store.note_event, part.id, "touch_failed", why)
            raise _stage_problem(error) from error
        return await self._add(part, done, kept, None)

    async def _give_up_touch(self, part: PartRecord, why: str) -> None:
        targets = () if self._in_shadow(part) else self._targets
        self._announce(await self._stored(self.store.give_up_touch, part.id, why=why, targets=targets))

    def _refuse_at_the_end(self) -> None:
        if self.draining:
            raise stopping()

    async def _photos_of(self, part: PartRecord) -> tuple[Path, ...]:
        records = await self._stored(self.store.evidence, part.id)
        photos = [e.sha256 for e in records if e.kind is EvidenceKind.PHOTO and not e.gone]
        return await asyncio.to_thread(self.evidence.whole, photos)

    async def _read_scan(
        self, part: PartRecord, scan: Upload, idempotency: IdempotencyKey | None
    ) -> PartRecord:
        done, kept = await self.orders.read(
            (),
            scan,
            name=part.name,
            expected="" if self._in_shadow(part) else part.expected,
            database=part.database,
            job_name=part.job,
            earlier_photos=await self._photos_of(part),
        )
        return await self._add(part, done, kept, idempotency)

    async def _add(
        self, part: PartRecord, done: Done, kept: list[EvidenceRecord], idempotency: IdempotencyKey | None
    ) -> PartRecord:
        hidden = self._in_shadow(part)
        state, shadow = _standing(done, part.expected, shadow=hidden)
        read = await self._stored(
            self.store.add_readings,
            part.id,
            readings=done.readings,
            state=state,
            evidence=kept,
            targets=() if hidden else self._targets,
            idempotency=idempotency,
            shadow=shadow,
            audit=self._policy.draw_audit(),
            rules=self._rules,
        )
        self._count(read, done)
        return read

    def _in_shadow(self, part: PartRecord) -> bool:
        """Whether nothing is decided of a part, now or ever: one that was read in shadow mode stays there."""
        return self._shadow or part.shadow is not None

    async def _stored(self, function: Callable[..., T], *arguments: Any, **options: Any) -> T:
        return await asyncio.to_thread(function, *arguments, **options)

    def _announce(self, part: PartRecord) -> None:
        self.on_result()
        felt_at_once = part.touch is not None and part.touch.by_stage
        if self.on_part is not None and not felt_at_once:
            announcing = asyncio.ensure_future(self.on_part(part))
            self._announcing.add(announcing)  # a task that nobody holds may vanish
            announcing.add_done_callback(self._announcing.discard)
        self.metrics.parts.labels(part.state.value).inc()

    def _count(self, part: PartRecord, done: Done) -> None:
        self._announce(part)
        last = done.readings[-1]
        # messages that the reading had not are what speaks against its serial
        for why in () if part.reading is None else part.reading.messages[len(last.messages) :]:
            self.metrics.serial_alarms.inc()
            log.warning("serial alarm", part=part.id, name=part.name, why=why)
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


def _standing(done: Done, expected: str, *, shadow: bool) -> tuple[PartState, ShadowRecord | None]:
    """Where a part stands by its last reading."""
    if shadow:
        return PartState.SHADOW, compared(done.readings[-1], expected)
    return state_after(done.readings[-1]), None


def _stage_problem(error: StageError) -> Problem:
    """What a stage or camera could not do, as an answer: a driver that is down is not the caller's mistake."""
    if isinstance(error, StageDownError):
        return Problem(503, str(error), headers={"Retry-After": "30"})
    return Problem(422, str(error))


def _not_reviewed(part: PartRecord) -> None:
    if part.state is PartState.REVIEWED:
        raise Problem(
            409, f"the part {part.id} was reviewed by a person; send it as a new part to read it again"
        )
