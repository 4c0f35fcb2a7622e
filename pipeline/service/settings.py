"""How the service runs; everything has a default that works on one machine.

tactile-marks.toml      [service]                       (beside the settings of reading, which stand at the top)
                        port = 8417
environment             TACTILE_MARKS_SERVICE_PORT=8417
flags                   serve --port 8417
"""

from __future__ import annotations

import ipaddress
import os
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, field_validator, model_validator
from pydantic_settings import BaseSettings, NoDecode, SettingsConfigDict

from pipeline.common.setting_sources import ENV_PREFIX, load

STORE_FILE = "store.db"
Megabytes = Annotated[int, Field(ge=1, le=100_000)]
Port = Annotated[int, Field(ge=0, le=65535)]


class ServiceSettings(BaseSettings):
    """Settings of the service, checked.

    Attributes:
        host: address to listen on.
        port: of the web interface; 0 takes any that is free.
        folder: for the store, the evidence and glyph databases; made if need be.
        store: URL of the store, sqlite:///... or postgresql://...; a file in the folder unless given.
        tokens: whether a token is asked for; "auto" asks beyond the loopback address.
        hosts: names under which the service is called, beside its address; others are refused where no token is asked.
        workers: processes that read; as many as there are cores unless given.
        queue: parts that may wait for a worker; more are refused at once.
        job_timeout_s: after which a part that cannot be read is given up.
        worker_memory_mb: of data for each worker; 0 is no limit.
        max_upload_mb: of one request.
        max_photo_pixels, max_map_samples: of one file, looked at before it is decoded.
        databases: folder of glyph databases (.glyphs) that requests may choose from; in the folder unless given.
        database: name of the one that is used where a request names none.
        retention_days: for which photographs, scans and pictures are kept, whatever became of the part; 0 is for ever.
        stage: folder of height maps that the simulated whisker stage feels; without it there is no stage.
        stage_driver: "module:callable" that gives a driver of a real stage instead (`pipeline.service.stage.Stage`).
        camera: folder into which the camera puts its pictures, for triggers.
        line_host: address of the TCP port and the OPC UA server, which know no tokens.
        camera_driver: "module:callable" that gives a driver of a real camera instead (`pipeline.service.stage.Camera`).
        tcp_port: of the raw trigger port; closed unless given.
        tcp_format: of its result string.
        tcp_clients: addresses or networks that may use it, such as 192.168.7.0/24; any unless given.
        opcua_port: of the OPC UA server; closed unless given.
        opcua_certificate, opcua_key: of the server; with them only signed and encrypted connections are taken.
        opcua_users: passwords by name; without any everybody may call who can reach it.
        mqtt: broker that results are published to, mqtt://host:1883 or mqtts://user:password@host:8883.
        mqtt_prefix: first level of the topics.
        webhook: URL that results are posted to.
        webhook_secret: key of the signature of what is posted.
        shutdown_grace_s: in which running requests may end.
        log: "json" or "text" lines.
    """

    model_config = SettingsConfigDict(env_prefix=f"{ENV_PREFIX}SERVICE_", extra="forbid", frozen=True)

    host: str = "127.0.0.1"
    port: Port = 8417
    folder: Path = Path("tactile-marks-data")
    store: str = ""
    tokens: Literal["auto", "on", "off"] = "auto"
    hosts: Annotated[tuple[str, ...], NoDecode] = ()
    workers: int = Field(default_factory=lambda: os.cpu_count() or 1, ge=1, le=256)
    queue: int = Field(default=64, ge=0, le=100_000)
    job_timeout_s: float = Field(default=120.0, gt=0.0, le=3600.0)
    worker_memory_mb: int = Field(default=4096, ge=0, le=1_000_000)
    max_upload_mb: Megabytes = 100
    max_photo_pixels: int = Field(default=40_000_000, ge=64)
    max_map_samples: int = Field(default=30_000_000, ge=4)
    databases: Path | None = None
    database: str = ""
    retention_days: float = Field(default=90.0, ge=0.0, le=36_500.0)
    stage: Path | None = None
    stage_driver: str = ""
    camera: Path | None = None
    camera_driver: str = ""
    line_host: str = "127.0.0.1"
    tcp_port: Port | None = None
    tcp_format: str = ""
    tcp_clients: Annotated[tuple[str, ...], NoDecode] = ()
    opcua_port: Port | None = None
    opcua_certificate: Path | None = None
    opcua_key: Path | None = None
    opcua_users: dict[str, str] = Field(default_factory=dict, repr=False)
    mqtt: str = ""
    mqtt_prefix: str = "tactile-marks"
    webhook: str = ""
    webhook_secret: str = Field(default="", repr=False)
    shutdown_grace_s: float = Field(default=20.0, ge=0.0, le=600.0)
    log: Literal["json", "text"] = "json"

    @field_validator("hosts", "tcp_clients", mode="before")
    @classmethod
    def _one_or_many(cls, value: Any) -> Any:
        if isinstance(value, str):
            return tuple(name.strip() for name in value.split(",") if name.strip())
        return value

    @field_validator("tcp_clients")
    @classmethod
    def _networks(cls, value: tuple[str, ...]) -> tuple[str, ...]:
        for network in value:
            ipaddress.ip_network(network)
        return value

    @field_validator("webhook")
    @classmethod
    def _web_address(cls, value: str) -> str:
        if value and not value.startswith(("http://", "https://")):
            raise ValueError("it is no web address; begin it with https:// or http://")
        return value

    @field_validator("mqtt")
    @classmethod
    def _broker(cls, value: str) -> str:
        if value and not value.startswith(("mqtt://", "mqtts://")):
            raise ValueError("it is no broker's address; write mqtt://host:1883 or mqtts://host:8883")
        return value

    @model_validator(mode="after")
    def _ask_beyond_loopback(self) -> ServiceSettings:
        if self.tokens == "off" and not self.on_loopback:
            raise ValueError(
                f"the host {self.host} can be reached from elsewhere; without tokens listen on 127.0.0.1 only"
            )
        if not is_loopback(self.line_host):
            if self.tcp_port is not None and not self.tcp_clients:
                raise ValueError(
                    f"the TCP port at {self.line_host} can be reached from elsewhere and asks for no token; name the "
                    "addresses that may call: tcp_clients"
                )
            if self.opcua_port is not None and not (self.opcua_certificate and self.opcua_users):
                raise ValueError(
                    f"the OPC UA server at {self.line_host} can be reached from elsewhere; give it "
                    "opcua_certificate, opcua_key and opcua_users"
                )
        return self

    @property
    def on_loopback(self) -> bool:
        """Whether only this machine can call."""
        return is_loopback(self.host)

    @property
    def tokens_asked(self) -> bool:
        """Whether requests need a token."""
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
    def databases_folder(self) -> Path:
        """Where glyph databases are looked for."""
        return self.databases if self.databases is not None else self.folder / "databases"


def is_loopback(host: str) -> bool:
    """Whether an address can be reached from its own machine alone."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def load_service_settings(
    *, config: Path | None = None, folder: Path | None = None, **flags: Any
) -> ServiceSettings:
    """The settings in force.

    Args:
        config: TOML file; without it `tactile-marks.toml` in the working folder, if there is one.
        folder: the service's own folder.
        flags: by field name; None is not given.

    Raises:
        SettingsError: unknown keys, values that cannot be, a file that cannot be read.
    """
    return load(ServiceSettings, table="service", config=config, flags={"folder": folder, **flags})
