"""Tokens: who may upload, or read where reading is not open to all.

A token is ``sb_<id>_<secret>``. The store keeps the id and the SHA-256 of the secret, which has 256 random bits, so
that guessing is hopeless and a stretched hash would protect nothing more. Comparing takes the same time whatever is
wrong.
"""

from __future__ import annotations

import datetime as dt
import hashlib
import hmac
import re
import secrets
from contextlib import suppress
from dataclasses import dataclass
from enum import StrEnum

from sqlalchemy import insert, select, update

from shadowbench.errors import StorageFullError, StoreError, did_you_mean
from shadowbench.store.access_models import StoredToken
from shadowbench.store.results import Store
from shadowbench.store.uploads import Uploader, add_to_audit, now

_TOKEN = re.compile(r"sb_([0-9a-f]{12})_([A-Za-z0-9_-]{43})")
_NOBODY = hashlib.sha256(b"").hexdigest()
_USED_AGAIN_AFTER = dt.timedelta(minutes=1)
_TABLE = StoredToken.__table__.c

LOCAL = Uploader("", "command line")
"""Whoever may run commands on the results folder."""


class Scope(StrEnum):
    """What a token is good for; each includes those before it."""

    READ = "read"
    UPLOAD = "upload"
    ADMIN = "admin"

    def includes(self, other: Scope) -> bool:
        """Whether a token of this scope may do what ``other`` is for."""
        order = list(Scope)
        return order.index(self) >= order.index(other)


@dataclass(frozen=True)
class Token:
    """A token without its secret; times are ISO 8601, UTC."""

    token_id: str
    name: str
    scope: Scope
    created_at: str
    expires_at: str | None
    revoked_at: str | None
    last_used_at: str | None

    @property
    def state(self) -> str:
        """``valid``, ``expired`` or ``revoked``."""
        if self.revoked_at is not None:
            return "revoked"
        return "expired" if self.expires_at is not None and self.expires_at <= now() else "valid"


class TokenBook:
    """The tokens of a store."""

    def __init__(self, store: Store) -> None:
        self._store = store

    def create(self, name: str, scope: Scope, expires_in: dt.timedelta | None) -> tuple[Token, str]:
        """Make a token and return it with its text, which is not kept and cannot be had again."""
        token_id, secret = secrets.token_hex(6), secrets.token_urlsafe(32)
        end = None if expires_in is None else dt.datetime.now(dt.UTC) + expires_in
        token = Token(
            token_id, name, scope, now(), None if end is None else end.isoformat(timespec="seconds"), None, None
        )
        values = {"scope": scope.value, "digest": _digest(secret)}
        with self._store.session("make a token", writes=True) as session:
            session.execute(insert(StoredToken).values({**vars(token), **values}))
            add_to_audit(session, "token created", token_id, LOCAL, f"{name}, scope {scope}")
        return token, f"sb_{token_id}_{secret}"

    def tokens(self) -> list[Token]:
        """Return all tokens, the oldest first."""
        with self._store.session("read the tokens") as session:
            found = session.execute(select(StoredToken).order_by(_TABLE.created_at, _TABLE.token_id)).scalars()
            return [_token(stored) for stored in found]

    def revoke(self, selector: str) -> Token:
        """Make a token worthless, at once and for ever.

        Args:
            selector: Its id, or its name if no other has it.

        Raises:
            StoreError: None or several are called so.
        """
        known = self.tokens()
        found = [token for token in known if token.token_id == selector] or [
            token for token in known if token.name == selector and token.revoked_at is None
        ]
        if len(found) != 1:
            if found:
                raise StoreError(f"{len(found)} tokens are called '{selector}'; name one by its id")
            hint = did_you_mean(
                selector, [name for token in known for name in (token.token_id, token.name)], noun="token"
            )
            raise StoreError(f"no token is called '{selector}'; {hint}")
        with self._store.session("revoke the token", writes=True) as session:
            session.execute(update(StoredToken).where(_TABLE.token_id == found[0].token_id).values(revoked_at=now()))
            add_to_audit(session, "token revoked", found[0].token_id, LOCAL, found[0].name)
        return found[0]

    def check(self, text: str) -> Token | None:
        """Return the valid token that ``text`` is, and note that it was used; ``None`` for anything else."""
        match = _TOKEN.fullmatch(text)
        token_id, secret = match.groups() if match else ("", "")
        with self._store.session("check the token") as session:
            stored = session.get(StoredToken, token_id)
            digest = _NOBODY if stored is None else stored.digest
            is_right = hmac.compare_digest(digest, _digest(secret))
            token = None if stored is None or not is_right or match is None else _token(stored)
        if token is None or token.state != "valid":
            return None
        self._note_use(token)
        return token

    def any_valid(self, scope: Scope) -> bool:
        """Return whether a valid token includes ``scope``."""
        return any(token.state == "valid" and token.scope.includes(scope) for token in self.tokens())

    def _note_use(self, token: Token) -> None:
        moment = dt.datetime.now(dt.UTC)
        if token.last_used_at and dt.datetime.fromisoformat(token.last_used_at) > moment - _USED_AGAIN_AFTER:
            return
        values = {"last_used_at": moment.isoformat(timespec="seconds")}
        # a full disk must not keep anybody from reading
        with suppress(StorageFullError), self._store.session("note the token's use", writes=True) as session:
            session.execute(update(StoredToken).where(_TABLE.token_id == token.token_id).values(values))


def _token(stored: StoredToken) -> Token:
    fields = {name: getattr(stored, name) for name in Token.__dataclass_fields__}
    return Token(**(fields | {"scope": Scope(stored.scope)}))


def _digest(secret: str) -> str:
    return hashlib.sha256(secret.encode("ascii", errors="replace")).hexdigest()
