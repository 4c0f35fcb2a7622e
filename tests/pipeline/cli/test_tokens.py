"""Tokens: their secrets, how long they are good, and the command."""

from __future__ import annotations

import re
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from pipeline.cli.exit_status import FAILED, USAGE
from pipeline.cli.main import main
from pipeline.common.names import HiddenCharacterError
from pipeline.common.records import Scope, TokenRecord
from pipeline.store.access import new_token
from pipeline.store.errors import ConflictError, NotFoundError, UnfitError
from pipeline.store.rows import hash_of
from pipeline.store.store import Store
from tests.support.store_samples import START, Clock


def test_secrets_have_256_bits_and_differ() -> None:
    secrets = {new_token() for _ in range(100)}
    assert len(secrets) == 100
    # 43 characters of 6 bits
    assert all(re.fullmatch(r"tm_[A-Za-z0-9_-]{43}", secret) for secret in secrets)


def test_a_token_is_known_by_its_secret(store: Store, store_url: str) -> None:
    secret = store.add_token("line-3", [Scope.READ, Scope.WRITE, Scope.READ])
    record = TokenRecord("line-3", frozenset({Scope.READ, Scope.WRITE}), START)
    assert store.token(secret) == record
    assert store.tokens() == (record,)
    for wrong in ("", secret[:-1], secret + "A", "tm_", hash_of(secret), "\x00", "\ud800", "line-3"):
        assert store.token(wrong) is None
    if store_url.startswith("sqlite"):
        path = Path(store_url.removeprefix("sqlite:///"))
        written = b"".join(p.read_bytes() for p in path.parent.glob(path.name + "*"))
        assert hash_of(secret).encode() in written
        assert secret.encode() not in written


def test_it_expires_at_its_time(store: Store, clock: Clock) -> None:
    until = START + timedelta(days=90)
    secret = store.add_token("line-3", [Scope.READ], expires_at=until)
    clock.at = until - timedelta(microseconds=1)
    token = store.token(secret)
    assert token is not None
    assert token.expires_at == until
    clock.at = until
    assert store.token(secret) is None
    assert [t.name for t in store.tokens()] == ["line-3"]


def test_it_is_taken_back_for_good(store: Store, clock: Clock) -> None:
    secret = store.add_token("line-3", [Scope.READ])
    other = store.add_token("line-4", [Scope.REVIEW])
    revoked_at = clock.go_on(hours=1)
    store.revoke("line-3")
    clock.go_on(hours=1)
    store.revoke("line-3")
    assert store.token(secret) is None
    assert store.token(other) is not None
    assert [(t.name, t.revoked_at) for t in store.tokens()] == [("line-3", revoked_at), ("line-4", None)]
    with pytest.raises(ConflictError, match="there is or was a token 'line-3'"):
        store.add_token("line-3", [Scope.READ])
    with pytest.raises(NotFoundError, match="tokens list"):
        store.revoke("line-5")


def test_tokens_that_make_no_sense(store: Store) -> None:
    past = START - timedelta(days=1)
    for name, scopes, expires_at, message in (
        ("line-3", [], None, "allows nothing"),
        ("", [Scope.READ], None, "needs a name"),
        (" ", [Scope.READ], None, "needs a name"),
        ("a\nb", [Scope.READ], None, "cannot be seen"),
        ("n" * 201, [Scope.READ], None, "at most 200"),
        ("line-3", [Scope.READ], past, "time to come"),
        ("line-3", [Scope.READ], datetime(2050, 1, 1), "time zone"),
    ):
        with pytest.raises((UnfitError, HiddenCharacterError), match=message):
            store.add_token(name, scopes, expires_at=expires_at)
    assert store.tokens() == ()


@pytest.fixture
def url(tmp_path: Path) -> str:
    return f"sqlite:///{tmp_path}/store.db"


def test_the_command_makes_lists_and_revokes(url: str, capsys: pytest.CaptureFixture[str]) -> None:
    def tokens(*arguments: str) -> None:
        assert main(["tokens", *arguments, "--store", url]) == 0

    tokens("list")
    assert "no tokens; make one" in capsys.readouterr().err
    tokens("add", "line-3", "--scope", "write", "--scope", "read", "--days", "90")
    shown = capsys.readouterr()
    secret = shown.out.strip()
    assert re.fullmatch(r"tm_\S{43}", secret)
    assert "token line-3 for read, write until 20" in shown.err
    store = Store.open(url)
    token = store.token(secret)
    assert token is not None
    assert token.scopes == {Scope.READ, Scope.WRITE}
    assert token.expires_at is not None
    assert timedelta(days=89) < token.expires_at - datetime.now(UTC) <= timedelta(days=90)
    store.close()
    tokens("add", "desk", "--scope", "review")
    capsys.readouterr()
    tokens("revoke", "desk")
    assert "desk is refused" in capsys.readouterr().out
    tokens("list")
    line_3, desk = capsys.readouterr().out.splitlines()
    assert re.fullmatch(r"line-3 +read, write +made \S+  valid until \S+", line_3)
    assert re.fullmatch(r"desk +review +made \S+  revoked \S+", desk)


@pytest.mark.parametrize(
    ("arguments", "status", "message"),
    [
        (("add", "x", "--scope", "read", "--days", "0"), USAGE, "Must be >= 1"),
        (("add", "x", "--scope", "read", "--days", "1000000000"), USAGE, "Must be <= 36500"),
        (("add", "", "--scope", "read"), USAGE, "needs a name"),
        (("add", "x", "--scope", "read", "--store", "nothing"), FAILED, "not a URL"),
        (("revoke", "x"), FAILED, "no token 'x'"),
    ],
)
def test_the_command_tells_what_is_wrong(
    url: str, arguments: tuple[str, ...], status: int, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    store = () if "--store" in arguments else ("--store", url)
    assert main(["tokens", *arguments, *store]) == status
    assert message in capsys.readouterr().err
