"""How the service runs; every setting has a default that works on one machine.

tactile-marks.toml      [service]                       (beside the settings of reading, which stand at the top)
                        port = 8417
environment             TACTILE_MARKS_SERVICE_PORT=8417
flags                   serve --port 8417
"""

from __future__ import annotations

import ipaddress
import re
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from pipeline.common.parsed import json_of
from pipeline.common.settings import Names, Settings
from pipeline.workers.executors import cores

STORE_FILE = "store.db"
Port = Annotated[int, Field(ge=0, le=65535)]


def _networks(value: tuple[str, ...]) -> tuple[str, ...]:
    for network in value:
        ipaddress.ip_network(network)
    return value


def _prefix(value: str) -> str:
    if value and re.fullmatch(r"(/[A-Za-z0-9._~-]+)+", value) is None:
        raise ValueError("it is not a path in front of addresses; write it as /marks, without a / at its end")
    return value


def _web_address(value: str) -> str:
    if value and not value.startswith(("http://", "https://")):
        raise ValueError("it is not a web address; begin it with https:// or http://")
    return value


def _broker(value: str) -> str:
    if value and not value.startswith(("mqtt://", "mqtts://")):
        raise ValueError("it is not a broker's address; write mqtt://host:1883 or mqtts://host:8883")
    return value


def _from_json(value: Any) -> Any:
    return json_of(value) if isinstance(value, str) else value


class ServiceSettings(Settings):
    """Settings of the service."""

    table: ClassVar[str] = "service"

    host: str = "127.0.0.1"
    """Address to listen on. One that other machines can reach needs tokens (tactile-marks tokens add)."""
    port: Port = 8417
    """Port of the web interface; 0 takes any free one."""
    folder: Path = Path("tactile-marks-data")
    """Folder for the store, the evidence files and glyph databases; made if it is missing."""
    store: str = ""
    """Address of the store: sqlite:///FILE or postgresql://user@host/marks. A file in the folder unless given."""
    line: str = Field(default="", max_length=100)
    """Name of the line that the service stands at, kept with its parts. Services that share a store need one each:
    a stage feels the parts of its own line."""
    tokens: Literal["auto", "on", "off"] = "auto"
    """Whether requests need a token; auto: all if other machines can reach the host, else those of other users of this
    machine, such as a proxy (on Linux, where the user can be seen)."""
    hosts: Names = ()
    """Name that the service is called by, beside its address; may be repeated. Without tokens, requests for other
    names are refused."""
    tls_cert: Path | None = None
    """Certificate of the web interface, with those that vouch for it (PEM); with it the service speaks HTTPS."""
    tls_key: Path | None = None
    """Private key of that certificate (PEM), without a password; in the certificate's file unless given."""
    trusted_proxies: Annotated[Names, AfterValidator(_networks)] = ()
    """Address or network of a proxy that may pass requests on, such as 127.0.0.1; may be repeated. Where its callers
    come from, and whether by TLS, is then taken from what it says (X-Forwarded-For, X-Forwarded-Proto)."""
    root_path: Annotated[str, AfterValidator(_prefix)] = ""
    """Path that a proxy puts in front of the service's addresses, such as /marks: for the links in answers. Pages need
    none; the proxy may pass the path on or take it off."""
    connections: int = Field(default=200, ge=1, le=1000)
    """Connections that one address may have at a time; a trusted proxy any number."""
    jobs: int = Field(default_factory=cores, ge=1, le=256)
    """Processes that read; one for each core unless given."""
    queue: int = Field(default=64, ge=0, le=100_000)
    """Parts that may wait for a process; more are refused at once, with 503."""
    part_timeout_s: float = Field(default=120.0, gt=0.0, le=3600.0)
    """Seconds after which the service gives a part up."""
    worker_memory_mb: int = Field(default=4096, ge=0, le=1_000_000)
    """Memory for the data of each process, in MB; 0: no limit."""
    max_upload_mb: int = Field(default=100, ge=1, le=100_000)
    """Largest request, in MB."""
    max_photo_pixels: int = Field(default=40_000_000, ge=64)
    """Largest photograph; checked before it is decoded."""
    max_map_samples: int = Field(default=30_000_000, ge=4)
    """Largest height map; checked before it is decoded."""
    databases: Path | None = None
    """Folder of glyph databases (.glyphs) that requests may choose from; databases in the folder unless given."""
    jobs_folder: Path | None = None
    """Folder of job files (NAME.toml) that requests and triggers name; jobs in the folder unless given."""
    retention_days: float = Field(default=90.0, ge=0.0, le=36_500.0)
    """Days for which photographs, scans and pictures are kept; 0: for ever."""
    second_reader: bool = False
    """A part is reviewed when two people have said the same of it; the second does not see what was read."""
    audit_per_thousand: float = Field(default=0.0, ge=0.0, le=1000.0)
    """Of a thousand accepted parts so many, drawn at random, are read by a person as well, who does not see what was
    accepted; the dashboard tells how many parts are accepted wrong."""
    stage: Path | None = None
    """Folder of height maps for the simulated whisker stage: NAME.npz is the part called NAME. Without it there is
    no stage."""
    stage_driver: str = ""
    """module:callable that makes the driver of a real stage instead (pipeline.service.stage.Stage)."""
    bench: Path | None = None
    """Bench file (bench.toml) of a real stage that is moved by G-code, instead; it feels pass by pass."""
    active_stage: bool = True
    """Feel parts pass by pass until the serial is sure, for at most budget_s, by a stage that has sessions (open); off,
    and by other stages, the whole plan is scanned (feel)."""
    camera: Path | None = None
    """Folder into which the camera puts its pictures: NAME.png is the part called NAME."""
    stage_timeout_s: float = Field(default=60.0, gt=0.0, le=3600.0)
    """Seconds that the driver of a real stage has for one pass; for a whole plan it has the plan's own time beside."""
    touch_wait_s: float = Field(default=900.0, gt=0.0, le=604_800.0)
    """Seconds that a part waits for touch; then a person gets it."""
    camera_driver: str = ""
    """module:callable that makes the driver of a real camera instead (pipeline.service.stage.Camera)."""
    camera_timeout_s: float = Field(default=30.0, gt=0.0, le=3600.0)
    """Seconds that the camera has for the photographs of a part."""
    shadow: bool = False
    """Shadow mode: parts are read and compared with what the line's own reader says (expected), and nothing is decided
    or published; the page /shadow shows how the two agree."""
    duplicates: bool = False
    """Send a part to a person whose serial another part bears."""
    sequence_jump: int = Field(default=0, ge=0, le=1_000_000)
    """Send a part to a person whose serial is further than this from its place in the row; 0: never."""
    order: Path | None = None
    """Production order, a file of serials or ranges (KX400000..KX409999): a part with another goes to a person."""
    watch: Path | None = None
    """Folder to watch: every photograph that is put into it is read as a part, once, named by its file's stem."""
    watch_job: str = ""
    """Job that the photographs of that folder are read by; the service's own settings unless given."""
    watch_every_s: float = Field(default=1.0, ge=0.05, le=3600.0)
    """Seconds between two looks into that folder; a photograph is complete when two looks find it alike."""
    watch_photos: int = Field(default=0, ge=0, le=12)
    """Photographs of a part in the watched folder, where its files are numbered (part.light-1.png): with so many it is
    read at once; 0: as many as come."""
    watch_settle_s: float = Field(default=2.0, ge=0.05, le=3600.0)
    """A part of numbered photographs is read when none was added or changed for so long."""
    line_host: str = "127.0.0.1"
    """Address of the TCP port and the OPC UA server, which know no tokens."""
    tcp_port: Port | None = None
    """Trigger port for line controllers (raw TCP); closed unless given."""
    tcp_format: str = ""
    """Its result string, such as {name};{decision};{text}."""
    tcp_clients: Annotated[Names, AfterValidator(_networks)] = ()
    """Address or network that may use the TCP port, such as 192.168.7.0/24; may be repeated. Any unless given."""
    opcua_port: Port | None = None
    """Port of the OPC UA server (extra opcua); closed unless given."""
    opcua_certificate: Path | None = None
    """Certificate of the OPC UA server; with it every connection is signed and encrypted."""
    opcua_key: Path | None = None
    """Private key of that certificate."""
    opcua_users: Annotated[dict[str, str], BeforeValidator(_from_json)] = Field(
        default_factory=dict, repr=False
    )
    """Passwords of the OPC UA server by user; without any, everybody may call who can reach it. In the environment
    as JSON: {"line": "secret"}."""
    mqtt: Annotated[str, AfterValidator(_broker)] = ""
    """Broker to publish results to (extra mqtt), mqtt://host:1883 or mqtts://user:password@host:8883."""
    mqtt_prefix: str = "tactile-marks"
    """First level of the topics."""
    mqtt_version: Literal["5", "3.1.1"] = "5"
    """Version of MQTT. With 3.1.1 a broker cannot say that it refuses a result, and one that it refuses is lost."""
    webhook: Annotated[str, AfterValidator(_web_address)] = ""
    """Web address to post results to; signed where webhook_secret is set."""
    alert_reject_rate: float = Field(default=0.0, ge=0.0, lt=1.0)
    """Share of rejects among the latest parts above which an alert is sent (webhook, MQTT) and shown; 0: none."""
    alert_review_rate: float = Field(default=0.0, ge=0.0, lt=1.0)
    """The same of parts that a person must look at."""
    alert_window: int = Field(default=200, ge=10, le=10_000)
    """Latest parts that those shares are of."""
    golden: Path | None = None
    """Relief of the golden part, which shows how whiskers wear: its height map, or the TOML of a test piece."""
    golden_every_h: float = Field(default=0.0, ge=0.0, le=10_000.0)
    """Hours after which an alert asks for a scan of the golden part; 0: never."""
    webhook_secret: str = Field(default="", repr=False)
    """Key of the signature; better in the file or the environment than in a flag."""
    drain_s: float = Field(default=1.0, ge=0.0, le=600.0)
    """Seconds for which the service that is asked to stop still answers: /readyz says that it is stopping, new parts
    are refused, and whoever sends them parts can look for another."""
    shutdown_grace_s: float = Field(default=20.0, ge=0.0, le=600.0)
    """Seconds that running requests have to end when the service stops."""
    log: Literal["json", "text"] = "json"
    """Log lines as JSON, or as text for a person."""

    @model_validator(mode="after")
    def _ask_beyond_loopback(self) -> ServiceSettings:
        if self.tokens == "off" and not self.on_loopback:
            raise ValueError(
                f"the host {self.host} can be reached from other machines; without tokens listen on 127.0.0.1 only"
            )
        if not is_loopback(self.line_host):
            if self.tcp_port is not None and not self.tcp_clients:
                raise ValueError(
                    f"the TCP port at {self.line_host} can be reached from other machines and asks for no token; name "
                    "the addresses that may call: tcp_clients"
                )
            if self.opcua_port is not None and not (self.opcua_certificate and self.opcua_users):
                raise ValueError(
                    f"the OPC UA server at {self.line_host} can be reached from other machines; give it "
                    "opcua_certificate, opcua_key and opcua_users"
                )
        return self

    @property
    def on_loopback(self) -> bool:
        """Whether only this machine can call."""
        return is_loopback(self.host)

    @property
    def tokens_asked(self) -> bool:
        """Whether all requests need a token."""
        return self.tokens == "on" or (self.tokens == "auto" and not self.on_loopback)

    @property
    def store_url(self) -> str:
        """Where the store is."""
        return self.store or f"sqlite:///{(self.folder / STORE_FILE).absolute()}"

    @property
    def evidence_folder(self) -> Path:
        """Where photographs, scans and pictures are kept."""
        return self.folder / "evidence"

    @property
    def watch_journal(self) -> Path:
        """What became of the files of the watched folder."""
        return self.folder / "watched.db"

    @property
    def databases_folder(self) -> Path:
        """Where glyph databases are looked for."""
        return self.databases if self.databases is not None else self.folder / "databases"

    @property
    def job_files(self) -> Path:
        """Where jobs are looked for."""
        return self.jobs_folder if self.jobs_folder is not None else self.folder / "jobs"


def is_loopback(host: str) -> bool:
    """Whether an address can be reached from its own machine alone."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
