"""A store of the first version, brought up to date and used on."""

from __future__ import annotations

import contextlib
import sqlite3
from pathlib import Path

import pytest
import sqlalchemy as sa
from alembic import command
from alembic.config import Config

from pipeline.common.records import PartState, ReviewAction
from pipeline.store.check import check
from pipeline.store.database import MIGRATIONS, VERSION_TABLE
from pipeline.store.evidence_folder import EvidenceFolder
from pipeline.store.store import Store, StoreError
from tests.support.store_samples import due, received

DUMP = Path(__file__).parents[2] / "data" / "store-0001.sql"


@pytest.fixture
def old_url(blank_url: str, tmp_path: Path) -> str:
    """The first version's store, in one database after the other."""
    file = Path(blank_url.removeprefix("sqlite:///")) if "sqlite" in blank_url else tmp_path / "old.db"
    with contextlib.closing(sqlite3.connect(file)) as connection:
        connection.executescript(DUMP.read_text(encoding="utf-8"))
    if "sqlite" in blank_url:
        return blank_url
    engine = sa.create_engine(blank_url.replace("postgresql://", "postgresql+psycopg://"))
    source = sa.create_engine(f"sqlite:///{file}")
    config = Config()
    config.set_main_option("script_location", str(MIGRATIONS))
    with engine.begin() as target, source.connect() as old:
        target.execute(sa.text("SET TIME ZONE 'UTC'"))
        config.attributes["connection"] = target
        command.upgrade(config, "0001")
        there, here = sa.MetaData(), sa.MetaData()
        there.reflect(target)
        here.reflect(old)
        for table in there.sorted_tables:
            rows = [dict(row) for row in old.execute(sa.select(here.tables[table.name])).mappings()]
            if table.name == VERSION_TABLE or not rows:
                continue
            target.execute(sa.insert(table), rows)
            if table.name not in ("parts", "tokens", "idempotency"):
                last = max(row["id"] for row in rows)
                target.execute(sa.select(sa.func.setval(f"{table.name}_id_seq", last)))
    engine.dispose()
    return blank_url


def test_a_store_of_the_first_version_is_read_and_used_on(old_url: str, tmp_path: Path) -> None:
    with pytest.raises(
        StoreError, match=r"is of an older version \(0001\); start the service of this version"
    ):
        Store.open(old_url, as_it_is=True)
    evidence = EvidenceFolder(tmp_path / "evidence")
    with contextlib.closing(Store.open(old_url)) as store:
        waits, reviewed, accepted = store.parts()
        assert [p.name for p in (accepted, reviewed, waits)] == ["plate 1", "Größe", "plate 3"]
        assert [p.text for p in (accepted, reviewed, waits)] == ["KX4", "KX9", ""]
        assert waits.state is PartState.TOUCH_NEEDED
        assert waits.touch is not None
        assert (waits.line, waits.job, waits.touch.by_stage) == ("", "", False)
        assert reviewed.review is not None
        assert (reviewed.review.who, reviewed.review.note) == ("Ada", "rust")
        assert [r.text for r in store.readings(reviewed.id)] == ["KXO", "KX0"]
        assert [e.kind for e in store.history(reviewed.id)][-1] == "reviewed"
        assert store.remembered("line-3:1") == ("f", accepted.id)
        assert [token.name for token in store.tokens()] == ["line-3"]
        # all there was is sealed, and what is written now as well
        store.review(reviewed.id, action=ReviewAction.CORRECT, text="KX1", who="Bea", targets=("mqtt",))
        new = received(store, targets=("mqtt",))
        assert {d.part_id for d in due(store)} == {accepted.id, reviewed.id, new.id}
        report = check(store, evidence, read_files=False)
        faults = {found.fault.value for found in report.findings}
        assert (report.parts, faults - {"missing", "undelivered", "stuck"}) == (4, set())
