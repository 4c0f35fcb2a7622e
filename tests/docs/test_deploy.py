"""The files of docs/deploy: their linters find nothing, and what they name of the program is so."""

from __future__ import annotations

import os
import re
import subprocess
import tomllib
from importlib.metadata import version
from pathlib import Path
from typing import Any

import paho.mqtt.client as paho
import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from pipeline.cli.settings import MODELS
from pipeline.service.app import GRACE_S, PART_TIMEOUT_S
from pipeline.service.settings import ServiceSettings, host_and_port
from pipeline.workers.machine import LEAST_UPLOAD
from tests.support.line_broker import Broker, Listener
from tests.support.waiting import program

ROOT = Path(__file__).parents[2]
DEPLOY = ROOT / "docs" / "deploy"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
WORST_EXPOSURE = 2.0
"""Of systemd's own scale to 10; up to 2 is "OK" in its words."""


def text_of(name: str) -> str:
    return (DEPLOY / name).read_text(encoding="utf-8")


def checked(*command: str | Path) -> str:
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


@pytest.fixture(scope="module")
def compose() -> dict[str, Any]:
    yaml = pytest.importorskip("yaml")
    return dict(yaml.safe_load(text_of("compose.yaml")))


@pytest.fixture(scope="module")
def unit() -> dict[str, str]:
    """The unit's settings; of one that is there more than once, the last."""
    return dict(re.findall(r"^(\w+)=(.*)$", text_of("tactile-marks.service"), re.MULTILINE))


@pytest.mark.parametrize(
    "file",
    [*sorted(DEPLOY.iterdir()), ROOT / "docs" / "pages" / "how-to" / "deploy.md"],
    ids=lambda path: path.name,
)
def test_every_setting_that_is_named_exists(file: Path) -> None:
    known = {model.variable(name) for model in MODELS for name in model.leaves()}
    assert set(re.findall(r"TACTILE_MARKS_\w+", file.read_text(encoding="utf-8"))) <= known


def test_the_unit_holds_and_is_shut_in(tmp_path: Path, unit: dict[str, str]) -> None:
    there = text_of("tactile-marks.service").replace(unit["ExecStart"].split()[0], "/bin/true")
    file = tmp_path / "tactile-marks.service"
    file.write_text(there, encoding="utf-8")
    analyze = program("systemd-analyze")
    assert "tactile-marks.service" not in checked(analyze, "verify", file)
    told = checked(analyze, "security", "--offline=true", file)
    (exposure,) = re.findall(r"Overall exposure level for tactile-marks.service: ([\d.]+)", told)
    assert float(exposure) <= WORST_EXPOSURE


def test_who_stops_the_service_waits_longer_than_it_takes(
    unit: dict[str, str], compose: dict[str, Any]
) -> None:
    takes_s = ServiceSettings().drain_s + GRACE_S
    assert float(unit["TimeoutStopSec"]) > takes_s
    assert float(compose["services"]["marks"]["stop_grace_period"].removesuffix("s")) > takes_s


def test_the_containerfile_has_no_fault_and_takes_what_there_is() -> None:
    text = text_of("Containerfile")
    checked(program("hadolint"), DEPLOY / "Containerfile")
    sources = [
        word
        for line in re.findall(r"^COPY (?!--from)(.*)$", text, re.MULTILINE)
        for word in line.split()[:-1]
    ]
    assert all((ROOT / source).exists() for source in sources)
    packages = {name.rstrip("*") for name in PROJECT["tool"]["setuptools"]["packages"]["find"]["include"]}
    assert packages | {
        "pyproject.toml",
        "docs/deploy/requirements.lock",
        PROJECT["project"]["readme"],
    } <= set(sources)
    port = ServiceSettings().port
    assert f"EXPOSE {port}\n" in text
    assert f"http://127.0.0.1:{port}/healthz" in text


def test_the_compose_file_holds_together(compose: dict[str, Any]) -> None:
    checked(program("check-jsonschema"), "--builtin-schema", "vendor.compose-spec", DEPLOY / "compose.yaml")
    services = compose["services"]
    for one in services.values():
        for volume in one.get("volumes", ()):
            source = volume.partition(":")[0]
            # what an owner makes beforehand, as the page says
            made = source in ("./tls", "./mosquitto.passwords")
            assert made or source in compose["volumes"] or (DEPLOY / source).is_file()
        assert set(one["networks"]) <= set(compose["networks"])
        assert "ports" not in one or "outside" in one["networks"]  # the others are internal
    marks = services["marks"]
    prefix = ServiceSettings.variable("")
    given = {
        name.removeprefix(prefix).lower(): value
        for name, value in marks["environment"].items()
        if name.startswith(prefix)
    }
    given["mqtt"] = {"url": given.pop("mqtt_url")}
    settings = ServiceSettings(
        **{**given, "port": "0.0.0.0:8417", "trusted_proxies": (given["trusted_proxies"],)}
    )
    assert settings.tokens_asked
    assert settings.trusted_proxies == (services["proxy"]["networks"]["front"]["ipv4_address"],)
    assert re.search(r"://marks@(\w+)/(\w+)", settings.store).groups() == ("db", "marks")  # type: ignore[union-attr]
    assert services["db"]["environment"].items() >= {"POSTGRES_USER": "marks", "POSTGRES_DB": "marks"}.items()
    assert settings.mqtt.url.endswith("@broker:1883")
    assert f"proxy_pass http://marks:{host_and_port(settings.port)[1]};" in text_of("nginx.conf")
    assert (ROOT / "docs" / "deploy" / marks["build"]["context"]).resolve() == ROOT
    assert (ROOT / marks["build"]["dockerfile"]).is_file()


def test_the_proxy_lets_uploads_and_slow_parts_through() -> None:
    text = text_of("nginx.conf")
    (most_mb,) = re.findall(r"client_max_body_size (\d+)m;", text)
    (wait_s,) = re.findall(r"proxy_read_timeout (\d+)s;", text)
    assert int(most_mb) > LEAST_UPLOAD / 1e6
    assert float(wait_s) > PART_TIMEOUT_S


def test_the_broker_asks_for_a_password(tmp_path: Path) -> None:
    passwords = tmp_path / "passwords"
    checked(program("mosquitto_passwd"), "-b", "-c", passwords, "marks", "s3cret")
    inside, _, _outside = text_of("mosquitto.conf").partition("listener 8883")
    kept = re.sub(r"^(#|listener|persistence).*\n", "", inside, flags=re.MULTILINE)
    broker = Broker(tmp_path, kept.replace("/mosquitto/config/passwords", str(passwords)))
    broker.start()
    try:
        Listener(broker.port, user="marks", password="s3cret").close()
        refused = paho.Client(paho.CallbackAPIVersion.VERSION2)
        answers: list[bool] = []
        refused.on_connect = lambda *told: answers.append(told[3].is_failure)
        refused.connect("127.0.0.1", broker.port)
        while not answers:
            refused.loop(0.1)
        assert answers == [True]
    finally:
        broker.kill()


LOCKED = dict(
    re.findall(
        r"^(\S+)==(\S+) --hash=sha256:[0-9a-f]{64}$",
        (DEPLOY / "requirements.lock").read_text(encoding="utf-8"),
        re.MULTILINE,
    )
)


def test_what_a_service_takes_is_locked() -> None:
    text = (DEPLOY / "requirements.lock").read_text(encoding="utf-8")
    assert len(LOCKED) == sum(not line.startswith("#") for line in text.splitlines())
    assert "://" not in text
    (extras,) = re.findall(r"^DEPLOYED = \"(.*)\"$", (ROOT / ".ci" / "lock.py").read_text(), re.MULTILINE)
    told = PROJECT["project"]
    asked = [
        *told["dependencies"],
        *(one for name in extras.split(",") for one in told["optional-dependencies"][name]),
    ]
    names = {canonicalize_name(name): number for name, number in LOCKED.items()}
    for one in map(Requirement, asked):
        if one.name == told["name"]:
            continue
        found = names.get(canonicalize_name(one.name))
        assert found is not None, f"{one.name} is not locked; run .ci/lock.py"
        assert one.specifier.contains(found), f"{one} is locked at {found}; run .ci/lock.py"


def test_what_is_locked_is_what_is_tested() -> None:
    other = {name: (locked, version(name)) for name, locked in LOCKED.items() if version(name) != locked}
    if other and os.environ.get("MARKS_TEST_ALL") != "1":
        pytest.skip(f"this environment has other versions of {', '.join(other)}")
    assert not other
