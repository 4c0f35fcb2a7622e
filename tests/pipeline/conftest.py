"""Programs that tests need, and stores in every database: the same tests run on SQLite and on a real PostgreSQL.

Nothing starts unless a test asks for it.
"""

from __future__ import annotations

import contextlib
import itertools
import shutil
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from tests.support.postgres_server import PostgresServer

if TYPE_CHECKING:
    from pipeline.store.store import Store
    from tests.support.store_samples import Clock


@pytest.fixture(scope="session")
def postgres() -> Iterator[PostgresServer]:
    """A PostgreSQL of this session; it ends with this process however that ends."""
    with contextlib.closing(PostgresServer()) as server:
        yield server


@pytest.fixture(scope="session")
def empty_stores(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, pytest.FixtureRequest], str]:
    """Makes the URL of a new, empty store in the database of that name; its tables are made but once."""
    from pipeline.store.store import Store

    numbers = itertools.count()
    folder = tmp_path_factory.mktemp("stores")
    templates: dict[str, str] = {}

    def new_store(backend: str, request: pytest.FixtureRequest) -> str:
        if backend == "sqlite":
            template, made = folder / "template.db", folder / f"store_{next(numbers)}.db"
            if backend not in templates:
                templates[backend] = str(template)
                Store.open(f"sqlite:///{template}").close()
            shutil.copyfile(template, made)
            return f"sqlite:///{made}"
        server: PostgresServer = request.getfixturevalue("postgres")
        if backend not in templates:
            templates[backend] = "template_store"
            Store.open(server.create("template_store")).close()
        lent = server.lend("template_store")
        request.addfinalizer(lambda: server.take_back(lent, "template_store"))
        return server.url(lent)

    return new_store


@pytest.fixture
def inline(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have commands that are called in this process read here too, where a test can put something in their way."""
    from pipeline.workers.executors import Executor
    from pipeline.workers.options import WorkerSettings

    monkeypatch.setattr(WorkerSettings, "opened", lambda *_, **__: contextlib.nullcontext(Executor()))


@pytest.fixture(params=["sqlite", "postgresql"])
def store_url(
    request: pytest.FixtureRequest, empty_stores: Callable[[str, pytest.FixtureRequest], str]
) -> str:
    """An empty store with its tables, in one database after the other."""
    return empty_stores(request.param, request)


@pytest.fixture
def clock() -> Clock:
    """The time of `store`."""
    from tests.support.store_samples import Clock

    return Clock()


@pytest.fixture
def store(store_url: str, clock: Clock) -> Iterator[Store]:
    """An empty store, in one database after the other."""
    from pipeline.store.store import Store

    with contextlib.closing(Store.open(store_url, now=clock)) as opened:
        yield opened


@pytest.fixture(params=["sqlite", "postgresql"])
def blank_url(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """A database without any table."""
    if request.param == "sqlite":
        return f"sqlite:///{tmp_path}/blank.db"
    server: PostgresServer = request.getfixturevalue("postgres")
    return server.create(f"blank_{time.monotonic_ns()}")
