"""Record how a part is felt pass by pass, and read such a recording again.

session --ActiveReader--> ActiveReading --read_and_log--> Scan with its log of passes and texts
the scan --logged_evidence--> evidence of all its passes at once; the texts stay those of the log
"""

from __future__ import annotations

from dataclasses import replace

from recognition.active.active_reader import ActiveReader, ActiveSettings
from recognition.active.active_reading import ActiveReading, stage_failure
from recognition.decide.decision import Finding, ReadingFlag
from recognition.decide.evidence import SenseEvidence
from recognition.touch import TactileReader
from whisker_array.scan.pass_log import PassLog
from whisker_array.scan.scan import Scan
from whisker_array.scan.session import StageSession


def read_and_log(reader: TactileReader, session: StageSession, *, budget_s: float) -> ActiveReading:
    """Feel and read a part, and log its passes in the scan. The session stays open."""
    reading = ActiveReader(reader, ActiveSettings(budget_s=budget_s)).read(session)
    if reading.scan is None:
        return reading
    log = PassLog(
        reading.passes,
        array=session.fitting.array,
        height_mm=session.fitting.height_mm,
        field_mm=session.fitting.field_mm,
        stopped=reading.stop.value,
        problem=reading.problem,
        budget_s=budget_s,
        region_mm=reading.region_mm,
        other_texts=reading.evidence.log.other_texts,
    )
    return replace(reading, evidence=reading.evidence.logged(scan=replace(reading.scan, log=log)))


def logged_evidence(reader: TactileReader, scan: Scan) -> SenseEvidence:
    """Evidence of a recording with a log of passes (else ValueError); a failed stage sends the part to review."""
    if scan.log is None:
        raise ValueError("the scan has no log of passes; read it by TactileReader.of_recording")
    evidence = reader.of_recording(scan, within_mm=scan.log.region_mm)
    evidence = evidence.logged(chosen_passes=True, other_texts=scan.log.other_texts)
    if not scan.log.problem:
        return evidence
    note = stage_failure(scan.log.problem, passes=len(scan.log.passes))
    failed = Finding(ReadingFlag.STAGE_FAILED, note)
    return evidence.logged(findings=(failed, *evidence.log.findings))
