"""The service, as seen from a program."""

from __future__ import annotations

import itertools
import os
from collections.abc import AsyncIterator, Iterable, Mapping, Sequence
from types import TracebackType
from typing import Any, Literal, TypeAlias, TypeVar, cast
from urllib.parse import quote

import httpx
from typing_extensions import Self

from . import wire
from .driving import Answering, awaiting_into, blocking, blocking_into
from .jobs import (
    AssetsWalkForward,
    AsyncAssetsWalkForward,
    AsyncEvaluation,
    AsyncFrontier,
    AsyncTraining,
    AsyncWalkForward,
    Evaluation,
    Frontier,
    Training,
    WalkForward,
)
from .labels import relabelled
from .policy import AsyncPolicy, Policy
from .returns import Kind, Read, Returns, day, per_period, read, read_assets, reading_of
from .session import AsyncSession, Session
from .sheet import Table
from .transport import RETRIED_STATUS, Awaiting, Transport, Waiting, growing_pause, idempotent

#: What a list of sessions is in the order of; with ``-`` before it descending.
SessionSort: TypeAlias = Literal[
    "created", "-created", "name", "-name", "wealth", "-wealth", "last_report", "-last_report"
]


T = TypeVar("T")


class Advised(wire.Advised):
    """An advice, and the sentence of what was read for it."""

    read: str


class AssetsAdvised(wire.AssetsAdvised):
    """An advice on several assets, and the sentence of what was read for it."""

    read: str


class _Ballast:
    """The calls of a service, however they wait."""

    _transport: Transport

    async def _train(
        self,
        returns: Returns,
        *,
        kind: Kind | None = None,
        choices: wire.Choices | None = None,
        rate_per_step: float | None = None,
        periods_per_year: float | None = None,
        framework: wire.Framework | None = None,
        horizon: int | None = None,
        initial_wealth: float | None = None,
        action_interval: Sequence[float] | None = None,
        trading_cost: float | None = None,
        contributions: float | Sequence[float] | None = None,
        risk_aversion: float | None = None,
        utility: wire.UtilitySpecification | None = None,
        learning: wire.Learning | None = None,
        radius: wire.RadiusRule | None = None,
        caution: wire.CautionLevel | None = None,
        support: wire.Support | None = None,
        law: wire.SamplingLaw | None = None,
        centre: wire.CentreSpecification | None = None,
        design: wire.DesignSpecification | None = None,
        surrogate: wire.SurrogateSpecification | None = None,
        seed: int | None = None,
        name: str | None = None,
        notes: str | None = None,
        tags: Sequence[str] | None = None,
        idempotency_key: str | None = None,
    ) -> wire.Job:
        """Queues a training on the returns seen so far, and does not wait for it.

        ``returns`` is a list, an array, a Series, a DataFrame, the ``Path`` of a CSV or its text: returns of any kind,
        in any unit, or prices. The service reads it (:meth:`read_returns`), with its dates and the column of
        the bank. ``kind`` (``"simple"``, ``"log"`` or ``"price"``) says what the numbers are where they do not, and
        ``choices`` all else, such as ``{"unit": "percent"}``. Where they can still be read in two ways,
        :class:`UnclearReturns` says which those are, and what to add to ``choices`` for each.

        ``rate_per_step`` is what the bank pays per period of the returns, as a fraction: 0.00247 a month for 3 % a
        year; by default what it paid last, where ``returns`` say so. What is left out the service chooses, and
        ``Policy.detail`` tells. ``name``, ``notes`` and ``tags`` are what the policy is to be called, and no
        part of what it is. The same ``idempotency_key`` and arguments again, even from another process, give
        the same job. Raises ``ValueError`` where ``returns`` cannot be meant (a number that is missing, dates
        of an index that do not increase), before anything is queued.
        """
        found = await self._one(returns, kind, choices)
        problem = {
            "history": found.series[0],
            "framework": framework,
            "horizon": horizon,
            "rate_per_step": _last_rate(found, rate_per_step),
            "periods_per_year": found.periods_per_year if periods_per_year is None else periods_per_year,
            "initial_wealth": initial_wealth,
            "action_interval": None if action_interval is None else list(action_interval),
            "trading_cost": trading_cost,
            "contributions": _amounts(contributions),
            "risk_aversion": risk_aversion,
            "utility": utility,
            "learning": learning,
            "radius": radius,
            "caution": caution,
            "support": support,
            "law": law,
            "centre": centre,
        }
        whole = {"problem": _given(problem), "design": design, "surrogate": surrogate, "seed": seed}
        specification = cast(wire.Specification, _given(whole))
        job = await self._submit(specification, name=name, notes=notes, tags=tags, idempotency_key=idempotency_key)
        return _having_read(job, found)

    async def _advise(
        self,
        /,
        returns: Returns,
        *,
        kind: Kind | None = None,
        choices: wire.Choices | None = None,
        rate_per_step: float | None = None,
        wealth: float | None = None,
        holding: float | None = None,
        sensitivity: bool | None = None,
        **problem: Any,
    ) -> Advised:
        """What to hold through one period, given the returns seen so far. Nothing is trained or stored.

        ``returns``, ``kind``, ``choices`` and ``rate_per_step`` are as in ``train``, and so is every other field of the
        problem that is given by name, such as ``risk_aversion`` or ``trading_cost``. ``wealth`` and ``holding`` are
        what the investor has, and what share of it is in the asset already. ``sensitivity=True`` also says how
        near the advice is to changing.
        """
        found = await self._one(returns, kind, choices)
        told = {"rate_per_step": _last_rate(found, rate_per_step), "periods_per_year": found.periods_per_year}
        question = {
            "problem": {"history": found.series[0], **_given(told), **_given(problem)},
            "wealth": wealth,
            "holding": holding,
            "sensitivity": sensitivity,
        }
        return _having_read(cast(Advised, await self._transport.json("POST", "/advise", body=_given(question))), found)

    async def _advise_assets(
        self,
        /,
        returns: Table,
        *,
        kind: Kind | None = None,
        choices: wire.Choices | None = None,
        rate_per_step: float | None = None,
        assets: Sequence[str] | None = None,
        wealth: float | None = None,
        holdings: Mapping[str, float] | None = None,
        **problem: Any,
    ) -> AssetsAdvised:
        """What to hold of each of several assets through one period. Nothing is trained or stored.

        ``returns`` has a column for each asset: a DataFrame, a text or the ``Path`` of a file, or rows of numbers with
        ``assets``. By default the assets are all columns that hold neither dates nor the rates of the bank; ``assets``
        chooses among them. They are read as in ``train``, and so are ``kind``, ``choices`` and ``rate_per_step``: what
        the bank pays may stand in a column that is not chosen. Every other field of the problem is given by name, such
        as ``ground_norm``, ``risk_aversion``, ``caution``, ``radius``, ``support`` or ``trading_cost``. ``holdings`` is
        what share of wealth is in each asset already, by its name.
        """
        whole, found = await self._of_assets(returns, kind, choices, rate_per_step, assets, problem)
        question = _given({"problem": whole, "wealth": wealth, "holdings": holdings})
        return _having_read(cast(AssetsAdvised, await self._transport.json("POST", "/advise", body=question)), found)

    async def _train_assets(
        self,
        /,
        returns: Table,
        *,
        kind: Kind | None = None,
        choices: wire.Choices | None = None,
        rate_per_step: float | None = None,
        assets: Sequence[str] | None = None,
        design: wire.DesignSpecification | None = None,
        surrogate: wire.SurrogateSpecification | None = None,
        seed: int | None = None,
        name: str | None = None,
        notes: str | None = None,
        tags: Sequence[str] | None = None,
        idempotency_key: str | None = None,
        **problem: Any,
    ) -> wire.Job:
        """Queues the training of a policy for several assets, and does not wait for it.

        ``returns``, ``kind``, ``choices``, ``assets`` and ``rate_per_step`` are as in ``advise_assets``, and so
        is every other field of the problem that is given by name; also ``horizon``, ``trading_cost``,
        ``contributions`` and ``composition``. What else is given is as in ``train``.
        """
        of_assets, found = await self._of_assets(returns, kind, choices, rate_per_step, assets, problem)
        whole = {"problem": of_assets, "design": design, "surrogate": surrogate, "seed": seed}
        request = {**_given(whole), **relabelled(name, notes, tags)}
        return _having_read(await self._queued("/train", request, idempotency_key), found)

    async def _one(self, returns: Returns, kind: Kind | None, choices: wire.Choices | None) -> Read:
        """Returns of one asset."""
        found = await read(self._transport, returns, kind, choices)
        if len(found.series) != 1:
            raise ValueError("returns has several columns: must be one; train_assets and advise_assets take several")
        return found

    async def _of_assets(
        self,
        returns: Table,
        kind: Kind | None,
        choices: wire.Choices | None,
        rate_per_step: float | None,
        assets: Sequence[str] | None,
        problem: Mapping[str, Any],
    ) -> tuple[dict[str, Any], Read]:
        """The problem of several assets, and what was read for it."""
        names, found = await read_assets(self._transport, returns, kind, choices, assets)
        told = {"rate_per_step": _last_rate(found, rate_per_step), "periods_per_year": found.periods_per_year}
        return {"assets": names, "history": found.rows, **_given(told), **_given(problem)}, found

    async def _read_returns(self, source: str | os.PathLike[str] | Table, /, **choices: Any) -> wire.Reading:
        """What a text of returns or prices says: one record, or what must be asked, or where it is wrong.

        ``source`` is a text, the ``Path`` of a file, a table of pandas, polars or pyarrow, an array or a list.
        ``choices`` say what it does not, or answer what was asked: ``unit="percent"``, ``columns=["fund"]`` (several
        are several assets). Look at ``reading["outcome"]``: ``"read"`` has a ``sentence`` to check it by, and
        ``series``.
        """
        return await reading_of(self._transport, source, None, cast(wire.Choices, choices), "source")

    async def _submit(
        self,
        specification: wire.Specification,
        *,
        name: str | None = None,
        notes: str | None = None,
        tags: Sequence[str] | None = None,
        idempotency_key: str | None = None,
    ) -> wire.Job:
        """Queues the training of a whole specification, such as ``Policy.detail`` shows. Its policy is to be called as
        in ``train``."""
        request = {**specification, **relabelled(name, notes, tags)}
        return await self._queued("/train", request, idempotency_key)

    async def _job(self, job: str) -> wire.Job:
        """A training, an evaluation, a walk-forward or a frontier that was queued before."""
        return cast(wire.Job, await self._transport.json("GET", f"/jobs/{quote(job, safe='')}"))

    async def _evaluate(self, request: wire.EvaluationRequest, *, idempotency_key: str | None = None) -> wire.Job:
        """Queues a comparison of strategies on common simulated returns, and does not wait for it."""
        return await self._queued("/evaluate", request, idempotency_key)

    async def _backtest(
        self,
        returns: Returns,
        *,
        kind: Kind | None = None,
        choices: wire.Choices | None = None,
        rate: float | Sequence[float] | None = None,
        dates: Iterable[object] | None = None,
        periods_per_year: int | None = None,
        window: int | None = None,
        every: int | None = None,
        horizon: int | None = None,
        alpha: Sequence[float] | None = None,
        scale: float | None = None,
        caution: wire.CautionLevel | None = None,
        support: wire.Support | None = None,
        centre: wire.CentreSpecification | None = None,
        risk_aversion: float | None = None,
        trading_cost: float | None = None,
        cost_blind: bool | None = None,
        count: int | None = None,
        seed: int | None = None,
        idempotency_key: str | None = None,
    ) -> wire.Job:
        """Queues a walk-forward through a record of returns, as ``ballast backtest`` does, and does not wait for it.

        ``returns``, ``kind`` and ``choices`` are as in ``train``; ``rate`` is what the bank paid, one fraction for all
        periods or one for each, by default as ``returns`` say. ``dates`` are texts or dates, one for each
        number, by default those of the index of a pandas object, and tell how many periods make a year;
        ``periods_per_year`` says so without them. What is left out the service chooses, and the report tells.
        Raises ``ValueError`` where ``returns``, ``rate`` or ``dates`` cannot be meant, before anything is queued.
        """
        found = await self._one(returns, kind, choices)
        request = {
            "log_returns": found.series[0],
            **_beside(found, returns, rate, dates),
            "periods_per_year": periods_per_year,
            "window": window,
            "every": every,
            "horizon": horizon,
            "alpha": None if alpha is None else list(alpha),
            "scale": scale,
            "caution": caution,
            "support": support,
            "centre": centre,
            "risk_aversion": risk_aversion,
            "trading_cost": trading_cost,
            "cost_blind": cost_blind,
            "count": count,
            "seed": seed,
        }
        return _having_read(await self._queued("/backtest", _given(request), idempotency_key), found)

    async def _backtest_assets(
        self,
        returns: Table,
        *,
        kind: Kind | None = None,
        choices: wire.Choices | None = None,
        rate: float | Sequence[float] | None = None,
        assets: Sequence[str] | None = None,
        dates: Iterable[object] | None = None,
        periods_per_year: int | None = None,
        windows: Sequence[int | None] | None = None,
        every: int | None = None,
        alpha: float | None = None,
        support: wire.Support | None = None,
        risk_aversion: float | None = None,
        trading_cost: float | None = None,
        seed: int | None = None,
        idempotency_key: str | None = None,
    ) -> wire.Job:
        """Queues a walk-forward through a table of several assets, as ``ballast backtest`` does, and does not wait for
        it.

        ``returns``, ``kind``, ``choices`` and ``assets`` are as in ``advise_assets``; ``rate`` and ``dates`` as in
        ``backtest``, and dates are needed. ``windows`` are how many of the last periods strategies know, ``None`` for
        all. What is left out the service chooses, and the report tells. Raises ``ValueError`` where ``returns``,
        ``rate`` or ``dates`` cannot be meant, before anything is queued.
        """
        names, found = await read_assets(self._transport, returns, kind, choices, assets)
        beside = _beside(found, returns, rate, dates)
        if beside["dates"] is None:
            raise ValueError("dates is None: must be given where returns has none")
        request = {
            "assets": names,
            "log_returns": found.rows,
            **beside,
            "periods_per_year": periods_per_year,
            "windows": None if windows is None else list(windows),
            "every": every,
            "alpha": alpha,
            "support": support,
            "risk_aversion": risk_aversion,
            "trading_cost": trading_cost,
            "seed": seed,
        }
        return _having_read(await self._queued("/backtest", _given(request), idempotency_key), found)

    async def _frontier(
        self,
        /,
        returns: Returns | Table,
        *,
        kind: Kind | None = None,
        choices: wire.Choices | None = None,
        rate_per_step: float | None = None,
        assets: Sequence[str] | None = None,
        scales: Sequence[float] | None = None,
        resamples: int | None = None,
        block: int | None = None,
        seed: int | None = None,
        name: str | None = None,
        notes: str | None = None,
        tags: Sequence[str] | None = None,
        idempotency_key: str | None = None,
        **problem: Any,
    ) -> wire.Job:
        """Queues the frontier of caution: what multiples of the radius lose on records like this one.

        ``returns`` are of one asset as in ``advise``, or, with more than one column, of several as in
        ``advise_assets``. Every other field of the problem is given by name, such as ``risk_aversion`` or ``radius``.
        """
        if assets is None and len(getattr(returns, "columns", ())) < 2:
            found = await self._one(returns, kind, choices)
            told = {"rate_per_step": _last_rate(found, rate_per_step), "periods_per_year": found.periods_per_year}
            whole = {"history": found.series[0], **_given(told), **_given(problem)}
        else:
            whole, found = await self._of_assets(returns, kind, choices, rate_per_step, assets, problem)
            if len(whole["assets"]) == 1:
                # Of two columns one was of dates or of the bank.
                del whole["assets"]
                whole["history"] = [log_return for (log_return,) in whole["history"]]
        request = {
            "problem": whole,
            "scales": None if scales is None else list(scales),
            "resamples": resamples,
            "block": block,
            "seed": seed,
        }
        return _having_read(await self._queued("/frontier", _given(request), idempotency_key), found)

    async def _import_policy(self, document: bytes) -> str:
        """Stores an exported policy; one that the service knows already stays as it is."""
        imported: wire.Imported = await self._transport.json("POST", "/policies/import", body=document)
        return imported["policy"]

    async def _session(self, session: str) -> wire.Session:
        """A session that was opened before, at the period it has come to."""
        return cast(wire.Session, await self._transport.json("GET", f"/sessions/{quote(session, safe='')}"))

    async def _observe(self, reports: Iterable[wire.Observe]) -> list[wire.ElementAnswered]:
        """Reports a period of each of many sessions at once, and answers what became of each, in their order.

        A report is what :meth:`Session.observe <ballast.Session.observe>` sends: ``session``, ``period`` and how the
        period went. Each is recorded, answered and refused by itself: ``status`` is 200 beside an ``answer``, and
        another beside a ``problem``, where ``Session.observe`` would raise. A thousand go in one request. What is
        refused for the moment is sent again by itself, as a lost request is; the same reports again are answered as
        they were. Objects of these sessions learn of it by ``refresh``.
        """
        reports = list(reports)
        answered: dict[int, wire.ElementAnswered] = {}
        for start in range(0, len(reports), _REPORTS):
            waiting = list(range(start, min(start + _REPORTS, len(reports))))
            for attempt in itertools.count():
                sent = [reports[index] for index in waiting]
                answers: list[wire.ElementAnswered] = await self._transport.json("POST", "/observe", body=sent)
                answered.update(zip(waiting, answers, strict=True))
                waiting = [index for index in waiting if answered[index]["status"] in RETRIED_STATUS]
                if not waiting or attempt == self._transport.retries:
                    break
                await self._transport.pause(max(_SECOND, growing_pause(attempt)))
        return [answered[index] for index in range(len(reports))]

    def _jobs(self) -> AsyncIterator[wire.Job]:
        """All jobs, newest first."""
        return self._listed("/jobs", "jobs")

    def _policies(self) -> AsyncIterator[wire.PolicyEntry]:
        """All policies, newest first."""
        return self._listed("/policies", "policies")

    def _sessions(
        self,
        *,
        search: str | None = None,
        tag: str | None = None,
        state: Literal["active", "waiting", "completed"] | None = None,
        sort: SessionSort | None = None,
    ) -> AsyncIterator[wire.SessionEntry]:
        """All sessions, or those that match, each with what it is called and where it stands; newest first unless told.

        ``search`` is words, each the beginning of a word of the session's or its policy's name or tags, or eight digits
        or more with which an identifier begins, whatever the case; ``tag`` is one that they have.
        :func:`ballast.frames.sessions` makes a table of them.
        """
        return self._listed("/sessions", "sessions", search=search, tag=tag, state=state, sort=sort)

    def _audit(self, *, tenant: str | None = None, object: str | None = None) -> AsyncIterator[wire.AuditEntry]:
        """Who did what, newest first, of all tenants and things unless told; for keys with the role ``admin``."""
        return self._listed("/audit", "entries", tenant=tenant, object=object)

    async def _health(self) -> wire.Health:
        """The service in a few words. Raises :class:`Overloaded` where it is draining."""
        return cast(wire.Health, await self._transport.json("GET", "/health"))

    async def _close(self) -> None:
        """Closes the connections."""
        await self._transport.close()

    async def _queued(self, path: str, request: Mapping[str, Any], idempotency_key: str | None) -> wire.Job:
        return cast(
            wire.Job, await self._transport.json("POST", path, body=request, headers=idempotent(idempotency_key))
        )

    async def _listed(self, path: str, name: str, **wanted: str | None) -> AsyncIterator[Any]:
        after: int | str | None = None
        while True:
            page = await self._transport.json("GET", path, params={"after": after, "limit": _PAGE, **wanted})
            for entry in page[name]:
                yield entry
            after = page.get("next")
            if after is None:
                return

    def __repr__(self) -> str:
        return f"<{type(self).__name__} at {self._transport.http.base_url}>"


class Ballast(_Ballast):
    """A service at ``url``.

    ``key`` is shown with every request: ``BALLAST_KEY`` of the environment unless given.
    ``timeout`` bounds each wait for the network, in seconds. A request that is lost or put off is sent again up to
    ``retries`` times, after 0.2 s, 0.4 s and so on (``ballast.transport`` says which, and why that is safe).
    ``headers`` go with every request, and ``transport`` replaces the connections themselves (proxies, certificates).
    Safe to share between threads; as a context manager it closes its connections at the end.
    """

    def __init__(
        self,
        url: str = "http://127.0.0.1:8080",
        *,
        key: str | None = None,
        timeout: float = 30.0,
        retries: int = 6,
        headers: Mapping[str, str] | None = None,
        transport: httpx.BaseTransport | None = None,
    ) -> None:
        http = httpx.Client(base_url=url, timeout=timeout, headers=_headers(key, headers), transport=transport)
        self._transport = Waiting(http, retries)

    train = blocking_into(_Ballast._train, Training)
    train_assets = blocking_into(_Ballast._train_assets, Training)
    submit = blocking_into(_Ballast._submit, Training)
    training = blocking_into(_Ballast._job, Training)
    evaluate = blocking_into(_Ballast._evaluate, Evaluation)
    evaluation = blocking_into(_Ballast._job, Evaluation)
    backtest = blocking_into(_Ballast._backtest, WalkForward)
    walk_forward = blocking_into(_Ballast._job, WalkForward)
    backtest_assets = blocking_into(_Ballast._backtest_assets, AssetsWalkForward)
    assets_walk_forward = blocking_into(_Ballast._job, AssetsWalkForward)
    frontier = blocking_into(_Ballast._frontier, Frontier)
    frontier_of = blocking_into(_Ballast._job, Frontier)
    import_policy = blocking_into(_Ballast._import_policy, Policy)
    session = blocking_into(_Ballast._session, Session)
    advise = Answering(Advised).blocking(_Ballast._advise)
    advise_assets = Answering(AssetsAdvised).blocking(_Ballast._advise_assets)
    read_returns = blocking(_Ballast._read_returns)
    observe = blocking(_Ballast._observe)
    health = Answering(wire.Health).blocking(_Ballast._health)
    close = blocking(_Ballast._close)
    jobs = Answering(wire.Job).iterating(_Ballast._jobs)
    policies = Answering(wire.PolicyEntry).iterating(_Ballast._policies)
    sessions = Answering(wire.SessionEntry).iterating(_Ballast._sessions)
    audit = Answering(wire.AuditEntry).iterating(_Ballast._audit)

    def policy(self, policy: str) -> Policy:
        """A policy by its name. Asks nothing of the service yet."""
        return Policy(self._transport, policy)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()


class AsyncBallast(_Ballast):
    """A :class:`Ballast` whose calls are awaited: the same names, arguments, answers and errors, for asyncio.

    ``jobs()``, ``policies()``, ``sessions()``, ``audit()`` and ``events()`` are for ``async for``, ``async with``
    closes the connections at the end, and objects that come out of calls (:class:`AsyncTraining`,
    :class:`AsyncSession`) are awaited likewise. For the tasks of one event loop. The arguments are those of
    :class:`Ballast`, but ``transport``, which is an asynchronous one.
    """

    def __init__(
        self,
        url: str = "http://127.0.0.1:8080",
        *,
        key: str | None = None,
        timeout: float = 30.0,
        retries: int = 6,
        headers: Mapping[str, str] | None = None,
        transport: httpx.AsyncBaseTransport | None = None,
    ) -> None:
        http = httpx.AsyncClient(base_url=url, timeout=timeout, headers=_headers(key, headers), transport=transport)
        self._transport = Awaiting(http, retries)

    train = awaiting_into(_Ballast._train, AsyncTraining)
    train_assets = awaiting_into(_Ballast._train_assets, AsyncTraining)
    submit = awaiting_into(_Ballast._submit, AsyncTraining)
    training = awaiting_into(_Ballast._job, AsyncTraining)
    evaluate = awaiting_into(_Ballast._evaluate, AsyncEvaluation)
    evaluation = awaiting_into(_Ballast._job, AsyncEvaluation)
    backtest = awaiting_into(_Ballast._backtest, AsyncWalkForward)
    walk_forward = awaiting_into(_Ballast._job, AsyncWalkForward)
    backtest_assets = awaiting_into(_Ballast._backtest_assets, AsyncAssetsWalkForward)
    assets_walk_forward = awaiting_into(_Ballast._job, AsyncAssetsWalkForward)
    frontier = awaiting_into(_Ballast._frontier, AsyncFrontier)
    frontier_of = awaiting_into(_Ballast._job, AsyncFrontier)
    import_policy = awaiting_into(_Ballast._import_policy, AsyncPolicy)
    session = awaiting_into(_Ballast._session, AsyncSession)
    advise = _Ballast._advise
    advise_assets = _Ballast._advise_assets
    read_returns = _Ballast._read_returns
    observe = _Ballast._observe
    health = _Ballast._health
    close = _Ballast._close
    jobs = _Ballast._jobs
    policies = _Ballast._policies
    sessions = _Ballast._sessions
    audit = _Ballast._audit

    def policy(self, policy: str) -> AsyncPolicy:
        """A policy by its name. Asks nothing of the service yet."""
        return AsyncPolicy(self._transport, policy)

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        await self.close()


#: Entries asked for at a time.
_PAGE = 200
#: Reports sent at a time.
_REPORTS = 1000
#: The pause before elements of a list that were refused for the moment are sent again: rates are by the second.
_SECOND = 1.0


def _last_rate(found: Read, rate_per_step: float | None) -> float:
    if rate_per_step is not None:
        return rate_per_step
    if not found.rates:
        raise ValueError("rate_per_step is missing: must be given, as returns do not say what the bank paid")
    return found.rates[-1]


def _beside(
    found: Read, returns: Returns, rate: float | Sequence[float] | None, dates: Iterable[object] | None
) -> dict[str, Any]:
    """What the bank paid through a record and the dates of its periods: as given, or else as they were read.

    Raises ``ValueError`` that names the argument and the rule.
    """
    count = len(found.series[0])
    days = found.dates
    if dates is not None:
        days = per_period("dates", [day(date) for date in dates], returns, count, found.kind, found.is_turned)
    if isinstance(rate, Iterable):
        paid = per_period("rate", rate, returns, count, found.kind, found.is_turned)
        rate = [float(each) for each in paid]
    rate = found.rates if rate is None else rate
    if rate is None:
        raise ValueError("rate is missing: must be given, as returns do not say what the bank paid")
    return {"rate": rate, "dates": days}


def _having_read(answer: T, found: Read) -> T:
    """The answer with the sentence of what was read for it."""
    return cast(T, {**cast(Mapping[str, Any], answer), "read": found.sentence})


def _amounts(contributions: float | Sequence[float] | None) -> float | list[float] | None:
    return list(contributions) if isinstance(contributions, Sequence) else contributions


def _given(fields: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in fields.items() if value is not None}


def _headers(key: str | None, more: Mapping[str, str] | None) -> dict[str, str]:
    """What goes with every request: the key, from the environment unless given, and ``more``."""
    key = os.environ.get("BALLAST_KEY") if key is None else key
    return {**({"authorization": f"Bearer {key}"} if key else {}), **(more or {})}
