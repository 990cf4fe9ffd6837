"""A trained policy: immutable, named by the SHA-256 of its exported bytes."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from typing import Any, TypedDict, cast
from urllib.parse import quote

from typing_extensions import Unpack

from . import wire
from .driving import Answering, awaiting_into, blocking, blocking_into
from .errors import DamagedPolicy
from .labels import Labelled
from .returns import Kind, Returns, read, read_assets
from .session import AsyncSession, Session
from .transport import Transport, idempotent


class Opening(TypedDict, total=False):
    """What a session may be opened with; :meth:`Policy.session` says what each means."""

    history: Returns | None
    kind: Kind | None
    choices: wire.Choices | None
    wealth: float | None
    holding: float | None
    holdings: Mapping[str, float] | None
    renew: wire.Renewing | None
    rolling: bool
    name: str | None
    notes: str | None
    tags: Sequence[str] | None
    idempotency_key: str | None


class _Policy(Labelled):
    """A policy of the service, by its name."""

    def __init__(self, transport: Transport, policy: str) -> None:
        self._transport = transport
        self._path = f"/policies/{quote(policy, safe='')}"
        self.id = policy

    async def _detail(self) -> wire.PolicyDetail:
        """The completed specification and the diagnostics of every step."""
        return cast(wire.PolicyDetail, await self._transport.json("GET", self._path))

    async def _export(self) -> bytes:
        """The portable document, as ``Ballast.import_policy`` takes it. Raises :class:`DamagedPolicy` where the bytes
        that arrive do not hash to the policy's name."""
        document = (await self._transport.call("GET", f"{self._path}/export")).content
        if (found := hashlib.sha256(document).hexdigest()) != self.id:
            raise DamagedPolicy(f"the exported bytes hash to {found}: must be {self.id}")
        return document

    async def _session(self, **opening: Unpack[Opening]) -> wire.Session:
        """Opens a session of an investor.

        ``history`` is what the investor has seen, ``wealth`` what he has; by default both are the policy's own.
        ``history``, ``kind`` and ``choices`` are read as those of :meth:`Ballast.train <ballast.Ballast.train>`.
        ``holding`` is the share of it in the risky asset, by default none; of several assets ``holdings`` says it of
        each by its name, and ``history`` is a DataFrame with a column for each. With ``rolling`` the first step of the
        policy, whose learning must be decay, advises up to 5200 periods. ``name``, ``notes`` and ``tags`` are what the
        session is to be called. The same ``idempotency_key`` and arguments
        again, even from another process, give the same session, at its first period; ``Session.refresh`` tells how far
        it is.
        """
        given: dict[str, Any] = {name: value for name, value in opening.items() if value is not None}
        kind, choices, key = (given.pop(name, None) for name in ("kind", "choices", "idempotency_key"))
        if "tags" in given:
            given["tags"] = list(given["tags"])
        if "holdings" in given:
            given["holdings"] = dict(given["holdings"])
        if "history" in given:
            given["history"] = await self._known(given["history"], kind, choices)
        request, headers = {"policy": self.id, **given}, idempotent(key)
        return cast(wire.Session, await self._transport.json("POST", "/sessions", body=request, headers=headers))

    async def _known(
        self, history: Returns, kind: Kind | None, choices: wire.Choices | None
    ) -> list[float] | list[list[float]]:
        """Returns known at the start; of a DataFrame of several assets the columns in the order of the policy."""
        if len(getattr(history, "columns", ())) < 2:
            return (await read(self._transport, history, kind, choices, "history")).series[0]
        fund = (await self._detail())["specification"].get("fund")
        names = [] if fund is None else fund["assets"]
        if sorted(names) != sorted(str(name) for name in history.columns):
            raise ValueError(f"history has the columns {list(history.columns)}: must have those of the policy, {names}")
        return (await read_assets(self._transport, history, kind, choices, names, "history"))[1].rows

    async def _delete(self) -> None:
        """Deletes it. Raises :class:`InUse` while sessions live by it, and :class:`NotFound` where there is none."""
        await self._transport.call("DELETE", self._path)

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.id:.12}>"


class Policy(_Policy):
    """A policy of the service, by its name."""

    detail = Answering(wire.PolicyDetail).blocking(_Policy._detail)
    export = blocking(_Policy._export)
    session = blocking_into(_Policy._session, Session)
    label = Answering(wire.Labels).blocking(_Policy._label)
    delete = blocking(_Policy._delete)


class AsyncPolicy(_Policy):
    """A :class:`Policy` whose calls are awaited."""

    detail = _Policy._detail
    export = _Policy._export
    session = awaiting_into(_Policy._session, AsyncSession)
    label = _Policy._label
    delete = _Policy._delete
