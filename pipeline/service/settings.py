"""Settings of the service, one class for each subsystem; each is passed to the code that it configures.

tactile-marks.toml      [service]                       (beside the settings of reading, which stand at the top)
                        port = 8417
                        [service.mqtt]
                        url = "mqtt://broker:1883"
environment             TACTILE_MARKS_SERVICE_PORT=8417, TACTILE_MARKS_SERVICE_MQTT_URL=mqtt://broker:1883
flags                   serve --port 8417 --mqtt.url mqtt://broker:1883
"""

from __future__ import annotations

import ipaddress
import re
from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from random import SystemRandom
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal
from urllib.parse import unquote, urlsplit

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from pipeline.common.parsed import json_of
from pipeline.common.settings import GIVEN_UP, Names, Settings

if TYPE_CHECKING:
    from pipeline.common.people_records import Person
    from pipeline.common.records import PartStory, ReviewRecord

STORE_FILE = "store.db"
Rate = Annotated[float, Field(ge=0.0, lt=1.0)]
Seconds = Annotated[float, Field(gt=0.0, le=3600.0)]


def _address(value: str) -> str:
    host_and_port(value)
    return value


def host_and_port(address: str) -> tuple[str, int]:
    """Host and port to listen on: PORT, for this machine only, or HOST:PORT. Raises ValueError: it is neither."""
    wanted = ValueError(
        "it is not a port; write 8418, or 192.168.7.10:8418 for one that other machines can reach"
    )
    if address.isdecimal():
        address = f"127.0.0.1:{address}"
    parts = urlsplit(f"//{address}")
    try:
        host, port = parts.hostname, parts.port
    except ValueError as error:
        raise wanted from error
    if host is None or port is None or parts.netloc != address or "@" in address:
        raise wanted
    return host, port


def _networks(value: tuple[str, ...]) -> tuple[str, ...]:
    for network in value:
        ipaddress.ip_network(network)
    return value


def _prefix(value: str) -> str:
    if value and re.fullmatch(r"(/[A-Za-z0-9._~-]+)+", value) is None:
        raise ValueError("it is not a path in front of addresses; write it as /marks, without a / at its end")
    return value


def _web_address(value: str) -> str:
    parts = urlsplit(value)
    if value and (parts.scheme not in ("http", "https") or not parts.hostname):
        raise ValueError("it is not a web address; write https://host/path or http://host/path")
    return value


def _broker(value: str) -> str:
    parts = urlsplit(value)
    if value and (parts.scheme not in ("mqtt", "mqtts") or not parts.hostname):
        raise ValueError("it is not a broker's address; write mqtt://host:1883 or mqtts://host:8883")
    if parts.path and not re.fullmatch(r"/[^+#\0/$][^+#\0]*(?<!/)", unquote(parts.path)):
        raise ValueError("its path is not the beginning of a topic; use a word such as line-4")
    return value


def _from_json(value: Any) -> Any:
    return json_of(value) if isinstance(value, str) else value


def _as_text(value: Any) -> Any:
    return str(value) if isinstance(value, int | Path) and not isinstance(value, bool) else value


Networks = Annotated[Names, AfterValidator(_networks)]
Address = Annotated[str, BeforeValidator(_as_text), AfterValidator(_address)]


class TlsSettings(Settings):
    """TLS of the web interface."""

    certificate: Path | None = None
    """Certificate of the web interface, with the intermediate ones (PEM); with it the service speaks HTTPS."""
    key: Path | None = None
    """Private key of that certificate (PEM), without a password. Default: in the certificate's file."""


class ReviewMode(StrEnum):
    """Modes of review; all but OPEN are blind: they show the pictures, but no reading."""

    OPEN = "open"
    # after another reader, with whom the result must agree
    SECOND = "second"
    # an accepted part, drawn at random
    AUDIT = "audit"


class ReviewSettings(Settings):
    """The review policy: number of readers that must agree, share of accepted parts to audit, and blind reading."""

    second_reader: bool = False
    """A part is reviewed when two people have read the same text; the second one does not see what was read before."""
    audit_per_thousand: float = Field(default=0.0, ge=0.0, le=1000.0)
    """Accepted parts per thousand, drawn at random, that a person reads as well, without seeing the accepted text.
    The dashboard shows how many parts are accepted wrong."""

    @property
    def readers(self) -> int:
        return 2 if self.second_reader else 1

    def draw_audit(self) -> bool:
        """Draw at random whether a part is audited if it is accepted; the draw cannot be predicted."""
        return 1000.0 * SystemRandom().random() < self.audit_per_thousand

    def mode(self, story: PartStory, person: Person) -> ReviewMode:
        from pipeline.common.records import PartState

        if story.awaits_audit:
            return ReviewMode.AUDIT
        others = self.second_reader and story.part.state is PartState.REVIEW and bool(story.opinions)
        return ReviewMode.SECOND if others and not any(map(person.wrote, story.opinions)) else ReviewMode.OPEN

    def shown(self, story: PartStory, person: Person) -> tuple[ReviewRecord, ...]:
        """Reviews of a part that a person may see: a second reader sees no opinion before reading the part."""
        hidden = story.opinions if self.mode(story, person) is ReviewMode.SECOND else ()
        return tuple(review for review in story.reviews if review not in hidden)


class SerialSettings(Settings):
    """Duplicate, order and sequence checks."""

    duplicates: bool = False
    """Send a part to a person if another part has the same serial."""
    jump: int = Field(default=0, ge=0, le=1_000_000)
    """Send a part to a person if its serial is further than this from its place in the sequence; 0: never."""
    order: Path | None = None
    """Production order, a file of serials or ranges (KX400000..KX409999); a part with another goes to a person."""


class StageSettings(Settings):
    """The whisker stage."""

    device: Annotated[str, BeforeValidator(_as_text)] = ""
    """The stage: a bench file (bench.toml) of a stage that is moved by G-code and feels pass by pass; module:callable
    that makes the driver of another (pipeline.service.stage.Stage); or a folder of height maps for a simulated stage,
    where NAME.npz is the part called NAME. Default: no stage."""
    wait_s: float = Field(default=900.0, gt=0.0, le=604_800.0)
    """Seconds that a part waits for touch before it goes to a person."""


class CameraSettings(Settings):
    """The camera."""

    device: Annotated[str, BeforeValidator(_as_text)] = ""
    """The camera: a folder into which its own program puts pictures, where NAME.png is the part called NAME, a trigger
    waits for a new one, and one picture is read for one part only; or module:callable that makes its driver
    (pipeline.service.stage.Camera). Default: no camera."""
    early_s: float = Field(default=0.0, ge=0.0, le=604_800.0)
    """Seconds by which a picture in that folder may be older than its trigger, for a camera that is triggered before
    the service."""


class WatchSettings(Settings):
    """The watched folder."""

    folder: Path | None = None
    """Folder to watch: every photograph that is put into it is read as a part, once, named by its file's stem; those of
    its subfolders, too, unless they are links or hidden (.archive): their parts' names begin with the subfolder's."""
    expected: bool = False
    """NAME.txt, written beside NAME.png before it, holds the serial that the part should read."""
    job: str = ""
    """Job by which the photographs of that folder are read. Default: the service's own settings."""
    photos: int = Field(default=0, ge=0, le=12)
    """Number of photographs of a part whose files are numbered (part.light-1.png): with so many it is read at once,
    and with fewer after 10 s; 0: any number, read 2 s after the last one."""


class TcpSettings(Settings):
    """The TCP trigger port."""

    port: Address | None = None
    """Trigger port for line controllers (raw TCP), which asks for no token: 8418 for this machine only, or with the
    address to listen on, 192.168.7.10:8418. Default: closed."""
    format: str = ""
    """Format of its answers, such as {name};{decision};{text}."""
    clients: Networks = ()
    """Address or network that may use the TCP port, such as 192.168.7.0/24; may be repeated. Default: any."""


class OpcUaSettings(Settings):
    """The OPC UA server (extra opcua)."""

    port: Address | None = None
    """Port of the OPC UA server, which asks for no token: 4840 for this machine only, or with the address to listen on,
    192.168.7.10:4840. Default: closed."""
    certificate: Path | None = None
    """Certificate of the OPC UA server; with it every connection is signed and encrypted. Default: that of TLS."""
    key: Path | None = None
    """Private key of that certificate. Default: that of TLS."""
    users: Annotated[dict[str, str], BeforeValidator(_from_json)] = Field(default_factory=dict, repr=False)
    """Passwords of the OPC UA server by user; without users, everybody with access to the port may call. In the
    environment as JSON: {"line": "secret"}."""


class MqttSettings(Settings):
    """Results over MQTT (extra mqtt)."""

    url: Annotated[str, AfterValidator(_broker)] = Field(default="", repr=False)
    """Broker to publish results to, mqtt://host:1883 or mqtts://user:password@host:8883. A path is the first level of
    the topics: mqtt://host/line-4. Default: tactile-marks."""
    payload: Literal["full", "short"] = "full"
    """Content of a result: the whole record of the part, or its id, name, state, decision, text, candidate, confidence
    and source."""
    triggers: bool = False
    """Take triggers and releases, which whoever may write to the topics PREFIX/trigger and PREFIX/touch can send."""

    @property
    def prefix(self) -> str:
        return unquote(urlsplit(self.url).path).lstrip("/") or "tactile-marks"


class WebhookSettings(Settings):
    """Results over HTTP."""

    url: Annotated[str, AfterValidator(_web_address)] = ""
    """Web address to post results to."""
    secret: str = Field(default="", repr=False)
    """Key of the signature; better in the file or the environment than in a flag. Default: unsigned."""


class AlertSettings(Settings):
    """Alerts about the latest parts."""

    reject_rate: Rate = 0.0
    """Share of rejects among the latest 200 parts above which an alert is sent (webhook, MQTT) and shown; 0: none."""
    review_rate: Rate = 0.0
    """The same for parts that go to a person."""


class GoldenSettings(Settings):
    """The golden part."""

    relief: Path | None = None
    """Relief of the golden part, which shows the wear of the whiskers: its height map, or the TOML of a test piece."""
    every_h: float = Field(default=0.0, ge=0.0, le=10_000.0)
    """Hours after which an alert asks for a scan of the golden part; 0: never."""


class ServiceSettings(Settings):
    """Settings of the service."""

    table: ClassVar[str] = "service"
    replaced: ClassVar[Mapping[str, str]] = {
        **dict.fromkeys(("connections", "queue", "worker_memory_mb"), ""),
        **dict.fromkeys(("limits.photo_pixels", "limits.map_samples", "log"), ""),
        **dict.fromkeys(("limits.upload_mb", "upload_mb"), ""),
        "part_timeout_s": GIVEN_UP,
        "alerts.window": "alerts.reject_rate (of the latest 200 parts)",
        "jobs": "jobs in [workers]",
        **dict.fromkeys(("stage.timeout_s", "camera.timeout_s"), "device_timeout_s"),
        "shutdown_grace_s": "drain_s",
        "watch.settle_s": "watch.photos",
        "mqtt.prefix": 'mqtt.url = "mqtt://HOST/PREFIX"',
        "databases": "folder (its databases stand in databases)",
        "jobs_folder": "folder (its jobs stand in jobs)",
        **dict.fromkeys(("stage.folder", "stage.bench", "stage.driver"), "stage.device"),
        **dict.fromkeys(("camera.folder", "camera.driver"), "camera.device"),
        "host": 'port = "HOST:PORT"',
        "tcp.host": 'tcp.port = "HOST:PORT"',
        "opcua.host": 'opcua.port = "HOST:PORT"',
    }

    port: Address = "8417"
    """Port of the web interface: 8417 for this machine only, or with the address to listen on, 0.0.0.0:8417. One that
    other machines can reach needs tokens (tactile-marks tokens add). 0 takes any free port."""
    folder: Path = Path("tactile-marks-data")
    """Folder for the store, the evidence files, glyph databases (databases) and jobs (jobs/NAME.toml); made if it is
    missing."""
    store: str = ""
    """Address of the store: sqlite:///FILE or postgresql://user@host/marks. Default: a file in the folder."""
    line_name: str = Field(default="", max_length=100)
    """Name of the line that the service stands at, kept with its parts. Services that share a store need different
    names: a stage feels the parts of its own line."""
    tokens: Literal["auto", "on", "off"] = "auto"
    """Whether requests need a token; auto: all if other machines can reach the host, else those of other users of this
    machine, such as a proxy (on Linux, where the user can be seen)."""
    hosts: Names = ()
    """Host name of the service, beside its address; may be repeated. Without tokens, requests for other
    names are refused."""
    trusted_proxies: Networks = ()
    """Address or network of a proxy that may pass requests on, such as 127.0.0.1; may be repeated. The
    address and scheme of its callers are then taken from its headers (X-Forwarded-For, X-Forwarded-Proto)."""
    root_path: Annotated[str, AfterValidator(_prefix)] = ""
    """Path that a proxy puts in front of the service's addresses, such as /marks: for the links in answers. Pages need
    none; the proxy may pass the path on or take it off."""
    device_timeout_s: Seconds = 60.0
    """Seconds within which a stage must answer a pass, and a camera must have the photographs of a part; a whole plan
    has twice its own duration beside."""
    retention_days: float = Field(default=90.0, ge=0.0, le=36_500.0)
    """Days for which photographs, scans and pictures are kept; 0: for ever."""
    shadow: bool = False
    """Shadow mode: parts are read and compared with what the line's own reader says (expected), and nothing is decided
    or published; the page /shadow shows how the two agree."""
    drain_s: float = Field(default=1.0, ge=0.0, le=600.0)
    """Seconds for which the service still answers after it is asked to stop: /readyz says that it is stopping, new
    parts are refused, and senders can turn to another service. Requests that still run then have 20 s to end."""
    tls: TlsSettings = TlsSettings()
    review: ReviewSettings = ReviewSettings()
    serials: SerialSettings = SerialSettings()
    stage: StageSettings = StageSettings()
    camera: CameraSettings = CameraSettings()
    watch: WatchSettings = WatchSettings()
    tcp: TcpSettings = TcpSettings()
    opcua: OpcUaSettings = OpcUaSettings()
    mqtt: MqttSettings = MqttSettings()
    webhook: WebhookSettings = WebhookSettings()
    alerts: AlertSettings = AlertSettings()
    golden: GoldenSettings = GoldenSettings()

    # here and not in the sections, or pydantic's error would hold the passwords
    @model_validator(mode="after")
    def _check_ports(self) -> ServiceSettings:
        tcp, opcua = self.tcp, self.opcua_server
        tcp_host = None if tcp.port is None else host_and_port(tcp.port)[0]
        if self.tokens == "off" and not self.on_loopback:
            raise ValueError(
                f"the host {self.host} can be reached from other machines; without tokens listen on 127.0.0.1 only"
            )
        if tcp_host is not None and not is_loopback(tcp_host) and not tcp.clients:
            raise ValueError(
                f"the TCP port at {tcp_host} can be reached from other machines and asks for no token; name the "
                "addresses that may call: tcp.clients"
            )
        if opcua.port is None:
            return self
        host, _ = host_and_port(opcua.port)
        if not is_loopback(host) and not (opcua.certificate and opcua.users):
            raise ValueError(
                f"the OPC UA server at {host} can be reached from other machines; give it opcua.certificate, "
                "opcua.key and opcua.users"
            )
        if (opcua.certificate is None) != (opcua.key is None):
            raise ValueError("opcua.certificate needs opcua.key, and the key its certificate; give both")
        if opcua.users and opcua.certificate is None:
            raise ValueError(
                "opcua.users need opcua.certificate, else their passwords can be read on the way; give one"
            )
        return self

    @property
    def host(self) -> str:
        return host_and_port(self.port)[0]

    @property
    def on_loopback(self) -> bool:
        return is_loopback(self.host)

    @property
    def opcua_server(self) -> OpcUaSettings:
        """Settings of the OPC UA server, with certificate and key of TLS if it has none of its own."""
        if self.opcua.certificate is not None or self.opcua.key is not None:
            return self.opcua
        return self.opcua.model_copy(update={"certificate": self.tls.certificate, "key": self.tls.key})

    @property
    def tokens_asked(self) -> bool:
        return self.tokens == "on" or (self.tokens == "auto" and not self.on_loopback)

    @property
    def store_url(self) -> str:
        return self.store or f"sqlite:///{(self.folder / STORE_FILE).absolute()}"

    @property
    def evidence_folder(self) -> Path:
        return self.folder / "evidence"

    @property
    def databases_folder(self) -> Path:
        return self.folder / "databases"

    @property
    def job_files(self) -> Path:
        return self.folder / "jobs"


def is_loopback(host: str) -> bool:
    """Whether only its own machine can reach an address."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
