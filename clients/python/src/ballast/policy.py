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
from .returns import Kind, LogReturns, Read, Returns, read, read_assets
from .session import AsyncSession, Session
from .sheet import Sheet, sheet_of
from .transport import Transport, idempotent


class Opening(TypedDict, total=False):
    """The arguments that open a session; :meth:`Policy.session` explains them."""

    history: Returns | wire.History | None
    kind: Kind | None
    choices: wire.Choices | None
    wealth: float | None
    holding: float | None
    holdings: Mapping[str, float] | None
    state: Mapping[str, float] | None
    renew: wire.Renewing | None
    rolling: bool
    name: str | None
    notes: str | None
    tags: Sequence[str] | None
    idempotency_key: str | None


class _Policy(Labelled):
    """A policy of the service, known by its name."""

    def __init__(self, transport: Transport, policy: str) -> None:
        self._transport = transport
        self._path = f"/policies/{quote(policy, safe='')}"
        self.id = policy

    async def _detail(self) -> wire.PolicyDetail:
        """Returns the completed specification and the diagnostics of every step."""
        detail = cast(wire.PolicyDetail, await self._transport.json("GET", self._path))
        if "states" not in (problem := detail["specification"]["problem"]):
            problem["history"] = LogReturns(problem["history"])
        return detail

    async def _export(self) -> bytes:
        """Returns the portable document, which ``Ballast.import_policy`` accepts. Raises :class:`DamagedPolicy` if the
        SHA-256 of the bytes differs from the policy's name."""
        document = (await self._transport.call("GET", f"{self._path}/export")).content
        if (found := hashlib.sha256(document).hexdigest()) != self.id:
            raise DamagedPolicy(f"the SHA-256 of the exported bytes is {found}: must be {self.id}")
        return document

    async def _surface(self, step: int = 0, across: wire.SurfaceAxis | None = None) -> wire.Surface:
        """Returns what the policy holds after ``step`` periods over records like its own, shifted to other means.

        The columns differ in ``across``, wealth or the standard deviation of the record. Rows and columns that the
        surrogates were not trained for are marked by ``in_design``.
        """
        path, params = f"{self._path}/surface", {"step": step, "across": across}
        return cast(wire.Surface, await self._transport.json("GET", path, params=params))

    async def _futures(self, paths: int | None = None) -> wire.Futures:
        """Plays the policy from its start in two worlds, with ``paths`` paths of each.

        In one of them every period brings the law that is worst for what is decided, in the other periods are drawn
        from the record. Every step of the first is solved, so it takes a while. :func:`ballast.plots.futures` draws the
        answer.
        """
        return cast(wire.Futures, await self._transport.json("GET", f"{self._path}/futures", params={"paths": paths}))

    async def _decide(
        self, period: int = 1, state: Mapping[str, float] | None = None, noises: Sequence[float] = ()
    ) -> wire.DecideAnswer:
        """Returns the actions of a declared problem before ``period``, what they are worth, and their worst law.

        ``state`` has the states by name; in the first period it may be left out, and the problem starts where it was
        declared to. ``noises`` are those of all periods before this one. Nothing is stored.
        """
        given = None if state is None else dict(state)
        question = {"policy": self.id, "period": period, "state": given, "noises": list(noises)}
        return cast(wire.DecideAnswer, await self._transport.json("POST", "/decide", body=question))

    async def _session(self, **opening: Unpack[Opening]) -> wire.Session:
        """Opens a session for an investor, or one that lives a declared problem.

        A declared problem starts in ``state``, its states by name, by default where it was declared to. It may
        ``renew`` itself; all else but labels and ``idempotency_key`` is for investors.

        ``history`` are the returns that the investor knows, and ``wealth`` is what they have. By default both are those
        of the policy. ``history``, ``kind`` and ``choices`` are as in :meth:`Ballast.train <ballast.Ballast.train>`,
        but ``kind`` is required for everything except files and texts, because the service's own histories are of
        log-returns. Log-returns that the service returned need no ``kind``. If you pass the whole result of
        ``Session.history``, the session starts as that one did, with its returns, its wealth and its holdings. For
        several assets ``history`` is a table with a column for each, or rows in the order of the policy.

        ``holding`` is the share of wealth in the risky asset, by default 0. For several assets ``holdings`` gives the
        share of each by its name. With ``rolling`` the first step of the policy, whose learning must be decay, advises
        up to 5200 periods. ``name``, ``notes`` and ``tags`` label the session. The same ``idempotency_key`` and
        arguments again, even from another process, give the same session as an object at its first period;
        ``Session.refresh`` brings it to the current one.
        """
        given: dict[str, Any] = {name: value for name, value in opening.items() if value is not None}
        kind, choices, key = (given.pop(name, None) for name in ("kind", "choices", "idempotency_key"))
        if "tags" in given:
            given["tags"] = list(given["tags"])
        if "history" in given and isinstance(given["history"], Mapping):
            given = {**_start(cast(wire.History, given["history"])), **given}
            given["history"] = LogReturns(given["history"]["history"])
        if "holdings" in given:
            given["holdings"] = dict(given["holdings"])
        if "state" in given:
            given["state"] = dict(given["state"])
        found = None
        if "history" in given:
            found = await self._known(given["history"], kind, choices)
            given["history"] = found.rows if len(found.series) > 1 else found.series[0]
        request, headers = {"policy": self.id, **given}, idempotent(key)
        session = await self._transport.json("POST", "/sessions", body=request, headers=headers)
        return cast(wire.Session, session if found is None else {**session, "read": found.sentence})

    async def _known(self, history: Returns, kind: Kind | None, choices: wire.Choices | None) -> Read:
        """Reads the returns known at the start. For several assets the columns are in the order of the policy."""
        if isinstance(history, LogReturns):
            return await read(self._transport, history, kind, choices, "history")
        held = sheet_of(history, "history")
        fund = None
        if isinstance(held, str) or any(len(row) > 1 for row in held.rows):
            fund = cast(wire.Specification, (await self._detail())["specification"]).get("fund")
        if fund is None:
            found = await read(self._transport, held, kind, choices, "history")
            if len(found.series) != 1:
                raise ValueError("history has several columns: must have one because the policy is of one asset")
            return found
        names = fund["assets"]
        if isinstance(held, Sheet) and held.names is not None and not set(names) <= set(held.names):
            raise ValueError(f"history has the columns {held.names}: must have those of the policy, {names}")
        return (await read_assets(self._transport, held, kind, choices, names, "history"))[1]

    async def _delete(self) -> None:
        """Deletes the policy. Raises :class:`InUse` while sessions use it, and :class:`NotFound` if there is none."""
        await self._transport.call("DELETE", self._path)

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.id:.12}>"


def _start(history: wire.History) -> dict[str, Any]:
    """Returns the wealth and the holdings with which a session was opened."""
    composed = history.get("composed")
    wealth = {"wealth": history["initial_wealth"]}
    if composed is None:
        return {**wealth, "holding": history["initial_holding"]}
    return {**wealth, "holdings": composed["holdings"]}


class Policy(_Policy):
    """A policy of the service, known by its name."""

    detail = Answering(wire.PolicyDetail).blocking(_Policy._detail)
    export = blocking(_Policy._export)
    surface = Answering(wire.Surface).blocking(_Policy._surface)
    futures = Answering(wire.Futures).blocking(_Policy._futures)
    decide = Answering(wire.DecideAnswer).blocking(_Policy._decide)
    session = blocking_into(_Policy._session, Session)
    label = Answering(wire.Labels).blocking(_Policy._label)
    delete = blocking(_Policy._delete)


class AsyncPolicy(_Policy):
    """A :class:`Policy` whose calls are awaited."""

    detail = _Policy._detail
    export = _Policy._export
    surface = _Policy._surface
    futures = _Policy._futures
    decide = _Policy._decide
    session = awaiting_into(_Policy._session, AsyncSession)
    label = _Policy._label
    delete = _Policy._delete
