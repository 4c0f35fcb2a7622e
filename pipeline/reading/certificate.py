"""Certificates: a threshold of confidence for acceptance, tested on labelled parts. A certificate is valid for the
program, networks and settings that it was made with; parts that are read with other settings are not accepted."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Any, ClassVar

from pydantic import ConfigDict, TypeAdapter, ValidationError

from glyphs.atomic import replacing
from glyphs.errors import FileError
from pipeline.common.accepted_risk import ThresholdTest, proven_threshold
from pipeline.common.settings import MapSettings, ReadSettings, SettingsError
from pipeline.common.shares import share_bounds
from pipeline.common.version import differences, file_sha256, reader_versions
from pipeline.errors import require_file
from pipeline.reading.certificate_statistics import KindOfParts
from recognition.decide.decision import CertifiedAcceptance
from recognition.decide.risk_text import risk_in_words

FORMAT_VERSION = 1
_MOST_BYTES = 20_000_000
_NOT_COVERED = {"certificate", "mode", *(name for name in MapSettings.model_fields if name != "rows")}
"""Settings that may differ from the certified ones. `rows` may not: like orientation, it decides on acceptance."""
_FILES = ("database", "lexicon", "whisker")
_AGAIN = "make a new one with: tactile-marks certify"


@dataclass(frozen=True, kw_only=True)
class Certificate:
    """Proven error rate of a reader on labelled parts. Raises ValueError: the numbers contradict each other."""

    made_at: datetime  # UTC
    risk: float  # largest permitted share of wrong readings among the accepted
    confidence: float  # level of confidence of that statement
    threshold: float
    sources: tuple[str, ...]
    parts: int  # with a known truth
    accepted: int  # of the parts
    wrong: int  # of the accepted
    bound: float  # upper bound of the share of wrong readings among the accepted, for this threshold alone
    tests: tuple[ThresholdTest, ...]
    kind: KindOfParts
    data_sha256: str  # of the parts' files and true texts
    settings: Mapping[str, Any]  # read settings that differ from the defaults; files are given by their hash
    versions: Mapping[str, str]  # of program and libraries, and hashes of the networks
    format_version: int = FORMAT_VERSION
    __pydantic_config__: ClassVar[ConfigDict] = ConfigDict(extra="forbid", strict=True)

    def __post_init__(self) -> None:
        if not (0.0 < self.risk < 1.0 and 0.0 < self.confidence < 1.0 and 0.0 <= self.threshold <= 1.0):
            raise ValueError("risk, confidence and threshold lie between 0 and 1")
        if not 0 <= self.wrong <= self.accepted <= self.parts:
            raise ValueError(
                f"{self.wrong} wrong of {self.accepted} accepted of {self.parts} parts cannot be true"
            )
        exact = share_bounds(self.wrong, self.accepted, confidence=self.confidence)[1]
        if not abs(exact - self.bound) < 1e-9 or self.bound > self.risk:
            raise ValueError(
                f"the share of {self.wrong} wrong of {self.accepted} is at most {exact:.6f}, not {self.bound:.6f}; "
                f"it must not exceed the risk {risk_in_words(self.risk)}"
            )
        chosen = proven_threshold(self.tests)
        if chosen is None or chosen.threshold != self.threshold or chosen.accepted != self.accepted:
            raise ValueError(f"the threshold {self.threshold:g} is not the one that its tests certify")

    @property
    def coverage(self) -> float:
        return self.accepted / self.parts

    @property
    def acceptance(self) -> CertifiedAcceptance:
        return CertifiedAcceptance(self.threshold, self.sources)

    def thresholds(self) -> dict[str, Any]:
        options = {
            name: self.settings[name] for name in ("accept_risk", "orientation") if name in self.settings
        }
        return {**options, "certified": self.acceptance}

    def describe(self) -> str:
        return (
            f"Of serials that are accepted from confidence {self.threshold:g}, at most {risk_in_words(self.risk)} are "
            f"wrong: shown with {100.0 * self.confidence:g} % confidence.\n"
            f"{self.wrong} of {self.accepted:,} accepted were wrong (at most {self.bound:.3%}); coverage "
            f"{self.coverage:.1%} of {self.parts:,} parts"
        )


def write_certificate(certificate: Certificate, path: Path) -> None:
    """Write a certificate as JSON. Raises FileError: the file cannot be written."""
    written = TypeAdapter(Certificate).dump_json(certificate, indent=1)
    with replacing(path) as temporary:
        temporary.write_bytes(written + b"\n")


def load_certificate(path: Path) -> Certificate:
    """Load a certificate. Raises FileError: there is no such file, or it is not a certificate of this format."""
    require_file(path, most_bytes=_MOST_BYTES)
    try:
        certificate: Certificate = TypeAdapter(Certificate).validate_json(path.read_bytes())
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(step) for step in first["loc"])
        why = f"{place}: {first['msg']}" if place else first["msg"]
        raise FileError(path, f"is not a certificate of this program ({why})", _AGAIN) from error
    if certificate.format_version != FORMAT_VERSION:
        raise FileError(
            path,
            f"has format version {certificate.format_version}; this program reads {FORMAT_VERSION}",
            _AGAIN,
        )
    return certificate


def certificate_of(settings: ReadSettings) -> Certificate | None:
    """Load the certificate of the settings, if any, and check it against program and settings. Raises FileError: it is
    no certificate. SettingsError: it was made with another program, other networks or other settings."""
    if settings.certificate is None:
        return None
    certificate = valid_certificate(settings.certificate)
    differ = differences(certificate.settings, settings_described(settings))
    if differ:
        raise SettingsError(
            f"the certificate {settings.certificate} was made with other settings ({differ})",
            hint="read with the certified settings, or certify again with these",
        )
    return certificate


def valid_certificate(path: Path) -> Certificate:
    """Load a certificate. Raises FileError: it is none. SettingsError: it is of another program or networks."""
    certificate = load_certificate(path)
    differ = differences(certificate.versions, reader_versions())
    if differ:
        raise SettingsError(
            f"the certificate {path} is not valid for this program ({differ})", hint="certify again"
        )
    return certificate


def acceptance_of(settings: ReadSettings) -> CertifiedAcceptance | None:
    """Certified acceptance, if there is a certificate; of no sources under other settings. Errors: `certificate_of`."""
    if settings.certificate is None:
        return None
    certificate = valid_certificate(settings.certificate)
    same = not differences(certificate.settings, settings_described(settings))
    return certificate.acceptance if same else replace(certificate.acceptance, sources=())


def settings_described(settings: ReadSettings) -> dict[str, Any]:
    """The settings that a certificate covers, as plain JSON values; files by a hash of their content (FileError)."""
    described = settings.model_dump(mode="json", exclude_defaults=True, exclude=_NOT_COVERED)
    for name in _FILES:
        if name in described:
            described[name] = _hash_of_file(Path(described[name]))
    if "font" in described:
        described["font"] = [
            _hash_of_file(Path(name)) if Path(name).is_file() else name for name in described["font"]
        ]
    return described


def _hash_of_file(path: Path) -> str:
    require_file(path, most_bytes=1_000_000_000)
    return f"sha256:{file_sha256(path)[:16]}"
