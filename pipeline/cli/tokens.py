"""`tactile-marks tokens`: who may use the service."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from pipeline.cli.exit_status import USAGE, CommandError, failures_told

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
    store: str | None = None,
) -> int:
    """Make a token and print its secret. It is shown this once; the store keeps its hash alone.

    Parameters
    ----------
    name
        Whose it is, such as line-3; every review done with it bears that name.
    scope
        What it allows: read, write (send parts) or review. May be given several times.
    days
        After how many days it is refused; never unless given.
    store
        Address of the store; that of the service's settings unless given.
    """
    if days is not None and not 1 <= days <= _MAX_DAYS:
        raise CommandError(f"tokens add: {days} days cannot be", hint=f"give 1 to {_MAX_DAYS}", status=USAGE)
    with _opened(store) as opened:
        from pipeline.common.records import Scope

        expires_at = None if days is None else datetime.now(UTC) + timedelta(days=days)
        secret = opened.add_token(name, [Scope(s) for s in scope], expires_at=expires_at)
    # the secret alone on the standard output, to be piped to where it is needed
    until = "" if expires_at is None else f" until {_day(expires_at)}"
    print(f"token {name} for {', '.join(sorted(set(scope)))}{until}; keep it now:", file=sys.stderr)
    print(secret)
    return 0


def list_tokens(*, store: str | None = None) -> int:
    """List the tokens, without their secrets.

    Parameters
    ----------
    store
        Address of the store; that of the service's settings unless given.
    """
    with _opened(store) as opened:
        found = opened.tokens()
    now = datetime.now(UTC)
    for token in found:
        scopes = ", ".join(sorted(token.scopes))
        print(f"{token.name:<24} {scopes:<20} made {_day(token.created_at)}  {_standing(token, now)}")
    if not found:
        print("no tokens; make one with `tactile-marks tokens add NAME --scope read`", file=sys.stderr)
    return 0


def revoke(name: str, *, store: str | None = None) -> int:
    """Refuse a token from now on.

    Parameters
    ----------
    name
        Whose it is.
    store
        Address of the store; that of the service's settings unless given.
    """
    with _opened(store) as opened:
        opened.revoke(name)
    print(f"token {name} is refused from now on")
    return 0


@contextlib.contextmanager
def _opened(url: str | None) -> Iterator[Store]:
    try:
        from pipeline.store.store import Store, StoreError, UnfitError
    except ImportError as error:
        raise CommandError(
            f"tokens needs {error.name}",
            hint="install it with: pip install 'tactile-marks[service]'",
            status=USAGE,
        ) from error
    with failures_told():
        if url is None:
            from pipeline.service.settings import load_service_settings

            url = load_service_settings().store_url
        try:
            with contextlib.closing(Store.open(url)) as store:
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
