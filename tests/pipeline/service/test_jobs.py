"""Jobs of a service: who may name them and how, what is told of them, and what of a part they decide."""

from __future__ import annotations

import html
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from starlette.testclient import TestClient

from pipeline.common.part_id import new_part_id
from pipeline.common.reading_records import ReadingRecord
from pipeline.common.records import EvidenceKind, EvidenceRecord, PartState, Scope
from pipeline.common.settings import Limits, NamedLine, ReadSettings, SettingsError
from pipeline.formats.part_files import PartFiles
from pipeline.formats.synth import SynthSpec, write_part
from pipeline.reading.drift import EVERY
from pipeline.reading.part_job import PartJob, read_sent
from pipeline.reading.triage import ReadPart
from pipeline.service.jobs import JobFolder, name_like, teach
from pipeline.service.web.problem import Problem
from recognition.reader import Reader
from tests.support import certificates
from tests.support.service_fixtures import FORMAT, Served, inline_service, triggered

PNG = {"photo": ("a.png", b"\x89PNG\r\n\x1a\n" + bytes(100))}
BOX = (0.1, 0.2, 0.9, 0.6)
PROBLEM = "application/problem+json"


def put(folder: Path, name: str, text: str, *, encoding: str = "utf-8") -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}.toml"
    before = path.stat().st_mtime_ns if path.exists() else 0
    path.write_text(text, encoding=encoding)
    # as if a second had passed
    os.utime(path, ns=(before + 10**9, before + 10**9))
    return path


def by_format(job: PartJob, *_: object) -> ReadPart:
    """A reading that says by which format it was made; only the camera is never sure."""
    return ReadPart((ReadingRecord("vision", job.settings.format[0], "accept", 0.999),))


@pytest.fixture
def served(tmp_path: Path) -> Iterator[Served]:
    put(tmp_path / "jobs", "left", 'format = "A9"\n')
    (tmp_path / "camera").mkdir()
    with inline_service(
        tmp_path,
        instead=by_format,
        camera={"device": tmp_path / "camera", "early_s": 3600.0},
        device_timeout_s=1.0,
    ) as both:
        yield both


def post(client: TestClient, **data: str) -> Any:
    return client.post("/v1/parts", files=PNG, data=data)


def test_a_part_is_read_by_the_job_that_it_names(served: Served, tmp_path: Path) -> None:
    service, client = served
    assert post(client).json()["text"] == FORMAT
    part = post(client, job="left").json()
    assert (part["text"], part["job"]) == ("A9", "left")
    assert service.store.part(part["id"]).job == "left"
    received = client.get(part["links"]["history"]).json()["events"][0]
    assert received["data"]["job"] == "left"
    # a scan that comes later is read by the same
    client.post(f"/v1/parts/{part['id']}/scan", files={"scan": ("a.h5", b"\x89HDF\r\n\x1a\n")})
    assert service.pool.jobs[-1][1].settings.format == ("A9",)  # type: ignore[attr-defined]
    (tmp_path / "camera" / "P-1.png").write_bytes(PNG["photo"][1])
    felt = triggered(served, "P-1", "left")
    assert (felt.text, felt.job, felt.state) == ("A9", "left", PartState.ACCEPTED)


def test_a_job_is_made_changed_spoilt_and_taken_away_while_the_service_runs(
    served: Served, tmp_path: Path
) -> None:
    _, client = served
    refused = post(client, job="right")
    assert (refused.status_code, refused.headers["content-type"]) == (422, PROBLEM)
    assert refused.json()["detail"] == "there is no job 'right'; choose one of left"
    put(tmp_path / "jobs", "right", 'format = "99"\n')
    assert post(client, job="right").json()["text"] == "99"
    put(tmp_path / "jobs", "right", 'format = "9A"\n')
    assert post(client, job="right").json()["text"] == "9A"
    spoilt = put(tmp_path / "jobs", "right", 'formt = "9A"\n')
    assert post(client, job="right").json()["text"] == "9A"  # the line goes on
    listed = {job["name"]: job for job in client.get("/v1/jobs").json()}
    assert listed["left"] == {"name": "left", "settings": {"format": "A9"}, "problem": ""}
    assert listed["right"]["problem"].startswith("right.toml: unknown setting formt; did you mean format")
    spoilt.unlink()
    away = post(client, job="right")
    assert (away.status_code, away.headers["Retry-After"]) == (503, "5")
    assert away.json()["detail"] == "the job right has disappeared; put right.toml back"
    assert "right" in client.get("/readyz").json()["unusable"]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("pipeline.service.jobs.MOST_AWAY_S", 0.0)
        assert post(client, job="right").status_code == 422
    put(tmp_path / "jobs", "new", "font = 'nowhere.ttf'\n")
    refused = post(client, job="new")
    assert refused.status_code == 503
    detail = refused.json()["detail"]
    assert detail.startswith("the job new cannot be used: new.toml: font file 'nowhere.ttf' is missing")
    assert post(client, job="newer").json()["detail"] == "there is no job 'newer'; choose one of left"
    for odd in ("../left", ".left", "a b"):
        assert post(client, job=odd).status_code == 422


def test_a_service_does_not_start_without_the_job_of_its_watched_folder(tmp_path: Path) -> None:
    watch = tmp_path / "camera"
    with (
        pytest.raises(SettingsError, match=r"watch\.job: there is no job 'left'; there are none yet"),
        inline_service(tmp_path, watch={"folder": watch, "job": "left"}),
    ):
        pass
    put(tmp_path / "jobs", "left", 'format = "re:["\n')
    with (
        pytest.raises(SettingsError, match=r"watch\.job: the job left cannot be used: left\.toml: format is"),
        inline_service(tmp_path, watch={"folder": watch, "job": "left"}),
    ):
        pass


def test_job_and_database_are_not_both_named(served: Served) -> None:
    answer = post(served[1], job="left", database="die")
    assert (answer.status_code, answer.json()["detail"][:25]) == (422, "both job and database are")


def test_a_job_is_written_by_whoever_may_review(tmp_path: Path) -> None:
    with inline_service(tmp_path, tokens="on") as (service, client):
        looks, reviews = (
            {"Authorization": f"Bearer {service.store.add_token(scope, [scope])}"}
            for scope in (Scope.READ, Scope.REVIEW)
        )
        body = {"format": "AA99", "region": [0, 0.1, 1, 0.5], "line": {"lot": "AAA9"}, "height_mm": 4}
        assert client.put("/v1/jobs/left", json=body).status_code == 401
        assert client.put("/v1/jobs/left", json=body, headers=looks).status_code == 403
        assert client.get("/v1/jobs", headers=looks).json() == []
        made = client.put("/v1/jobs/left", json=body, headers=reviews)
        assert made.status_code == 201, made.text
        assert client.put("/v1/jobs/left", json=body, headers=reviews).status_code == 200
        (listed,) = client.get("/v1/jobs", headers=looks).json()
        assert listed["settings"]["line"] == {"lot": {"format": "AAA9"}}
        assert service.jobs.settings("left") == ReadSettings.of(**body)
        for bad, says in (
            ({"mode": "vision"}, "sets mode"),
            ({"formt": "A"}, "unknown setting formt; did you mean format"),
            ({"region": [0, 1]}, "give left, top"),
            ({"font": ["gothik"]}, "unknown font 'gothik'"),
            ({"database": "/etc/passwd"}, "there is no glyph database '/etc/passwd'; there are none yet"),
            ({"lexicon": "/etc/passwd"}, "lexicon is a file of the service's machine"),
            ({"font": ["/etc/x.ttf"]}, "/etc/x.ttf is a file of the service's machine"),
        ):
            refused = client.put("/v1/jobs/left", json=bad, headers=reviews)
            assert (refused.status_code, refused.headers["content-type"]) == (422, PROBLEM), bad
            assert says in refused.json()["detail"]
        assert client.put("/v1/jobs/.left", json=body, headers=reviews).status_code == 422
        assert service.jobs.settings("left").format == ("AA99",)


def test_a_job_has_a_certificate_of_its_own(tmp_path: Path) -> None:
    settings = ReadSettings(format=("A9",))
    (tmp_path / "jobs").mkdir()
    certificates.written(tmp_path / "jobs" / "left.json", settings)
    put(tmp_path / "jobs", "left", 'format = "A9"\ncertificate = "left.json"\n')
    jobs = JobFolder(tmp_path / "jobs", default=ReadSettings())
    watch = jobs.watch("left")
    assert watch is not None
    assert (jobs.watch(""), jobs.drift) == (None, "")
    for part in certificates.measured(EVERY, rough_um=5.0):
        watch.add("tactile", part)
    assert jobs.drift.startswith("job left: these parts are unlike the certified ones")
    put(tmp_path / "jobs", "left", 'format = "A99"\ncertificate = "left.json"\n')
    (listed,) = jobs.listed()
    assert "made with other settings" in listed.problem


def test_a_check_that_fails_or_cannot_be_made_touches_its_own_job_alone(tmp_path: Path) -> None:
    folder, fault = tmp_path / "jobs", list[Exception]()

    def call(function: Any, *arguments: Any) -> Any:
        if fault and arguments and arguments[0].stem == "left":
            raise fault[0]
        return function(*arguments)

    for name in ("left", "right"):
        put(folder, name, 'format = "A9"\nfont = "gothic"\n')
    jobs = JobFolder(folder, default=ReadSettings(), needed="right", call=call)
    for error, told in ((Problem(503, "no worker"), ""), (KeyError("odd"), "report this")):
        fault[:] = [error]
        put(folder, "left", 'format = "A99"\nfont = "gothic"\n')
        left, right = jobs.listed()
        assert told in left.problem
        assert (bool(left.problem), right.problem) == (bool(told), "")
        assert jobs.settings("left").format == jobs.settings("right").format == ("A9",)
    with pytest.raises(Problem, match="watched folder uses the job right"):
        jobs.delete("right")


# ---- taught


def test_a_line_is_taught_after_the_other(tmp_path: Path) -> None:
    own = ReadSettings(format=("99+exclude=8",), font=("gothic",), accept_risk=0.02, region=BOX)
    jobs = JobFolder(tmp_path / "jobs", default=own)
    teach(jobs, "left", NamedLine("", "AA99", BOX), "KX40", height_mm=4.0)
    teach(jobs, "left", NamedLine("lot", "A-9", (0.0, 0.5, 1.0, 1.0)), "B-7")
    wanted = ReadSettings(
        font=("gothic",),
        accept_risk=0.02,
        format=("AA99",),
        region=BOX,
        height_mm=4.0,
        line=("lot@0,0.5,1,1=A-9",),
    )
    assert jobs.settings("left") == wanted
    for line, text in ((NamedLine("", "AA99", BOX), "KX40"), (NamedLine("lot", "A-9", BOX), "B-7")):
        with pytest.raises(Problem, match="already") as refused:
            teach(jobs, "left", line, text)
        assert refused.value.status == 409
    teach(jobs, "left", NamedLine("lot", "A9", BOX), "B7", replace=True)
    teach(jobs, "left", NamedLine("", "AA99", BOX), "KX40", replace=True)
    found = jobs.settings("left")
    assert (found.line, found.height_mm) == (("lot@0.1,0.2,0.9,0.6=A9",), None)


def test_the_page_teaches_those_who_may_review(tmp_path: Path) -> None:
    picture = {"mm_per_pixel": 0.05, "x0_mm": 0.0, "y0_mm": 0.0, "width": 400.0, "height": 100.0}
    with inline_service(tmp_path, tokens="on") as (service, client):
        kept = tmp_path / "picture.png"
        kept.write_bytes(PNG["photo"][1])
        sha256, n_bytes = service.evidence.keep(kept)
        shown = EvidenceRecord(EvidenceKind.PHOTO_PICTURE, sha256, n_bytes, "a.png", "image/png", picture)
        part, bare = new_part_id(), new_part_id()
        for one, evidence in ((part, [shown]), (bare, [])):
            service.store.add_part(part_id=one, name="P-1", state=PartState.REVIEW, evidence=evidence)
        looks, reviews = (
            {"Authorization": f"Bearer {service.store.add_token(name, scopes)}"}
            for name, scopes in (("looks", [Scope.READ]), ("reviews", [Scope.READ, Scope.REVIEW]))
        )
        page = f"/jobs/new?part={part}"
        assert client.get("/jobs", headers=looks).status_code == 200
        assert "Teach a job" not in client.get(f"/parts/{part}", headers=looks).text
        assert client.get(page, headers=looks).status_code == 403
        assert client.get(f"/jobs/new?part={bare}", headers=reviews).status_code == 404
        assert page in client.get(f"/parts/{part}", headers=reviews).text
        assert client.get(page, headers=reviews).status_code == 200
        assert client.get("/jobs/format?text=KX-40", headers=looks).text == "AA-99"
        said = {
            "part": part,
            "name": "left",
            "text": "KX40",
            "left": "0",
            "top": "10",
            "right": "100",
            "bottom": "50",
        }
        assert client.post("/jobs/new", data=said, headers=looks).status_code == 403
        refused = client.post("/jobs/new", data={**said, "top": "60"}, headers=reviews)
        assert (refused.status_code, "Draw a box first" in html.unescape(refused.text)) == (422, True)
        assert client.get("/v1/jobs", headers=looks).json() == []
        saved = client.post("/jobs/new", data=said, headers=reviews)
        assert (saved.status_code, "left" in saved.text) == (200, True)
        assert service.jobs.settings("left").region == (0.0, 0.1, 1.0, 0.5)
        again = client.post("/jobs/new", data=said, headers=reviews)
        assert (again.status_code, 'name="replace"' in again.text) == (409, True)
        assert client.post("/jobs/new", data={**said, "replace": "1"}, headers=reviews).status_code == 200


@pytest.mark.parametrize(
    ("name", "line", "text", "says"),
    [
        ("left", NamedLine("", "AA9", BOX), "KX40", "'KX40' is not of the format AA9: it does not fit"),
        ("left", NamedLine("", "re:[", BOX), "KX40", "is not a regular expression"),
        ("left", NamedLine("a b", "AA99", BOX), "KX40", "'a b' is not a name for a line"),
        ("the left", NamedLine("", "AA99", BOX), "KX40", "'the left' is not a name for a job"),
    ],
)
def test_what_cannot_be_taught(name: str, line: NamedLine, text: str, says: str, tmp_path: Path) -> None:
    jobs = JobFolder(tmp_path / "jobs", default=ReadSettings())
    with pytest.raises(Problem, match=says):
        teach(jobs, name, line, text)
    assert jobs.listed() == []


def test_a_name_for_the_job_of_a_part() -> None:
    names = ("tray-7/housing-left-0012", "part-3", "housing left_4", "0012", "")
    assert [name_like(name) for name in names] == ["housing-left", "part", "housing-left", "", ""]


# ---- regions


def test_of_two_lines_the_region_says_which(tmp_path: Path) -> None:
    write_part(SynthSpec(format="AA999999", seed=4, layout="two-lines"), tmp_path / "part", 0, photos=True)
    files = PartFiles("part", photos=(str(tmp_path / "part.png"),))
    reading = read_sent(PartJob(files, ReadSettings(region=(0.0, 0.5, 1.0, 1.0)), limits=Limits())).readings[
        -1
    ]
    assert reading.text == "CRPUIB"  # SY859990 is above it


def test_a_scan_of_what_the_camera_saw_has_no_regions(parts: Path, tmp_path: Path) -> None:
    # the line is in the middle of all that was scanned, wherever the photograph has it: looked for at the rim of the
    # scan, a line of eight was a review at 0.33
    settings = ReadSettings(region=(0.0, 0.0, 1.0, 0.3), format=("AA99",))
    files = PartFiles("part", height_map=str(parts / "clean.npz"), photos=(str(parts / "clean.png"),))
    reading = read_sent(PartJob(files, settings, limits=Limits(), earlier=True, folder=tmp_path)).readings[-1]
    assert (reading.text, reading.decision) == ((parts / "clean.txt").read_text(), "accept")
    seen = Reader(region=BOX, lines={"lot": "A9"}, format="AA99").after_photo()
    assert (seen.vision.settings.region, seen.touch.settings.region) == (BOX, None)
