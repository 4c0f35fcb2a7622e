"""`tactile-marks tokens`: who may use the service."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from pipeline.cli.exit_status import USAGE, CommandError, failures_reported
from pipeline.cli.settings import SERVICE, Config, ServiceOfFile, StoreAddress

if TYPE_CHECKING:
    from pipeline.common.records import TokenRecord
    from pipeline.store.store import Store

ScopeName = Literal["read", "write", "review"]
_MAX_DAYS = 36_500


def add(
    name: str,
    *,
    scope: Annotated[tuple[ScopeName, ...], Parameter(negative="")],
    days: int | None = None,
    store: StoreAddress = None,
    service: ServiceOfFile = SERVICE,
    config: Config = None,
) -> int:
    """Make a token and print its secret, once: the store keeps only its hash.

    Parameters
    ----------
    name
        Name of the user or machine, such as line-3; reviews made with the token are signed with it.
    scope
        What it allows: read, write (send parts) or review. May be repeated.
    days
        Days for which it is valid; for ever unless given.
    """
    if days is not None and not 1 <= days <= _MAX_DAYS:
        raise CommandError(f"tokens add: {days} days cannot be", hint=f"give 1 to {_MAX_DAYS}", status=USAGE)
    with opened_store(store or service.store_url, "tokens") as opened:
        from pipeline.common.records import Scope

        expires_at = None if days is None else datetime.now(UTC) + timedelta(days=days)
        secret = opened.add_token(name, [Scope(s) for s in scope], expires_at=expires_at)
    # the secret alone on the standard output, to be piped to where it is needed
    until = "" if expires_at is None else f" until {_day(expires_at)}"
    print(f"token {name} for {', '.join(sorted(set(scope)))}{until}; keep it now:", file=sys.stderr)
    print(secret)
    return 0


def list_tokens(
    *, store: StoreAddress = None, service: ServiceOfFile = SERVICE, config: Config = None
) -> int:
    """List the tokens, without their secrets."""
    with opened_store(store or service.store_url, "tokens") as opened:
        found = opened.tokens()
    now = datetime.now(UTC)
    for token in found:
        scopes = ", ".join(sorted(token.scopes))
        print(f"{token.name:<24} {scopes:<20} made {_day(token.created_at)}  {_standing(token, now)}")
    if not found:
        print("no tokens; make one with `tactile-marks tokens add NAME --scope read`", file=sys.stderr)
    return 0


def revoke(
    name: str, *, store: StoreAddress = None, service: ServiceOfFile = SERVICE, config: Config = None
) -> int:
    """Refuse a token from now on.

    Parameters
    ----------
    name
        Name of the user or machine.
    """
    with opened_store(store or service.store_url, "tokens") as opened:
        opened.revoke(name)
    print(f"token {name} is refused from now on")
    return 0


@contextlib.contextmanager
def opened_store(url: str, command: str, *, as_it_is: bool = False) -> Iterator[Store]:
    """A store that a command works on, what may be wrong with it as one line and a status.

    Args:
        url: of the store.
        command: that needs it.
        as_it_is: see `pipeline.store.database.open_database`.

    Raises:
        CommandError: it cannot be opened or used.
    """
    try:
        from pipeline.store.store import Store, StoreError, UnfitError
    except ImportError as error:
        raise CommandError(
            f"{command} needs {error.name}",
            hint="install it with: pip install 'tactile-marks[service]'",
            status=USAGE,
        ) from error
    with failures_reported():
        try:
            with contextlib.closing(Store.open(url, as_it_is=as_it_is)) as store:
                yield store
        except UnfitError:
            raise
        except StoreError as error:
            raise CommandError(str(error)) from error


def _standing(token: TokenRecord, now: datetime) -> str:
    if token.revoked_at is not None:
        return f"revoked {_day(token.revoked_at)}"
    if token.expires_at is None:
        return "good for ever"
    return f"{'expired' if token.expires_at <= now else 'good until'} {_day(token.expires_at)}"


def _day(at: datetime) -> str:
    return f"{at:%Y-%m-%d}"
