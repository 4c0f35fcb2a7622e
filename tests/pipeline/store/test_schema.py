"""The tables, stores of other versions, and what the database itself refuses."""

from __future__ import annotations

import contextlib
import re
import shutil
import sqlite3
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest
import sqlalchemy as sa
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from sqlalchemy.engine import Engine

from glyphs.file_lock import exclusively
from pipeline.common.part_id import new_part_id
from pipeline.common.people_records import Person
from pipeline.common.records import Agreement, PartState, ReviewAction, TouchWait
from pipeline.store import database
from pipeline.store.check import check
from pipeline.store.database import MIGRATIONS, VERSION_TABLE, _checked_url
from pipeline.store.errors import StoreError
from pipeline.store.evidence_folder import EvidenceFolder
from pipeline.store.store import Store
from pipeline.store.tables import METADATA
from tests.support.store_samples import START, due, received

DUMP = Path(__file__).parents[2] / "data" / "store-v1.sql"


def _engine(url: str) -> Engine:
    return sa.create_engine(url.replace("postgresql://", "postgresql+psycopg://"), poolclass=sa.NullPool)


def test_many_starts_at_once_make_one_store(blank_url: str) -> None:
    with ThreadPoolExecutor(3) as pool:
        stores = list(pool.map(lambda _: Store.open(blank_url), range(3)))
    part = received(stores[0])
    for store in stores:
        assert store.part(part.id) == part
        store.close()


def test_a_start_waits_for_that_of_another_process(blank_url: str) -> None:
    with ThreadPoolExecutor(1) as pool, contextlib.ExitStack() as held:
        if blank_url.startswith("sqlite"):
            held.enter_context(exclusively(Path(blank_url.removeprefix("sqlite:///") + ".lock")))
        else:
            other = held.enter_context(_engine(blank_url).begin())
            other.execute(sa.select(sa.func.pg_advisory_xact_lock(database._ADVISORY_LOCK)))
        opening = pool.submit(Store.open, blank_url)
        with pytest.raises(TimeoutError):
            opening.result(0.3)
        held.close()
        opening.result(60).close()


def test_a_store_of_a_version_that_is_not_known_is_left_alone(store_url: str) -> None:
    with _engine(store_url).begin() as connection:
        connection.execute(sa.text(f"UPDATE {VERSION_TABLE} SET version_num = '0009'"))
    with pytest.raises(
        StoreError, match=r"version \(0009\) that this tactile-marks does not know; install the one"
    ):
        Store.open(store_url)


def test_a_store_of_the_first_version_is_read_and_used_on(tmp_path: Path) -> None:
    file, evidence = tmp_path / "old.db", EvidenceFolder(tmp_path / "evidence")
    with contextlib.closing(sqlite3.connect(file)) as connection:
        connection.executescript(DUMP.read_text(encoding="utf-8"))
    with contextlib.closing(Store.open(f"sqlite:///{file}")) as store:
        waits, reviewed, accepted = store.parts()
        told = [(p.name, p.text, p.state.value) for p in (accepted, reviewed, waits)]
        assert told == [
            ("plate 1", "KX4", "accepted"),
            ("Größe", "KX9", "reviewed"),
            ("plate 3", "", "touch_needed"),
        ]
        assert waits.touch == TouchWait(by_stage=False, until=None)
        assert reviewed.review is not None
        assert (reviewed.review.who, reviewed.review.note) == ("Ada", "rust")
        assert [r.text for r in store.story(reviewed.id).readings] == ["KXO", "KX0"]
        assert [e.kind for e in store.story(reviewed.id).events][-1] == "reviewed"
        assert store.find_request("line-3:1") == ("f", accepted.id)
        assert [token.name for token in store.tokens()] == ["line-3"]
        store.review(
            reviewed.id, action=ReviewAction.CORRECT, text="KX1", person=Person("Bea"), targets=("mqtt",)
        )
        new = received(store, targets=("mqtt",))
        assert {d.part_id for d in due(store)} == {accepted.id, reviewed.id, new.id}
        faults = {finding.fault.value for finding in check(store, evidence, read_files=False).findings}
        assert faults == {"missing", "undelivered", "stuck"}
    with _engine(f"sqlite:///{file}").connect() as connection:
        options = {"version_table": VERSION_TABLE, "compare_type": True, "compare_server_default": True}
        context = MigrationContext.configure(connection, opts=options)
        assert compare_metadata(context, METADATA) == [], "a change of the tables needs a migration"


SECOND = """
import sqlalchemy as sa
from alembic import op
revision, down_revision, branch_labels, depends_on = "v2", "v1", None, None
def upgrade():
    op.add_column("tokens", sa.Column("note", sa.Text()))
"""


def test_an_older_store_is_brought_up_to_date_once_it_may_be(
    store: Store, store_url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    part = received(store)
    shutil.copytree(MIGRATIONS, tmp_path / "migrations")
    (tmp_path / "migrations" / "versions" / "v2.py").write_text(SECOND)
    monkeypatch.setattr("pipeline.store.database.MIGRATIONS", tmp_path / "migrations")
    with pytest.raises(StoreError, match=r"is of an older version \(v1\); start the service of this version"):
        Store.open(store_url, as_it_is=True)
    for _ in range(2):
        with contextlib.closing(Store.open(store_url)) as opened:
            assert opened.part(part.id) == part
    assert "note" in {column["name"] for column in sa.inspect(_engine(store_url)).get_columns("tokens")}


def test_lists_and_figures_read_no_more_than_they_need(tmp_path: Path) -> None:
    """SQLite's own word on how it would do every statement."""
    store = Store.open(f"sqlite:///{tmp_path}/store.db")
    part = received(store).id
    statements: list[tuple[str, Any]] = []
    with store.read_transaction() as tx:
        engine = tx.connection.engine

    @sa.event.listens_for(engine, "before_cursor_execute")
    def _note(_c: object, _u: object, statement: str, parameters: Any, _x: object, _m: object) -> None:
        if statement.startswith("SELECT"):
            statements.append((statement, parameters))

    store.statistics(START)
    store.agreement_by_day(START)
    store.parts(agreement=Agreement.OTHER, before=new_part_id())
    store.statistics(START, step=timedelta(days=1))
    store.queue()
    store.next_in_queue(new_part_id())
    store.next_in_queue(new_part_id(), person=Person("Ada", seat="here"))
    store.claims()
    store.half_reviewed()
    store.story(part)
    store.queue(audits=True)
    store.next_in_queue(new_part_id(), person=Person("Ada", token="Ada"), audits=True)
    store.audit_figures(START)
    store.parts(since=START, until=START, job="left", before=new_part_id())
    store.parts(state=PartState.REVIEW, before=new_part_id())
    store.parts()
    store.parts(state=PartState.REVIEWED)
    store.evidence_before(START)
    store.needed_hashes(("a" * 64,))
    store.token("x")
    store.find_request("x")
    due(store)
    assert len(statements) >= 22
    with engine.connect() as connection:
        for statement, parameters in statements:
            plan = [
                row[3] for row in connection.exec_driver_sql(f"EXPLAIN QUERY PLAN {statement}", parameters)
            ]
            scans = [step for step in plan if step.startswith("SCAN") and "INDEX" not in step]
            # a sorted table is read from its end; what was counted before is read through
            assert all(re.search(r"anon_\d|\(subquery", step) for step in scans), (statement, plan)
            sorts = [step for step in plan if "TEMP B-TREE FOR ORDER BY" in step]
            assert not sorts, (statement, plan)
    store.close()


def test_sqlite_is_durable_and_checks_its_keys(tmp_path: Path) -> None:
    wanted = {"journal_mode": "wal", "foreign_keys": 1, "busy_timeout": 30_000}
    wanted["synchronous"] = 2  # FULL
    store = Store.open(f"sqlite:///{tmp_path}/new/folder/store.db")
    with contextlib.closing(store), store.read_transaction() as tx:
        run = tx.connection.exec_driver_sql
        assert {name: run(f"PRAGMA {name}").scalar_one() for name in wanted} == wanted


def test_postgresql_may_not_put_off_writing(
    request: pytest.FixtureRequest, empty_stores: Callable[[str, pytest.FixtureRequest], str]
) -> None:
    lazy = empty_stores("postgresql", request) + "&options=-c%20synchronous_commit%3Doff"
    store = Store.open(lazy)
    with store.read_transaction() as tx:
        assert tx.connection.exec_driver_sql("SHOW synchronous_commit").scalar_one() == "on"
    store.close()


def test_a_lock_of_somebody_else_ends_the_wait_with_an_error(
    request: pytest.FixtureRequest,
    empty_stores: Callable[[str, pytest.FixtureRequest], str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    url = empty_stores("postgresql", request) + "&options=-c%20lock_timeout%3D200"
    Store.open(url).close()
    monkeypatch.setattr(database, "_WAIT_S", 0.1)
    with contextlib.closing(Store.open(url)) as store, contextlib.closing(Store.open(url)) as other:
        with other.write_transaction() as tx:
            tx.connection.exec_driver_sql("LOCK TABLE parts")
            with pytest.raises(StoreError, match=r"does not answer .*lock timeout"):
                store.parts()
        assert not store.parts()


@pytest.mark.parametrize(
    ("url", "message"),
    [
        ("", "not a URL"),
        ("store.db", "not a URL"),
        ("mysql://localhost/x", "cannot be mysql; write sqlite"),
        ("sqlite://", "in memory would lose"),
        ("sqlite:///:memory:", "in memory would lose"),
        ("sqlite:///file:x?mode=memory&uri=true", "in memory would lose"),
        ("sqlite:///{folder}/\udcfc.db", r"address has .* not UTF-8"),
        ("sqlite:///{folder}/text.db", "not a database.*restore the last good backup"),
        ("sqlite:///{folder}/text.db/store.db", "does not answer"),
        ("sqlite:///{folder}", "does not answer"),
        ("postgresql://user:hidden@127.0.0.1:1/x", "does not answer .*; check that the database runs"),
    ],
)
def test_stores_that_cannot_be(tmp_path: Path, url: str, message: str) -> None:
    (tmp_path / "text.db").write_text("this is a text, and no database at all\n" * 100, encoding="utf-8")
    with pytest.raises(StoreError, match=message) as caught:
        Store.open(url.format(folder=tmp_path))
    assert "hidden" not in str(caught.value)


def test_postgresql_however_it_is_written_needs_its_driver(monkeypatch: pytest.MonkeyPatch) -> None:
    for scheme in ("postgresql", "postgres", "postgresql+psycopg", "postgresql+psycopg2"):
        assert _checked_url(f"{scheme}://u:p@h/x").drivername == "postgresql+psycopg"
    monkeypatch.setitem(sys.modules, "psycopg", None)
    with pytest.raises(StoreError, match=r"pip install 'tactile-marks\[postgres\]', or use sqlite"):
        Store.open("postgresql://u@h/x")


def test_a_foreign_database_is_not_taken_over(blank_url: str) -> None:
    engine = _engine(blank_url)
    with engine.begin() as connection:
        connection.execute(sa.text("CREATE TABLE parts (x INTEGER)"))
    with pytest.raises(StoreError, match="already exists"):
        Store.open(blank_url)
    names: Any = sa.inspect(engine).get_table_names()
    assert names == ["parts"], "half a migration would be undone"
