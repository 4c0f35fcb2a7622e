"""A real service behind nginx with TLS, set up as docs/deploy has it, and behind a proxy of another user."""

from __future__ import annotations

import contextlib
import getpass
import json
import os
import re
import ssl
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from tests.contract.front_doors import RunningService, environment, main, run_service
from tests.support.line_broker import certificates
from tests.support.waiting import free_port, program, wait_until

CONFIG = Path(__file__).parents[2] / "docs" / "deploy" / "nginx.conf"
ELSEWHERE = "203.0.113.9"


@contextlib.contextmanager
def proxied(folder: Path, service: RunningService) -> Iterator[httpx.Client]:
    """A client of the proxy, which has the service behind / and, as the page about it says, behind /marks/."""
    certificate, key = certificates(folder, "proxy")
    certificate = certificate.rename(folder / "cert.pem")
    key.rename(folder / "key.pem")
    port = free_port()
    text = CONFIG.read_text(encoding="utf-8")
    for there, here in (
        ("/tmp/", f"{folder}/"),
        ("http://marks:8417", service.url),
        ("listen 8443", f"listen 127.0.0.1:{port}"),
        ("/etc/tls", str(folder)),
    ):
        assert there in text
        text = text.replace(there, here)
    text = text.replace("location / {", f"location /marks/ {{ proxy_pass {service.url}/; }}\n location / {{")
    config = folder / "nginx.conf"
    # its processes, too, may write into this folder
    config.write_text(f"user {getpass.getuser()};\n{text}", encoding="utf-8")
    command = (program("nginx"), "-p", str(folder), "-e", "stderr", "-c", str(config))
    with (folder / "nginx.log").open("wb") as log:
        nginx = subprocess.Popen([*command, "-g", "daemon off;"], stdout=log, stderr=log)
    try:
        trusted = ssl.create_default_context(cafile=str(certificate))
        with httpx.Client(base_url=f"https://127.0.0.1:{port}", verify=trusted, timeout=30.0) as client:
            wait_until(lambda: _answers(client), nginx)
            yield client
    finally:
        nginx.terminate()
        nginx.wait(10.0)


def _answers(client: httpx.Client) -> bool:
    try:
        return client.get("/healthz").status_code == 200
    except httpx.TransportError:
        return False


def test_a_service_behind_the_proxy(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    program("nginx")
    folder = tmp_path / "service"
    folder.mkdir()
    scopes = ("--scope", "read", "--scope", "write", "--scope", "review")
    assert main(["tokens", "add", "line-3", "--store", f"sqlite:///{folder / 'store.db'}", *scopes]) == 0
    secret = capsys.readouterr().out.split()[-1]
    settings = environment(
        TACTILE_MARKS_SERVICE_TOKENS="on",
        TACTILE_MARKS_SERVICE_TRUSTED_PROXIES="127.0.0.1",
        TACTILE_MARKS_WORKERS_JOBS="1",
        TACTILE_MARKS_FONT="gothic",
        TACTILE_MARKS_FORMAT="A9",
    )
    with run_service(folder, env=settings, ready=False) as service, proxied(tmp_path, service) as client:
        known = {"Authorization": f"Bearer {secret}"}
        assert client.get("/v1/parts").status_code == 401
        assert client.get("/v1/parts", headers={**known, "X-Forwarded-For": ELSEWHERE}).json() == []
        for path in (
            "/metrics",
            "/marks/metrics",
            "/marks//metrics",
            "/marks/%6detrics",
            "/marks/x/../metrics",
        ):
            assert client.get(path).status_code == 403
        assert client.get("/marks/v1/parts", headers=known).status_code == 200
        page = client.get("/marks/login")
        assert page.status_code == 200
        assert not re.search(r'(?:href|src|action)="/', page.text)  # or it would leave /marks
        # refused before the body is read: the answer must pass the proxy all the same
        refused = [client.post("/v1/parts", files={"photo": ("a.png", b"x" * 2_000_000)}) for _ in range(20)]
        assert {answer.status_code for answer in refused} == {401}

        origin = {"Origin": str(client.base_url).rstrip("/")}
        signed_in = client.post("/login", data={"secret": secret}, headers=origin)
        assert signed_in.status_code == 303
        assert re.search(r"; secure", signed_in.headers["set-cookie"], re.IGNORECASE)
        assert client.get("/review").status_code == 200

        # who calls through the proxy may not say where from
        lines = map(json.loads, filter(lambda line: line.startswith("{"), service.log.splitlines()))
        callers = {line["client"] for line in lines if "client" in line}
        assert callers == {"127.0.0.1"}


FORWARD = """
import encodings.idna, os, socket, sys, threading
os.setgid(65534)
os.setuid(65534)
def pump(source, sink):
    while data := source.recv(65536):
        sink.sendall(data)
    sink.shutdown(socket.SHUT_WR)
listener = socket.create_server(("127.0.0.1", 0))
print(listener.getsockname()[1], flush=True)
while True:
    near, _ = listener.accept()
    far = socket.create_connection(("127.0.0.1", int(sys.argv[1])))
    for ends in ((near, far), (far, near)):
        threading.Thread(target=pump, args=ends, daemon=True).start()
"""
"""As the user nobody: passes connections on and says nothing of it, as nginx does by a plain proxy_pass."""


@contextlib.contextmanager
def forwarded(url: str) -> Iterator[str]:
    """The address of a forwarder that another user runs."""
    port = url.rpartition(":")[2]
    process = subprocess.Popen([sys.executable, "-I", "-c", FORWARD, port], stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        yield f"http://127.0.0.1:{int(process.stdout.readline())}"
    finally:
        process.kill()
        process.wait()


@pytest.mark.skipif(
    sys.platform != "linux" or os.geteuid() != 0, reason="only root can start a program of another user"
)
def test_who_calls_as_another_user_needs_a_token(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    store = f"sqlite:///{tmp_path / 'service' / 'store.db'}"
    (tmp_path / "service").mkdir()
    assert main(["tokens", "add", "anna", "--scope", "read", "--store", store]) == 0
    secret = capsys.readouterr().out.strip()
    with (
        run_service(
            tmp_path / "service", "--jobs", "1", "--format", "A9", "--font", "gothic", ready=False
        ) as service,
        forwarded(service.url) as outside,
        httpx.Client(base_url=outside, headers={"Host": service.url.partition("//")[2]}) as browser,
    ):
        assert httpx.get(f"{service.url}/v1/parts").status_code == 200
        assert browser.get("/healthz").status_code == 200
        refused = browser.get("/v1/parts")
        assert refused.status_code == 401
        assert "of another user" in refused.json()["detail"]
        assert browser.post("/v1/parts", files={"scan": ("a.npz", b"x")}).status_code == 401
        assert browser.put("/v1/jobs/evil", json={"format": "AA"}).status_code == 401
        assert browser.get("/review").headers["location"] == "./login?to=%2Freview"
        assert browser.get("/v1/parts", headers={"Authorization": f"Bearer {secret}"}).status_code == 200
