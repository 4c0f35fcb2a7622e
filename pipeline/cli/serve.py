"""`tactile-marks serve`: the vision-fallback service."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from pipeline.cli.exit_status import USAGE, CommandError, failures_told

Names = Annotated[list[str] | None, Parameter(negative="")]


def serve(
    *,
    host: str | None = None,
    port: int | None = None,
    folder: Path | None = None,
    store: str | None = None,
    tokens: Literal["auto", "on", "off"] | None = None,
    hosts: Names = None,
    workers: int | None = None,
    queue: int | None = None,
    job_timeout_s: float | None = None,
    max_upload_mb: int | None = None,
    databases: Path | None = None,
    database: str | None = None,
    retention_days: float | None = None,
    stage: Path | None = None,
    camera: Path | None = None,
    line_host: str | None = None,
    tcp_port: int | None = None,
    tcp_format: str | None = None,
    opcua_port: int | None = None,
    mqtt: str | None = None,
    mqtt_prefix: str | None = None,
    webhook: str | None = None,
    log: Literal["json", "text"] | None = None,
    font: Names = None,
    format: Names = None,
    height_mm: float | None = None,
    accept_confidence: float | None = None,
    accept_margin: float | None = None,
    config: Path | None = None,
) -> int:
    """Serve: photographs in, readings out; where the camera is unsure, the scan that would settle it.

    Listens on this machine only, at http://127.0.0.1:8417, and keeps what it needs in tactile-marks-data. The
    operator's page is at /. Every setting may stand in the table [service] of tactile-marks.toml, and those of
    reading at its top.

    Parameters
    ----------
    host
        Address to listen on; beyond this machine tokens are asked for (tactile-marks tokens add).
    port
        Of the web interface; 0 takes any that is free.
    folder
        For the store, the evidence and glyph databases.
    store
        URL of another store, such as postgresql://user@host/marks.
    tokens
        Whether a token is asked for; auto asks beyond this machine.
    hosts
        Names that the service is called by, beside its address; may be repeated.
    workers
        Processes that read; as many as there are cores unless given.
    queue
        Parts that may wait for a worker; more are refused at once, with 503.
    job_timeout_s
        Seconds after which a part that cannot be read is given up.
    max_upload_mb
        Of one request.
    databases
        Folder of glyph databases (.glyphs) that requests may choose from.
    database
        Name of the one that is used where a request names none.
    retention_days
        Days for which photographs, scans and pictures are kept; 0 is for ever.
    stage
        Folder of height maps that the simulated whisker stage feels: NAME.npz is the part called NAME.
    camera
        Folder into which the camera puts its pictures: NAME.png is the part called NAME.
    line_host
        Address of the TCP port and the OPC UA server, 127.0.0.1 unless given; they know no tokens.
    tcp_port
        Raw trigger port for line controllers.
    tcp_format
        Of its result string, such as {name};{decision};{text}.
    opcua_port
        OPC UA server in the manner of OPC 30010 AutoID (extra opcua).
    mqtt
        Broker that results are published to (extra mqtt), such as mqtt://broker:1883.
    mqtt_prefix
        First level of the topics.
    webhook
        Address that results are posted to; signed where webhook_secret is set in the file or the environment.
    log
        Lines of json, or of text for a person.
    font
        Built-in name or TTF/OTF file; may be repeated.
    format
        What serials look like, as for read; may be repeated.
    height_mm
        Character height in mm; found out if not given.
    accept_confidence
        Least confidence, 0 to 1, of a reading that is accepted.
    accept_margin
        Least lead of every character over its rival, 0 to 1, in a reading that is accepted.
    config
        TOML file with settings; tactile-marks.toml in the working folder is read by itself.
    """
    with failures_told():
        from pipeline.common.settings import load_settings
        from pipeline.service.settings import load_service_settings

        reading = load_settings(
            config=config,
            font=tuple(font) if font else None,
            format=tuple(format) if format else None,
            height_mm=height_mm,
            accept_confidence=accept_confidence,
            accept_margin=accept_margin,
        )
        settings = load_service_settings(
            config=config,
            folder=folder,
            host=host,
            port=port,
            store=store,
            tokens=tokens,
            hosts=tuple(hosts) if hosts else None,
            workers=workers,
            queue=queue,
            job_timeout_s=job_timeout_s,
            max_upload_mb=max_upload_mb,
            databases=databases,
            database=database,
            retention_days=retention_days,
            stage=stage,
            camera=camera,
            line_host=line_host,
            tcp_port=tcp_port,
            tcp_format=tcp_format,
            opcua_port=opcua_port,
            mqtt=mqtt,
            mqtt_prefix=mqtt_prefix,
            webhook=webhook,
            log=log,
        )
        if reading.mode is not None:
            raise CommandError(
                "serve: mode is set, and a service reads with the camera first and then by touch",
                hint="leave it out",
                status=USAGE,
            )
        from pipeline.cli.serving import run

        return run(settings, reading, say=lambda line: print(line, file=sys.stderr, flush=True))
