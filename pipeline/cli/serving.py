"""The service in its web server, from its first line to its graceful end."""

from __future__ import annotations

import contextlib
import socket
import ssl
from collections.abc import Callable
from typing import TYPE_CHECKING

import uvicorn

from pipeline.cli.exit_status import USAGE, CommandError
from pipeline.service.app import Service, check_folder, create_app
from pipeline.service.logs import set_up_logs
from pipeline.service.web.web_server import KEEP_ALIVE_S, MOST_CONNECTIONS, DrainingServer, patient_protocol
from pipeline.store.store import Store, StoreError

if TYPE_CHECKING:
    from pipeline.common.settings import ReadSettings
    from pipeline.service.settings import ServiceSettings


def run(
    settings: ServiceSettings, reading: ReadSettings, *, started_s: float, say: Callable[[str], None]
) -> int:
    """Serve until a signal ends it; requests that are at work may end first.

    Args:
        settings: of the service.
        reading: how parts are read.
        started_s: when the program was started, by the monotonic clock.
        say: told where it listens, in a line for a person.

    Raises:
        CommandError: an address that is taken, a store that cannot be opened, tokens asked for and none there.
        FileError: a folder that cannot be made.
    """
    check_folder(settings)
    check_tls(settings)
    check_tokens(settings)
    bound = listening(settings.host, settings.port, option="--port")
    for port, option in ((settings.tcp_port, "--tcp-port"), (settings.opcua_port, "--opcua-port")):
        if port:
            listening(
                settings.line_host, port, option=option
            ).close()  # told here in a line, not out of a running server
    try:
        service = Service(settings, reading, started_s=started_s)
    except StoreError as error:
        bound.close()
        raise CommandError(str(error)) from error
    set_up_logs(settings.log)
    server = DrainingServer(
        uvicorn.Config(
            create_app(service),
            log_config=None,
            ssl_certfile=settings.tls_cert,
            ssl_keyfile=settings.tls_key,
            http=patient_protocol(an_address=settings.connections, proxies=settings.trusted_proxies),
            access_log=False,
            server_header=False,
            limit_concurrency=MOST_CONNECTIONS,
            timeout_keep_alive=KEEP_ALIVE_S,
            timeout_graceful_shutdown=max(1, round(settings.shutdown_grace_s)),
            proxy_headers=False,
        ),
        drain=service.drain,
        drain_s=settings.drain_s,
    )
    host, port = bound.getsockname()[:2]
    scheme = "http" if settings.tls_cert is None else "https"
    shown = f"[{host}]" if ":" in host else host
    say(
        f"tactile-marks serves at {scheme}://{shown}:{port} (page: /, interface: /openapi.json); Ctrl-C ends it"
    )
    if settings.shadow:
        say(
            "shadow mode: parts are read and compared with the line's own reader; nothing is decided or published"
        )
    server.run(sockets=[bound])
    return 0 if server.started else 1


def check_tokens(settings: ServiceSettings) -> None:
    """Look for a token where callers need one, before any worker is started.

    Raises:
        CommandError: there is none, or the store cannot be opened.
    """
    if not settings.tokens_asked:
        return
    try:
        with contextlib.closing(Store.open(settings.store_url)) as store:
            if store.tokens():
                return
    except StoreError as error:
        raise CommandError(str(error)) from error
    where = "" if settings.store else f" --store {settings.store_url}"
    raise CommandError(
        "serve: callers need a token, and there is none yet",
        hint=f"make one with: tactile-marks tokens add NAME --scope read --scope write --scope review{where}",
        status=USAGE,
    )


def check_tls(settings: ServiceSettings) -> None:
    """Load the certificate and its key before anything is begun.

    Raises:
        CommandError: they cannot be used.
    """
    given = (settings.tls_cert, settings.tls_key, settings.opcua_certificate, settings.opcua_key)
    for path in filter(None, given):
        if path.exists() and not path.is_file():  # a pipe would be waited for
            raise CommandError(f"serve: {path} is not a file", hint="name a PEM file", status=USAGE)
    if settings.tls_cert is None:
        if settings.tls_key is not None:
            raise CommandError("serve: tls_key without tls_cert", hint="give both", status=USAGE)
        return
    try:
        ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER).load_cert_chain(
            settings.tls_cert, settings.tls_key, password=_no_password
        )
    except (OSError, ValueError) as error:  # an SSLError is an OSError
        named = (
            settings.tls_cert if settings.tls_key is None else f"{settings.tls_cert} with {settings.tls_key}"
        )
        reason = getattr(error, "reason", None) or getattr(error, "strerror", None) or error
        raise CommandError(
            f"serve: the certificate {named} cannot be used ({reason})",
            hint="give a certificate and its own key, both PEM, the key without a password",
            status=USAGE,
        ) from error


def _no_password() -> str:
    raise ValueError("the key asks for a password")


def listening(host: str, port: int, *, option: str) -> socket.socket:
    """The socket, bound before anything else is begun, so that an address in use is told at once."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    # by its protocol asyncio knows that small answers are not to wait for the last one's acknowledgement
    bound = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        bound.bind((host, port))
        bound.listen(2048)
    except OSError as error:
        bound.close()
        raise CommandError(
            f"serve: cannot listen on {host}:{port} ({error.strerror})",
            hint=f"name another {option}",
            status=USAGE,
        ) from error
    bound.set_inheritable(False)
    return bound
