"""The service, as seen from a program."""

from __future__ import annotations

import itertools
import os
from collections.abc import AsyncIterator, Callable, Iterable, Mapping, Sequence
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
    AsyncComparison,
    AsyncDeclaredWalkForward,
    AsyncEvaluation,
    AsyncFrontier,
    AsyncTraining,
    AsyncWalkForward,
    Comparison,
    DeclaredWalkForward,
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

#: The field by which a list of sessions is sorted; with a leading ``-``, in descending order.
SessionSort: TypeAlias = Literal[
    "created", "-created", "name", "-name", "wealth", "-wealth", "last_report", "-last_report"
]


T = TypeVar("T")


class Advised(wire.Advised):
    """An advice, with a sentence that says how the returns were read."""

    read: str


class Sleeve(wire.SleeveReport):
    """The share of the capital that a record supports, with a sentence that says how the returns were read."""

    read: str


class Plan(wire.PlanReport):
    """A plan, with a sentence that says how the returns were read."""

    read: str


class AssetsAdvised(wire.AssetsAdvised):
    """An advice on several assets, with a sentence that says how the returns were read."""

    read: str


class _Ballast:
    """The calls of a service, for both the blocking and the asynchronous client."""

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
        spending: wire.Spending | None = None,
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

        ``returns`` is a list, an array, a Series, a DataFrame, the ``Path`` of a CSV or its text. It holds returns of
        any kind and in any unit, or prices. The service reads it (:meth:`read_returns`), with its dates and the column
        of the bank. If the numbers do not show what they are, ``kind`` (``"simple"``, ``"log"`` or ``"price"``) says
        so. ``choices`` settles everything else, such as ``{"unit": "percent"}``. If two readings are still possible,
        :class:`UnclearReturns` lists them and what to add to ``choices`` for each.

        ``rate_per_step`` is what the bank pays per period of the returns, as a fraction: 0.00247 a month for 3 % a
        year. By default it is the last rate in ``returns``, if they have a column of rates. The service chooses what
        you leave out, and ``Policy.detail`` shows what it chose. ``name``, ``notes`` and ``tags`` label the policy and
        do not change it. The same ``idempotency_key`` and arguments again, even from another process, give the same
        job. Raises ``ValueError`` before anything is queued if ``returns`` cannot be correct, for example if a number
        is missing or the dates of an index do not increase.
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
            "spending": spending,
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
        """Returns what to hold through one period, given the returns seen so far. Nothing is trained or stored.

        ``returns``, ``kind``, ``choices`` and ``rate_per_step`` are as in ``train``. Every other field of the problem
        can be given by name, such as ``risk_aversion`` or ``trading_cost``. ``wealth`` is what the investor has, and
        ``holding`` is the share of it that is already in the asset. ``sensitivity=True`` also shows how close the
        advice is to changing.
        """
        found = await self._one(returns, kind, choices)
        terms = {"rate_per_step": _last_rate(found, rate_per_step), "periods_per_year": found.periods_per_year}
        question = {
            "problem": {"history": found.series[0], **_given(terms), **_given(problem)},
            "wealth": wealth,
            "holding": holding,
            "sensitivity": sensitivity,
        }
        return _having_read(cast(Advised, await self._transport.json("POST", "/advise", body=_given(question))), found)

    async def _plan(
        self,
        /,
        returns: Returns,
        *,
        horizon: int,
        kind: Kind | None = None,
        choices: wire.Choices | None = None,
        rate_per_step: float | None = None,
        wealth: float | None = None,
        wanted: float | None = None,
        goal: float | None = None,
        saved: float | None = None,
        aim: wire.PlanAim | None = None,
        drawdown_limit: float | None = None,
        drawdown: float | None = None,
        certainty: float | None = None,
        paths: int | None = None,
        seed: int | None = None,
        **problem: Any,
    ) -> Plan:
        """Returns what to spend and what to hold in each of ``horizon`` periods, and how likely the money lasts.

        ``returns``, ``kind``, ``choices`` and ``rate_per_step`` are as in ``train``. ``wealth`` is what there is now,
        ``wanted`` an amount for every period and ``goal`` the wealth wanted at the horizon, all in money of now.
        ``aim="goal"`` makes what is missing of them on average least, and ``saved`` is then put in every period.
        ``drawdown_limit`` is how far money that stays invested may fall below its highest value, and ``drawdown`` how
        far it is below it now.
        ``certainty`` is the probability with which an amount is to last. Every other field of the problem can be given
        by name, such as ``risk_aversion``, ``caution`` or ``spending={"inflation": 0.002}``. Nothing is trained or
        stored: ``train`` with the same fields and ``framework="static"`` makes a policy that sessions follow.
        """
        found = await self._one(returns, kind, choices)
        terms = {
            "rate_per_step": _last_rate(found, rate_per_step),
            "periods_per_year": found.periods_per_year,
            "initial_wealth": wealth,
            "horizon": horizon,
        }
        question = {
            "problem": {"history": found.series[0], **_given(terms), **_given(problem)},
            "wanted": wanted,
            "goal": goal,
            "saved": saved,
            "aim": aim,
            "drawdown_limit": drawdown_limit,
            "drawdown": drawdown,
            "certainty": certainty,
            "paths": paths,
            "seed": seed,
        }
        return _having_read(cast(Plan, await self._transport.json("POST", "/plan", body=_given(question))), found)

    async def _sleeve(
        self,
        /,
        returns: Returns | Table,
        *,
        kind: Kind | None = None,
        choices: wire.Choices | None = None,
        rate_per_step: float | None = None,
        assets: Sequence[str] | None = None,
        record_of: wire.RecordUnit | None = None,
        seed: int | None = None,
        **problem: Any,
    ) -> Sleeve:
        """Returns the share of the capital that the record of a strategy supports, beside the Kelly share.

        ``returns``, ``kind``, ``choices`` and ``rate_per_step`` are as in ``train``; with ``assets``, as in
        ``advise_assets``, and each asset is a strategy. ``record_of="trades"`` says that each value is the outcome of a
        trade as a share of its stake; ``rate_per_step=0`` then says that the bank pays nothing meanwhile. Every other
        field of the problem can be given by name, such as ``caution``, ``radius`` or ``periods_per_year``. Nothing is
        trained or stored.
        """
        if assets is None:
            found = await self._one(returns, kind, choices)
            terms = {"rate_per_step": _last_rate(found, rate_per_step), "periods_per_year": found.periods_per_year}
            whole = {"history": found.series[0], **_given(terms), **_given(problem)}
        else:
            whole, found = await self._of_assets(returns, kind, choices, rate_per_step, assets, problem)
        question = _given({"problem": whole, "record_of": record_of, "seed": seed})
        return _having_read(cast(Sleeve, await self._transport.json("POST", "/sleeve", body=question)), found)

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
        """Returns what to hold of each of several assets through one period. Nothing is trained or stored.

        ``returns`` has a column for each asset: a DataFrame, a text or the ``Path`` of a file, or rows of numbers with
        ``assets``. By default the assets are all columns that hold neither dates nor the rates of the bank. ``assets``
        selects some of them. ``kind``, ``choices`` and ``rate_per_step`` are as in ``train``. The rates of the bank may
        be in a column that ``assets`` does not name. Every other field of the problem can be given by name, such as
        ``ground_norm``, ``risk_aversion``, ``caution``, ``radius``, ``support`` or ``trading_cost``. ``holdings`` is
        the share of wealth that is already in each asset, by its name.
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

        ``returns``, ``kind``, ``choices``, ``assets`` and ``rate_per_step`` are as in ``advise_assets``. Every other
        field of the problem can be given by name, also ``horizon``, ``trading_cost``, ``contributions`` and
        ``composition``. The remaining arguments are as in ``train``.
        """
        of_assets, found = await self._of_assets(returns, kind, choices, rate_per_step, assets, problem)
        whole = {"problem": of_assets, "design": design, "surrogate": surrogate, "seed": seed}
        request = {**_given(whole), **relabelled(name, notes, tags)}
        return _having_read(await self._queued("/train", request, idempotency_key), found)

    async def _one(self, returns: Returns, kind: Kind | None, choices: wire.Choices | None) -> Read:
        """Reads the returns of one asset."""
        found = await read(self._transport, returns, kind, choices)
        if len(found.series) != 1:
            raise ValueError("returns has several columns: must have one (train_assets and advise_assets take several)")
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
        """Returns the problem of several assets, and the returns that were read for it."""
        names, found = await read_assets(self._transport, returns, kind, choices, assets)
        terms = {"rate_per_step": _last_rate(found, rate_per_step), "periods_per_year": found.periods_per_year}
        return {"assets": names, "history": found.rows, **_given(terms), **_given(problem)}, found

    async def _read_returns(self, source: str | os.PathLike[str] | Table, /, **choices: Any) -> wire.Reading:
        """Reads returns or prices. The result is one record, a list of questions, or the place of a mistake.

        ``source`` is a text, the ``Path`` of a file, a table of pandas, polars or pyarrow, an array or a list.
        ``choices`` answer the questions or add what the source does not show: ``unit="percent"``, ``columns=["fund"]``
        (several columns are several assets). Look at ``reading["outcome"]``: ``"read"`` comes with the ``series`` and
        with a ``sentence`` to check them by.
        """
        return await reading_of(self._transport, source, None, cast(wire.Choices, choices), "source")

    async def _submit(
        self,
        specification: wire.Specification | wire.DeclaredSpecification,
        *,
        name: str | None = None,
        notes: str | None = None,
        tags: Sequence[str] | None = None,
        idempotency_key: str | None = None,
    ) -> wire.Job:
        """Queues the training of a whole specification, such as the one in ``Policy.detail``, or of a problem declared
        in formulas (``docs/declared.md``), whose policy answers ``Policy.decide``. ``name``, ``notes`` and ``tags``
        label the policy as in ``train``."""
        request = {**specification, **relabelled(name, notes, tags)}
        return await self._queued("/train", request, idempotency_key)

    async def _job(self, job: str) -> wire.Job:
        """Returns a training, an evaluation, a walk-forward or a frontier that was queued before."""
        return cast(wire.Job, await self._transport.json("GET", f"/jobs/{quote(job, safe='')}"))

    async def _evaluate(self, request: wire.EvaluationRequest, *, idempotency_key: str | None = None) -> wire.Job:
        """Queues a comparison of strategies on common simulated returns, and does not wait for it."""
        return await self._queued("/evaluate", request, idempotency_key)

    async def _compare(
        self,
        policies: Mapping[str, str | Policy | AsyncPolicy] | None = None,
        *,
        specification: wire.DeclaredSpecification | None = None,
        frameworks: Sequence[wire.Framework] | None = None,
        rules: Mapping[str, Mapping[str, str]] | None = None,
        paths: int | None = None,
        seed: int | None = None,
        level: float | None = None,
        idempotency_key: str | None = None,
    ) -> wire.Job:
        """Queues a comparison of policies of one declared problem, and of rules, on noises drawn from its record.

        ``policies`` are policies or their names, each under a name of your own. Of ``specification``, as ``submit``
        takes it, a policy is trained for each of the ``frameworks``. ``rules`` have a formula for each action, as in
        ``{"base stock": {"order": "max(25 - stock, 0)"}}``. Does not wait for the comparison.
        """
        named = {name: policy if isinstance(policy, str) else policy.id for name, policy in (policies or {}).items()}
        request = {
            **(specification or {}),
            "policies": named or None,
            "frameworks": None if frameworks is None else list(frameworks),
            "rules": _ruled(rules),
            "paths": paths,
            "level": level,
        }
        if seed is not None:
            request["seed"] = seed
        return await self._queued("/evaluate", _given(request), idempotency_key)

    async def _backtest_declared(
        self,
        specification: wire.DeclaredSpecification,
        *,
        window: int | None = None,
        every: int | None = None,
        frameworks: Sequence[wire.Framework] | None = None,
        rules: Mapping[str, Mapping[str, str]] | None = None,
        level: float | None = None,
        idempotency_key: str | None = None,
    ) -> wire.Job:
        """Queues a walk-forward of a declared problem through its own record, and does not wait for it.

        ``specification`` is as ``submit`` takes it; its ``history`` is the whole record. Every ``every`` periods a
        policy is trained on the ``window`` noises before, for each of the ``frameworks``. ``rules`` are as in
        ``compare``.
        """
        request = {
            **specification,
            "window": window,
            "every": every,
            "frameworks": None if frameworks is None else list(frameworks),
            "rules": _ruled(rules),
            "level": level,
        }
        return await self._queued("/backtest", _given(request), idempotency_key)

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
        weights: Mapping[str, str | Iterable[float]] | None = None,
        count: int | None = None,
        seed: int | None = None,
        idempotency_key: str | None = None,
    ) -> wire.Job:
        """Queues a walk-forward through a record of returns, as ``ballast backtest`` does, and does not wait for it.

        ``returns``, ``kind`` and ``choices`` are as in ``train``. ``rate`` is what the bank paid: one fraction for all
        periods or one for each. By default it is the column of rates in ``returns``. ``dates`` are texts or dates, one
        for each number, by default those of the index of a pandas object. They show how many periods make a year;
        without dates, give ``periods_per_year``. ``weights`` has strategies of your own by name, each with its share of
        wealth in every period of the record, or a formula for it over the returns before, such as
        ``"if(mean12 > bank, 1, 0)"``; shares of the first window are not used. The service chooses what you leave
        out, and the report shows what it chose. Raises ``ValueError`` before anything is queued if ``returns``,
        ``rate`` or ``dates`` cannot be correct.
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
            "weights": None if weights is None else {name: _own(own, float) for name, own in weights.items()},
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
        strategies: Sequence[wire.StrategyFamily] | None = None,
        windows: Sequence[int | None] | None = None,
        every: int | None = None,
        horizon: int | None = None,
        count: int | None = None,
        alpha: float | None = None,
        support: wire.Support | None = None,
        risk_aversion: float | None = None,
        trading_cost: float | None = None,
        weights: Mapping[str, str | Iterable[Iterable[float]]] | None = None,
        seed: int | None = None,
        idempotency_key: str | None = None,
    ) -> wire.Job:
        """Queues a walk-forward through a table of several assets, as ``ballast backtest`` does, and does not wait for
        it.

        ``returns``, ``kind``, ``choices`` and ``assets`` are as in ``advise_assets``. ``rate`` and ``dates`` are as in
        ``backtest``, but dates are required. ``strategies`` has ``"policy"``, the trained policy that a session
        follows, ``"one_step"``, the one-step rule, or both; ``horizon`` and ``count`` are those of a policy.
        ``windows`` says how many of the last periods each strategy learns from, with ``None`` for all. ``weights`` are
        as in ``backtest``, with the share of each asset in every period. The service chooses what you leave out, and
        the report shows what it chose. Raises ``ValueError`` before anything is queued if ``returns``, ``rate`` or
        ``dates`` cannot be correct.
        """
        names, found = await read_assets(self._transport, returns, kind, choices, assets)
        beside = _beside(found, returns, rate, dates)
        if beside["dates"] is None:
            raise ValueError("dates is None: must be given because returns have no dates")
        request = {
            "assets": names,
            "log_returns": found.rows,
            **beside,
            "periods_per_year": periods_per_year,
            "strategies": None if strategies is None else list(strategies),
            "windows": None if windows is None else list(windows),
            "every": every,
            "horizon": horizon,
            "count": count,
            "alpha": alpha,
            "support": support,
            "risk_aversion": risk_aversion,
            "trading_cost": trading_cost,
            "weights": None if weights is None else {name: _own(own, list) for name, own in weights.items()},
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
        """Queues the frontier of caution: what each multiple of the radius loses on records like this one.

        ``returns`` are of one asset as in ``advise``, or, with more than one column, of several as in
        ``advise_assets``. Every other field of the problem can be given by name, such as ``risk_aversion`` or
        ``radius``.
        """
        if assets is None and len(getattr(returns, "columns", ())) < 2:
            found = await self._one(returns, kind, choices)
            terms = {"rate_per_step": _last_rate(found, rate_per_step), "periods_per_year": found.periods_per_year}
            whole = {"history": found.series[0], **_given(terms), **_given(problem)}
        else:
            whole, found = await self._of_assets(returns, kind, choices, rate_per_step, assets, problem)
            if len(whole["assets"]) == 1:
                # One of the two columns held dates or the rates of the bank.
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
        """Stores an exported policy. A policy that the service already has does not change."""
        imported: wire.Imported = await self._transport.json("POST", "/policies/import", body=document)
        return imported["policy"]

    async def _import_session(self, document: bytes) -> wire.Session:
        """Stores an exported session, whose policies must be imported before. The service must not have it."""
        return cast(wire.Session, await self._transport.json("POST", "/sessions/import", body=document))

    async def _session(self, session: str) -> wire.Session:
        """Returns a session that was opened before, at its current period."""
        return cast(wire.Session, await self._transport.json("GET", f"/sessions/{quote(session, safe='')}"))

    async def _observe(self, reports: Iterable[wire.Observe]) -> list[wire.ElementAnswered]:
        """Reports one period of each of many sessions, and returns one answer for each report, in the same order.

        A report is what :meth:`Session.observe <ballast.Session.observe>` sends: ``session``, ``period`` and what
        happened in the period. The service accepts or refuses each report separately. ``status`` is 200 with an
        ``answer``; any other status comes with a ``problem``, for which ``Session.observe`` would raise. One request
        carries a thousand reports. The client retries lost requests and reports that are refused temporarily. The same
        reports again get the same answers. Call ``refresh`` on objects of these sessions to update them.
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
        """Iterates over all jobs, newest first."""
        return self._listed("/jobs", "jobs")

    def _policies(self) -> AsyncIterator[wire.PolicyEntry]:
        """Iterates over all policies, newest first."""
        return self._listed("/policies", "policies")

    def _sessions(
        self,
        *,
        search: str | None = None,
        tag: str | None = None,
        state: Literal["active", "waiting", "completed"] | None = None,
        sort: SessionSort | None = None,
    ) -> AsyncIterator[wire.SessionEntry]:
        """Iterates over all sessions, or those that match, with their labels and state; newest first by default.

        ``search`` matches words, ignoring case. Each word must be the beginning of a word in the name or the tags of
        the session or its policy, or at least the first eight digits of an identifier. ``tag`` selects the sessions
        that have this tag. :func:`ballast.frames.sessions` makes a table of them.
        """
        return self._listed("/sessions", "sessions", search=search, tag=tag, state=state, sort=sort)

    def _audit(self, *, tenant: str | None = None, object: str | None = None) -> AsyncIterator[wire.AuditEntry]:
        """Lists who did what, newest first, by default for all tenants and objects. Needs the role ``admin``."""
        return self._listed("/audit", "entries", tenant=tenant, object=object)

    async def _subscribe(
        self,
        url: str,
        events: Sequence[wire.EventKind],
        *,
        sessions: Sequence[str] | None = None,
        least_change: float | None = None,
        idempotency_key: str | None = None,
    ) -> wire.Subscribed:
        """Has the events of these kinds sent to ``url`` by signed webhooks, or to ``mailto:`` and an address by e-mail.

        Returns the name and the secret.

        ``sessions`` limits the events about sessions to these; ``least_change`` is the change of the advice that is an
        event. The headers and the signature are those of Standard Webhooks.
        """
        request = _given({"url": url, "events": list(events), "sessions": sessions, "least_change": least_change})
        headers = idempotent(idempotency_key)
        made = await self._transport.json("POST", "/subscriptions", body=request, headers=headers)
        return cast(wire.Subscribed, made)

    async def _subscriptions(self) -> list[wire.SubscriptionState]:
        """Lists the subscriptions, with what waits, what failed and the newest dead letters."""
        listed: wire.SubscriptionList = await self._transport.json("GET", "/subscriptions")
        return listed["subscriptions"]

    async def _rotate_secret(self, subscription: str, *, idempotency_key: str | None = None) -> wire.RotatedSecret:
        """Replaces the secret of a subscription. For a day both secrets sign."""
        path, headers = f"/subscriptions/{quote(subscription, safe='')}/secret", idempotent(idempotency_key)
        return cast(wire.RotatedSecret, await self._transport.json("POST", path, headers=headers))

    async def _resend(self, subscription: str) -> int:
        """Sends the dead letters of a subscription again. Returns how many."""
        resent = await self._transport.json("POST", f"/subscriptions/{quote(subscription, safe='')}/resend")
        return cast(wire.Resent, resent)["queued"]

    async def _unsubscribe(self, subscription: str) -> None:
        """Deletes a subscription and what is still to be sent to it."""
        await self._transport.call("DELETE", f"/subscriptions/{quote(subscription, safe='')}")

    async def _calendar(self) -> str:
        """Returns the days on which the reports of active sessions are due, as an iCalendar file (RFC 5545)."""
        return (await self._transport.call("GET", "/reports.ics")).text

    async def _health(self) -> wire.Health:
        """Returns the state of the service. Raises :class:`Overloaded` while it is shutting down."""
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

    ``key`` is sent with every request; by default it is ``BALLAST_KEY`` of the environment.
    ``timeout`` bounds each wait for the network, in seconds. If a request is lost or refused temporarily, the client
    retries it up to ``retries`` times, after 0.2 s, 0.4 s and so on (``ballast.transport`` says which requests, and why
    that is safe). ``headers`` are sent with every request, and ``transport`` replaces the connections themselves
    (proxies, certificates). You can share one object between threads. As a context manager it closes its connections
    at the end.
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
    compare = blocking_into(_Ballast._compare, Comparison)
    comparison = blocking_into(_Ballast._job, Comparison)
    backtest = blocking_into(_Ballast._backtest, WalkForward)
    walk_forward = blocking_into(_Ballast._job, WalkForward)
    backtest_assets = blocking_into(_Ballast._backtest_assets, AssetsWalkForward)
    assets_walk_forward = blocking_into(_Ballast._job, AssetsWalkForward)
    backtest_declared = blocking_into(_Ballast._backtest_declared, DeclaredWalkForward)
    declared_walk_forward = blocking_into(_Ballast._job, DeclaredWalkForward)
    frontier = blocking_into(_Ballast._frontier, Frontier)
    frontier_of = blocking_into(_Ballast._job, Frontier)
    import_policy = blocking_into(_Ballast._import_policy, Policy)
    import_session = blocking_into(_Ballast._import_session, Session)
    session = blocking_into(_Ballast._session, Session)
    advise = Answering(Advised).blocking(_Ballast._advise)
    plan = Answering(Plan).blocking(_Ballast._plan)
    sleeve = Answering(Sleeve).blocking(_Ballast._sleeve)
    advise_assets = Answering(AssetsAdvised).blocking(_Ballast._advise_assets)
    read_returns = blocking(_Ballast._read_returns)
    observe = blocking(_Ballast._observe)
    subscribe = blocking(_Ballast._subscribe)
    subscriptions = blocking(_Ballast._subscriptions)
    rotate_secret = blocking(_Ballast._rotate_secret)
    resend = blocking(_Ballast._resend)
    unsubscribe = blocking(_Ballast._unsubscribe)
    calendar = blocking(_Ballast._calendar)
    health = Answering(wire.Health).blocking(_Ballast._health)
    close = blocking(_Ballast._close)
    jobs = Answering(wire.Job).iterating(_Ballast._jobs)
    policies = Answering(wire.PolicyEntry).iterating(_Ballast._policies)
    sessions = Answering(wire.SessionEntry).iterating(_Ballast._sessions)
    audit = Answering(wire.AuditEntry).iterating(_Ballast._audit)

    def policy(self, policy: str) -> Policy:
        """Returns a policy by its name, without a request to the service."""
        return Policy(self._transport, policy)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()


class AsyncBallast(_Ballast):
    """A :class:`Ballast` for asyncio, with the same names, arguments, answers and errors.

    Use ``async for`` with ``jobs()``, ``policies()``, ``sessions()``, ``audit()`` and ``events()``. ``async with``
    closes the connections at the end. The calls of the objects it returns (:class:`AsyncTraining`,
    :class:`AsyncSession`) are awaited too. Use one object in one event loop only. The arguments are those of
    :class:`Ballast`, except that ``transport`` is an asynchronous one.
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
    compare = awaiting_into(_Ballast._compare, AsyncComparison)
    comparison = awaiting_into(_Ballast._job, AsyncComparison)
    backtest = awaiting_into(_Ballast._backtest, AsyncWalkForward)
    walk_forward = awaiting_into(_Ballast._job, AsyncWalkForward)
    backtest_assets = awaiting_into(_Ballast._backtest_assets, AsyncAssetsWalkForward)
    assets_walk_forward = awaiting_into(_Ballast._job, AsyncAssetsWalkForward)
    backtest_declared = awaiting_into(_Ballast._backtest_declared, AsyncDeclaredWalkForward)
    declared_walk_forward = awaiting_into(_Ballast._job, AsyncDeclaredWalkForward)
    frontier = awaiting_into(_Ballast._frontier, AsyncFrontier)
    frontier_of = awaiting_into(_Ballast._job, AsyncFrontier)
    import_policy = awaiting_into(_Ballast._import_policy, AsyncPolicy)
    import_session = awaiting_into(_Ballast._import_session, AsyncSession)
    session = awaiting_into(_Ballast._session, AsyncSession)
    advise = _Ballast._advise
    plan = _Ballast._plan
    sleeve = _Ballast._sleeve
    advise_assets = _Ballast._advise_assets
    read_returns = _Ballast._read_returns
    observe = _Ballast._observe
    subscribe = _Ballast._subscribe
    subscriptions = _Ballast._subscriptions
    rotate_secret = _Ballast._rotate_secret
    resend = _Ballast._resend
    unsubscribe = _Ballast._unsubscribe
    calendar = _Ballast._calendar
    health = _Ballast._health
    close = _Ballast._close
    jobs = _Ballast._jobs
    policies = _Ballast._policies
    sessions = _Ballast._sessions
    audit = _Ballast._audit

    def policy(self, policy: str) -> AsyncPolicy:
        """Returns a policy by its name, without a request to the service."""
        return AsyncPolicy(self._transport, policy)

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        await self.close()


#: Entries requested at a time.
_PAGE = 200
#: Reports sent at a time.
_REPORTS = 1000
#: The pause before the elements of a list that were refused temporarily are retried. Rate limits are per second.
_SECOND = 1.0


def _last_rate(found: Read, rate_per_step: float | None) -> float:
    if rate_per_step is not None:
        return rate_per_step
    if not found.rates:
        raise ValueError("rate_per_step is missing: must be given because returns have no rates of the bank")
    return found.rates[-1]


def _beside(
    found: Read, returns: Returns, rate: float | Sequence[float] | None, dates: Iterable[object] | None
) -> dict[str, Any]:
    """Returns the rates of the bank and the dates of the periods: those given, or else those that were read.

    Raises ``ValueError``, which names the argument and the rule.
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
        raise ValueError("rate is missing: must be given because returns have no rates of the bank")
    return {"rate": rate, "dates": days}


def _having_read(answer: T, found: Read) -> T:
    """Returns the answer with the sentence that says how the returns were read."""
    return cast(T, {**cast(Mapping[str, Any], answer), "read": found.sentence})


def _amounts(contributions: float | Sequence[float] | None) -> float | list[float] | None:
    return list(contributions) if isinstance(contributions, Sequence) else contributions


def _given(fields: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in fields.items() if value is not None}


def _own(shares: str | Iterable[Any], each: Callable[[Any], Any]) -> str | list[Any]:
    """Returns a formula as it is, and the shares of a strategy as a list."""
    return shares if isinstance(shares, str) else [each(share) for share in shares]


def _ruled(rules: Mapping[str, Mapping[str, str]] | None) -> dict[str, dict[str, str]] | None:
    return None if rules is None else {name: dict(rule) for name, rule in rules.items()}


def _headers(key: str | None, more: Mapping[str, str] | None) -> dict[str, str]:
    """Returns the headers of every request: the key, by default from the environment, and ``more``."""
    key = os.environ.get("BALLAST_KEY") if key is None else key
    return {**({"authorization": f"Bearer {key}"} if key else {}), **(more or {})}
