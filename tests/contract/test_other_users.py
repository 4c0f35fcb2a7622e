"""A service on this machine, without tokens: its own user's programs are let in, a proxy of another user is not."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from tests.contract.front_doors import main, run_service

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
