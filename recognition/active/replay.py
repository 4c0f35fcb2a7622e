"""Record how a part is felt pass by pass, with every choice, and replay the recording.

session --KeptSession--> ActiveReader --> ActiveReading --kept--> Scan with its log of passes
the scan --RecordedSession--> ActiveReader --> the same passes, texts and stop reason
"""

from __future__ import annotations

from dataclasses import replace

from recognition.active.active_reader import ActiveReader, ActiveSettings
from recognition.active.active_reading import ActiveReading, PassFelt, StopReason, stage_failure
from recognition.decide.decision import Finding, ReadingFlag
from recognition.touch import TactileReader
from whisker_array.scan.pass_log import LoggedPass, PassLog
from whisker_array.scan.recorded_session import KeptSession, RecordedSession
from whisker_array.scan.scan import Scan
from whisker_array.scan.session import StageSession


def read_kept(reader: TactileReader, session: StageSession, *, budget_s: float) -> ActiveReading:
    """Feel and read a part, and log its passes in the scan, so that it can be replayed. The session stays open.

    Args:
        reader: reader by touch.
        session: stage session with the part mounted.
        budget_s: maximum stage time, s.
    """
    kept = KeptSession(session)
    found = ActiveReader(reader, ActiveSettings(budget_s=budget_s)).read(kept)
    if found.scan is None:
        return found
    log = PassLog(
        tuple(
            LoggedPass(order, sweep, felt.why, felt.text, felt.confidence)
            for (order, sweep), felt in zip(kept.felt, found.passes, strict=True)
        ),
        array=kept.fitting.array,
        height_mm=kept.fitting.height_mm,
        field_mm=kept.fitting.field_mm,
        stopped=found.stop.value,
        problem=found.problem,
        budget_s=budget_s,
    )
    return replace(found, evidence=found.evidence.logged(scan=replace(found.scan, log=log)))


def replay(reader: TactileReader, scan: Scan) -> ActiveReading:
    """Replay a recording: the same passes are chosen again, one after the other.

    A reader with other settings or of another version may choose other passes. It then reads all recorded passes at
    once.

    Args:
        reader: reader by touch.
        scan: scan with a log of passes.

    Raises:
        StageError: the scan has no log.
    """
    session = RecordedSession(scan)
    log = scan.log
    assert log is not None
    settings = ActiveSettings() if log.budget_s is None else ActiveSettings(budget_s=log.budget_s)
    found = ActiveReader(reader, settings).read(session)
    if session.ended and found.problem == log.problem and log.stopped in ("", found.stop.value):
        return replace(found, evidence=found.evidence.logged(scan=scan))
    passes, spent = [], 0.0
    for one in log.passes:
        spent += one.order.stage_s
        passes.append(PassFelt(one.order, spent, why=one.why, text=one.text, confidence=one.confidence))
    known = log.stopped in set(StopReason)
    evidence = reader.of_recording(scan).logged(chosen_passes=True)
    if log.problem:
        failed = Finding(ReadingFlag.STAGE_FAILED, stage_failure(log.problem, passes=len(log.passes)))
        evidence = evidence.logged(findings=(*evidence.log.findings, failed))
    return ActiveReading(
        evidence,
        reader.reading_of(evidence),
        tuple(passes),
        StopReason(log.stopped) if known else StopReason.ALL_FELT,
        problem=log.problem,
    )
