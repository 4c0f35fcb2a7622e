"""`tactile-marks serve` and `worker`: run the service, lend cores to a cluster."""

from __future__ import annotations

import contextlib
import os
import socket
import sys
import time
from typing import TYPE_CHECKING

from pipeline.cli.exit_status import UsageError
from pipeline.cli.settings import (
    PARTS,
    POOL,
    READING,
    SERVICE,
    WORKERS,
    Config,
    Parts,
    Pool,
    ReadingOfFile,
    Service,
    WorkersOfFile,
    with_flags,
)
from pipeline.cli.shared import Positive

if TYPE_CHECKING:
    import ssl

    from pipeline.common.settings import ReadSettings
    from pipeline.service.settings import ServiceSettings
    from pipeline.workers.options import PoolSettings

STARTED_S = time.monotonic()  # of the command: this module is loaded before the slow ones


def serve(
    *,
    service: Service = SERVICE,
    parts: Parts = PARTS,
    pool: Pool = POOL,
    reading: ReadingOfFile = READING,
    workers: WorkersOfFile = WORKERS,
    config: Config = None,
) -> int:
    """Run the service: it reads photographs, and asks for a scan if the camera is unsure.

    Listens on this machine only, at http://127.0.0.1:8417, and keeps its data in tactile-marks-data. The operator's
    page is at /.
    """
    reading = with_flags(reading, parts)
    if reading.mode != "auto":
        raise UsageError(
            "serve: mode is set, but a service reads with the camera first and then by touch",
            "leave mode out",
        )
    if workers.cluster is not None:
        raise UsageError("serve: cluster is set, but a service reads on its own machine", "leave cluster out")
    return _serve(service, reading, with_flags(workers, pool))


def worker(address: str, /, *, jobs: Positive = None, memory_gb: float | None = None) -> None:
    """Work for a Dask scheduler until it ends, with one process per core; a lost process is replaced.

    Start the scheduler with: dask scheduler. This is `dask worker` with one thread per process, and it keeps the memory
    of maps between parts: without that a part takes up to three times as long.

    Args:
        address: Address of the scheduler, such as tcp://HOST:8786.
        jobs: Worker processes (default: one for each core).
        memory_gb: Memory limit of each process, in GB; one that uses more is replaced (default: its share of the
            machine's).
    """
    from pipeline.workers.cluster import require_distributed
    from pipeline.workers.executors import cores
    from pipeline.workers.process import MALLOC

    if memory_gb is not None and not memory_gb > 0.0:
        raise UsageError(f"worker: memory_gb is {memory_gb}", "it must be above 0")
    require_distributed()
    # variables in the environment override those that Dask's nanny would set for its processes
    environment = {**MALLOC, "NUMBA_NUM_THREADS": "1", **os.environ}
    memory = "auto" if memory_gb is None else f"{memory_gb}GB"
    arguments = [
        *(sys.executable, "-m", "distributed.cli.dask_worker", address, "--no-dashboard"),
        *("--nworkers", str(jobs or cores()), "--nthreads", "1", "--memory-limit", memory),
    ]
    sys.stdout.flush()
    os.execve(sys.executable, arguments, environment)


def _say(line: str) -> None:
    print(line, file=sys.stderr, flush=True)


def _serve(settings: ServiceSettings, reading: ReadSettings, workers: PoolSettings) -> int:
    import uvicorn

    from pipeline.service.app import GRACE_S, check_folder
    from pipeline.service.app import Service as RunningService
    from pipeline.service.connections import BACKLOG, connections_of_address, most_connections
    from pipeline.service.logs import set_up_logs
    from pipeline.service.settings import host_and_port
    from pipeline.service.web.web_server import (
        KEEP_ALIVE_S,
        DrainingServer,
        Room,
        patient_protocol,
    )
    from pipeline.service.web_app import create_app

    reading.check_accept_risk()
    check_folder(settings)
    tls = tls_context(settings)
    check_tokens(settings)
    most = most_connections()
    room = Room(an_address=connections_of_address(most), most=most, proxies=settings.trusted_proxies)
    with contextlib.ExitStack() as until_served:
        bound = until_served.enter_context(listening(*host_and_port(settings.port), option="--port"))
        for line_port, option in ((settings.tcp, "--tcp.port"), (settings.opcua, "--opcua.port")):
            host, port = host_and_port(line_port.port or "0")
            if port:  # tried here, so that the error is one line and not a running server's
                listening(host, port, option=option).close()
        service = RunningService(settings, reading, workers, started_s=STARTED_S)
        until_served.pop_all()
    set_up_logs("text" if sys.stderr.isatty() else "json")
    server = DrainingServer(
        uvicorn.Config(
            create_app(service),
            log_config=None,
            http=patient_protocol(room, tls=tls),
            backlog=BACKLOG,
            access_log=False,
            server_header=False,
            timeout_keep_alive=KEEP_ALIVE_S,
            timeout_graceful_shutdown=round(GRACE_S),
            proxy_headers=False,
        ),
        drain=service.drain,
        drain_s=settings.drain_s,
    )
    host, port = bound.getsockname()[:2]
    scheme = "http" if tls is None else "https"
    address = f"{scheme}://{f'[{host}]' if ':' in host else host}:{port}"
    _say(f"tactile-marks serves at {address} (page: /, interface: /openapi.json); Ctrl-C ends it")
    if settings.shadow:
        _say(
            "shadow mode: parts are read and compared with the line's own reader; nothing is decided or published"
        )
    server.run(sockets=[bound])
    return 0 if server.started else 1


def check_tokens(settings: ServiceSettings) -> None:
    """Check that a token exists if callers need one, before workers start. Raises UsageError: there is none.
    StoreError: the store cannot be opened."""
    from pipeline.store.store import Store

    if not settings.tokens_asked:
        return
    with contextlib.closing(Store.open(settings.store_url)) as store:
        if store.tokens():
            return
    where = "" if settings.store else f" --store {settings.store_url}"
    raise UsageError(
        "serve: callers need a token, and there is none yet",
        f"make one with: tactile-marks tokens add NAME --scope read --scope write --scope review{where}",
    )


def tls_context(settings: ServiceSettings) -> ssl.SSLContext | None:
    """Load the certificate and its key before the start; None without them. Raises UsageError: they are invalid."""
    import ssl

    cert, key = settings.tls.certificate, settings.tls.key
    for path in filter(None, (cert, key, settings.opcua.certificate, settings.opcua.key)):
        if path.exists() and not path.is_file():  # opening a pipe would block
            raise UsageError(f"serve: {path} is not a file", "name a PEM file")
    if cert is None:
        if key is not None:
            raise UsageError("serve: tls.key is set without tls.certificate", "give both")
        return None
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    try:
        context.load_cert_chain(cert, key, password=_no_password)
    except (OSError, ValueError) as error:  # an SSLError is an OSError
        named = cert if key is None else f"{cert} with {key}"
        reason = getattr(error, "reason", None) or getattr(error, "strerror", None) or error
        raise UsageError(
            f"serve: the certificate {named} cannot be used ({reason})",
            "give a certificate and its own key, both PEM, the key without a password",
        ) from error
    return context


def _no_password() -> str:
    raise ValueError("the key asks for a password")


def listening(host: str, port: int, *, option: str) -> socket.socket:
    """Bind the socket before anything else is started, so that an address in use is reported at once."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    # asyncio sends small answers at once (TCP_NODELAY) only if the socket's protocol is given
    bound = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        bound.bind((host, port))
        bound.listen()
    except OSError as error:
        bound.close()
        what = f"serve: cannot listen on {host}:{port} ({error.strerror})"
        raise UsageError(what, f"name another {option}") from error
    bound.set_inheritable(False)
    return bound
