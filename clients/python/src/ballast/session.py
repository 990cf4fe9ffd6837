"""Sessions: one investor or one declared problem each, which is advised and reports what happened."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping
from datetime import datetime, timezone
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, cast
from urllib.parse import quote

from typing_extensions import Self, Unpack

from . import frames, plots, replay, wire
from .driving import Answering, blocking
from .errors import JobEnded, ReportConflict
from .labels import Labelled
from .returns import Kind, LogReturns, Returns
from .sheet import Table
from .transport import Transport, growing_pause

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

#: The entries that a session numbers.
_Counted: TypeAlias = Literal["period", "correction", "renewal"]
#: For each, the list of the history, the field with the time, and the verb for a message.
_MADE: dict[_Counted, tuple[str, str, str]] = {
    "period": ("observations", "observed_ms", "observed"),
    "correction": ("corrections", "corrected_ms", "made"),
    "renewal": ("renewals", "renewed_ms", "made"),
}
#: Longest pause between two requests for the state of a renewal that is due, in seconds.
_LOOK = 0.5


class _Session(Labelled):
    """A session of the service and its current period.

    ``observe`` numbers its reports, so each counts exactly once. If an answer is lost, the client sends the report
    again under the same number, and the service returns its first answer. If ``observe`` raises :class:`Unreachable`,
    this object keeps the old period: call it again with the same arguments. One object is for one investor and one
    thread. If another client or the service itself has reported or renewed, ``refresh`` updates this object.
    """

    def __init__(self, transport: Transport, session: wire.Session) -> None:
        self._transport = transport
        self._path = f"/sessions/{quote(session['session'], safe='')}"
        self.id = session["session"]
        self.policy = session["policy"]
        self.horizon = session["horizon"]
        #: The coming period, from 1; ``horizon + 1`` once completed.
        self.period = session["period"]
        #: ``waiting`` while its next policy is trained. Until then it keeps its policy, even past the horizon.
        self.state: wire.SessionStatus = session["state"]
        #: Wealth of an investor; NaN if the session is of a declared problem.
        self.wealth = _amount(session["wealth"])
        #: Share of wealth in the risky asset, before trading; NaN if the session is of a declared problem.
        self.holding = _amount(session["holding"])
        #: States of a declared problem before the coming period, by name; ``None`` for an investor.
        self.states = session.get("states")
        #: Rewards of a declared problem since the start, discounted to it; ``None`` for an investor.
        self.earned = session.get("earned")
        #: The number of renewals, each by another policy.
        self.renewals = session["renewals"]
        #: The number of corrections of past periods.
        self.corrections = session["corrections"]
        #: Says how ``history`` was read; ``None`` if it was that of the policy, and for a session that was looked up.
        self.read: str | None = cast(dict[str, Any], session).get("read")
        #: The answer to the last ``observe``: wealth, sample size, moments, quantile, radius.
        self.observed: wire.Observed | None = None
        #: The answer to the last ``observe`` of a declared problem.
        self.moved: wire.DeclaredObserved | None = None

    @property
    def completed(self) -> bool:
        """Whether the session has reached its horizon and gets no further policy."""
        return self.state == "completed"

    async def _action(
        self,
        *,
        mode: Literal["surrogate", "resolve"] | None = None,
        explain: Literal["worst_case"] | None = None,
        sensitivity: bool | None = None,
    ) -> wire.AssetAction:
        """Returns the robust allocation for the coming period.

        ``mode="resolve"`` solves the robust step again at the exact state. ``explain="worst_case"`` does so too, and
        returns the worst law. ``sensitivity=True`` shows how close the allocation is to changing. Raises
        :class:`SessionCompleted` after the horizon. While a session waits for its next policy, the last step of its
        current policy gives the advice, and ``caution`` in the answer says so.
        """
        params = {"session": self.id, "mode": mode, "explain": explain, "sensitivity": "true" if sensitivity else None}
        return cast(wire.AssetAction, await self._transport.json("GET", "/action", params=params))

    async def _assets_action(
        self, *, mode: Literal["surrogate", "resolve"] | None = None, explain: Literal["worst_case"] | None = None
    ) -> wire.AssetsAction:
        """Returns the robust allocation of a session of several assets, by name.
        :func:`ballast.frames.allocation` makes a Series of it."""
        params = {"session": self.id, "mode": mode, "explain": explain}
        return cast(wire.AssetsAction, await self._transport.json("GET", "/action", params=params))

    async def _actions(self) -> wire.DeclaredAdvice:
        """Returns the robust actions of a declared problem for the coming period, with the worst law that they are best
        against. Raises :class:`SessionCompleted` after the horizon."""
        return cast(wire.DeclaredAdvice, await self._transport.json("GET", "/action", params={"session": self.id}))

    async def _observe(
        self, *, period: int | None = None, confirm: bool = False, **report: Unpack[wire.Report]
    ) -> Self:
        """Reports the coming period: its return in exactly one of three ways, or ``missing=True``. ``observed`` has
        the answer.

        :class:`wire.Report <ballast.wire.Report>` lists all fields. ``executed_allocation`` is the share that was
        really held, by default the advised one. ``rate`` is what the bank paid and ``flow`` what was added, by default
        those of the policy. ``wealth`` is the wealth really reached, and ``date`` is the last day. For several assets
        ``log_returns``, ``simple_returns``, ``prices`` and ``executed_allocations`` are a dict or a Series by the names
        of the assets. A return or price that is ``None`` or NaN did not come in the period. A declared problem has
        ``noise`` instead of a return, ``executed`` for its actions by name, by default the advised ones, and ``state``
        for the states after the period, by default those of its formulas; ``moved`` has the answer. ``period`` is by
        default the coming one. An earlier period with the content first reported for it gets its first answer again.
        Raises :class:`Unconfirmed` for a report that is probably a mistake, unless ``confirm`` is true, and
        :class:`ReportConflict`, :class:`ReportGap` and :class:`SessionCompleted`.
        """
        number = self.period if period is None else period
        body: wire.Observe = {"session": self.id, "period": number, "confirm": confirm, **_by_name(report)}
        answer: dict[str, Any] = await self._counted("/observe", body, "period" if period is None else None, number)
        if "earned" in answer:
            self.moved = cast(wire.DeclaredObserved, answer)
        else:
            self.observed = cast(wire.Observed, answer)
        if answer["period"] >= self.period:
            self.period = answer["period"] + 1
            self._stand(answer)
            self.state = "completed" if answer["completed"] else self.state
        return self

    def _stand(self, answer: Mapping[str, Any]) -> None:
        """Takes over wealth and holding, or the states of a declared problem, from the answer to an entry."""
        if "earned" in answer:
            self.states, self.earned = answer["state"], answer["earned"]
        else:
            self.wealth, self.holding = answer["wealth"], answer["holding"]

    async def _replay(
        self,
        returns: Returns,
        *,
        kind: Kind,
        period: int = 1,
        dates: Iterable[object] | None = None,
        rate: replay.Numbers | None = None,
        flow: replay.Numbers | None = None,
        executed_allocation: replay.Numbers | Table | None = None,
    ) -> pd.DataFrame:
        """Reports a record period by period, from ``period`` on. Returns a table with a row for each period: what was
        advised, and the wealth that followed.

        ``returns`` are fractions or prices, oldest first, and ``kind`` says which. For several assets they are a table
        with a column for each, or rows in the order of the assets, and so is ``executed_allocation``. ``dates`` are the
        last days of the periods, by default those of the index of a pandas object. ``rate``, ``flow`` and, for one
        asset, ``executed_allocation`` are as in :meth:`observe`: one number for all periods, or one for each entry of
        ``returns``. ``dates`` also has one for each entry.

        The service accepts these reports without asking for confirmation. Each carries the number of its period, so
        the same call again, for example after :class:`Unreachable`, reports nothing twice and returns the same table.
        To continue at the current period, give ``period=session.period``. If the session renews itself, the call waits
        for each renewal that is due, so the advice does not depend on how long trainings take.

        The rows have the index of ``returns`` if it is a pandas object, and otherwise the periods. The columns are
        those of :func:`ballast.frames.history` with ``as_of="then"``. Raises ``ValueError`` if an argument breaks a
        rule and ``ImportError`` without pandas, both before anything is sent; :class:`JobEnded` if the training of a
        renewal fails; and what :meth:`observe` raises.
        """
        frames.require_pandas()
        assets = (await self._history()).get("assets") if replay.has_columns(returns) else None
        reports = replay.reports(returns, kind, dates, rate, flow, executed_allocation, assets)
        renewing = (await self._read()).get("renew") is not None
        for number, report in enumerate(reports, start=period):
            if renewing:
                await self._await_renewal()
            await self._observe(period=number, confirm=True, **report)
        return replay.replayed_rows(await self._history(), period, returns, kind, len(reports))

    async def _await_renewal(self) -> None:
        """Waits until no renewal is due. The service checks its renewals twice a second."""
        for attempt in itertools.count():
            due = (await self._read()).get("renewal")
            if due is None:
                return
            job = due.get("job")
            if due["state"] == "failed" and job is not None:
                raise JobEnded(await self._transport.json("GET", f"/jobs/{quote(job, safe='')}"))
            await self._transport.pause(min(growing_pause(attempt), _LOOK))

    async def _correct(
        self,
        period: int,
        reason: str,
        *,
        correction: int | None = None,
        change: wire.Change = "replace",
        confirm: bool = False,
        **report: Unpack[wire.Report],
    ) -> wire.Corrected:
        """Corrects the report of a past period. The new report replaces the whole old one.

        With ``change="insert"`` the report adds a period that was skipped before this one. With ``change="remove"``,
        which takes no report, the period is removed. The history keeps the old reports and answers, and all further
        advice uses the correction. Like :meth:`observe`, a correction counts exactly once. ``correction`` is its
        number, by default the one after the last. If an answer is lost, the correction is sent again under the same
        number. The answer for a declared problem is a :class:`wire.DeclaredCorrected <ballast.wire.DeclaredCorrected>`.
        """
        number = self.corrections + 1 if correction is None else correction
        body: wire.Correct = {
            "correction": number,
            "period": period,
            "reason": reason,
            "change": change,
            "confirm": confirm,
            **_by_name(report),
        }
        counted: _Counted | None = "correction" if correction is None else None
        corrected: wire.Corrected = await self._counted(f"{self._path}/corrections", body, counted, number)
        if number > self.corrections:
            self.corrections, self.period = number, corrected["observed"] + 1
            self._stand(corrected)
        return corrected

    async def _renew(
        self,
        policy: str,
        *,
        window: int | None = None,
        records: Mapping[str, Iterable[float | None]] | None = None,
        leaving: Iterable[str] = (),
        renewal: int | None = None,
    ) -> wire.Renewed:
        """Switches to another policy from the coming period on.

        The new law is that of the last ``window`` observed returns, by default of all. If the policy has other assets,
        ``records`` has the log-returns of each that enters, by name: the last one is that of the last observed period,
        and ``None`` or NaN stands for a period without one. ``leaving`` names those that leave. Like :meth:`observe`, a
        renewal counts exactly once. ``renewal`` is its number, by default the one after the last.

        A session of a declared problem begins the law anew with the policy's own history, and gets a
        :class:`wire.DeclaredRenewed <ballast.wire.DeclaredRenewed>`.
        """
        number = self.renewals + 1 if renewal is None else renewal
        body: wire.Renew = {"renewal": number, "policy": policy, "window": window}
        if records:
            body["records"] = {name: [_number(value) for value in record] for name, record in records.items()}
        if leaving := list(leaving):
            body["leaving"] = leaving
        counted: _Counted | None = "renewal" if renewal is None else None
        renewed: wire.Renewed = await self._counted(f"{self._path}/renewals", body, counted, number)
        if number > self.renewals:
            self.renewals, self.policy, self.horizon = number, renewed["policy"], renewed["horizon"]
            self.period, self.state = renewed["period"], "active"
        return renewed

    async def _counted(
        self, path: str, body: wire.Observe | wire.Correct | wire.Renew, counted: _Counted | None, number: int
    ) -> Any:
        """Sends an entry that has a number.

        If this object ``counted`` the number and another client has used it in the meantime, the refusal says so and
        when that was.
        """
        try:
            return await self._transport.json("POST", path, body=body)
        except ReportConflict as conflict:
            made = None if counted is None else await self._made(counted, number)
            if made is None:
                raise
            detail = f"{counted} {number} was {made}, which this object has not seen: call refresh()"
            problem = cast(wire.ProblemDocument, {**conflict.args[0], "detail": detail})
            raise ReportConflict(problem, conflict.retry_after) from conflict

    async def _made(self, counted: _Counted, number: int) -> str | None:
        """Says when an entry of the session was made, and for a renewal whether the service makes them by itself."""
        history, (name, moment, verb) = await self._history(), _MADE[counted]
        for entry in cast(dict[str, list[dict[str, Any]]], history)[name]:
            if entry[counted] == number:
                at = datetime.fromtimestamp(entry[moment] / 1000.0, timezone.utc)
                renew = (await self._transport.json("GET", self._path)).get("renew") if counted == "renewal" else None
                by = "" if renew is None else f" (the service renews the session every {renew['every']} periods)"
                return f"{verb} at {at:%Y-%m-%d %H:%M:%S} UTC{by}"
        return None

    async def _what_if(
        self,
        *,
        wealth: float | None = None,
        holding: float | None = None,
        radius_scale: float | None = None,
        radius: float | None = None,
        log_return: float | None = None,
        simple_return: float | None = None,
        state: Mapping[str, float] | None = None,
        noise: float | None = None,
        explain: Literal["worst_case"] | None = None,
        sweep: wire.Sweep | None = None,
    ) -> wire.WhatIfAnswer:
        """Returns the advice for a hypothetical wealth, holding, radius or next return, or for a ``sweep`` of one of
        them. For a declared problem these are ``state``, ``radius_scale`` and ``noise``. The session does not change.
        """
        scenario: wire.WhatIf = {
            "session": self.id,
            "wealth": wealth,
            "holding": holding,
            "radius_scale": radius_scale,
            "radius": radius,
            "log_return": log_return,
            "simple_return": simple_return,
            "noise": noise,
            "explain": explain,
            "sweep": sweep,
        }
        if state is not None:
            scenario["state"] = dict(state)
        return cast(wire.WhatIfAnswer, await self._transport.json("POST", "/what-if", body=scenario))

    async def _orders(
        self,
        prices: Mapping[str, float],
        units: Mapping[str, float],
        cash: float,
        *,
        lots: Mapping[str, float] | None = None,
        smallest: float = 0.0,
        buys_only: bool = False,
        trading_cost: float = 0.0,
    ) -> wire.OrdersAnswer:
        """Returns the orders, in whole lots, that bring ``units`` and ``cash`` to the advice for the coming period.

        ``prices``, ``units`` and ``lots`` are by name; the name of a single asset is ``"asset"``. A lot is 1 unit
        unless given. The session does not change.
        """
        question: wire.OrdersQuestion = {
            "session": self.id,
            "prices": dict(prices),
            "units": dict(units),
            "cash": cash,
            "smallest": smallest,
            "buys_only": buys_only,
            "trading_cost": trading_cost,
        }
        if lots is not None:
            question["lots"] = dict(lots)
        return cast(wire.OrdersAnswer, await self._transport.json("POST", "/orders", body=question))

    async def _assets_what_if(
        self,
        *,
        wealth: float | None = None,
        holdings: Mapping[str, float] | pd.Series[float] | None = None,
        radius_scale: float | None = None,
        radius: float | None = None,
        log_returns: Mapping[str, float] | pd.Series[float] | None = None,
        simple_returns: Mapping[str, float] | pd.Series[float] | None = None,
        prices: Mapping[str, float] | pd.Series[float] | None = None,
        previous_prices: Mapping[str, float] | pd.Series[float] | None = None,
        explain: Literal["worst_case"] | None = None,
    ) -> wire.AssetsWhatIfPoint:
        """Returns the advice for hypothetical holdings or next returns of a session of several assets.

        Holdings and returns are a dict or a Series by the names of the assets. The answer is the one that ``observe``
        and then ``assets_action`` would give. :func:`ballast.frames.allocation` makes a Series of it. The session does
        not change.
        """
        scenario: dict[str, Any] = {
            "session": self.id,
            "wealth": wealth,
            "holdings": holdings,
            "radius_scale": radius_scale,
            "radius": radius,
            "log_returns": log_returns,
            "simple_returns": simple_returns,
            "prices": prices,
            "previous_prices": previous_prices,
            "explain": explain,
        }
        body = {name: value.to_dict() if hasattr(value, "to_dict") else value for name, value in scenario.items()}
        return cast(wire.AssetsWhatIfPoint, await self._transport.json("POST", "/what-if", body=body))

    async def _futures(self, paths: int | None = None) -> wire.Futures:
        """Plays the session on, from its coming period to the last that its policy decides, as
        :meth:`Policy.futures <ballast.Policy.futures>` plays a policy."""
        return cast(wire.Futures, await self._transport.json("GET", f"{self._path}/futures", params={"paths": paths}))

    async def _letter(self, firm: wire.Firm | None = None, currency: str | None = None) -> str:
        """Returns the letter to the client as one HTML document of one page: what to hold and to trade, how it went,
        and why.

        ``firm`` is the one that writes: ``name``, ``closing``, ``disclaimer`` and ``logo``, a picture as a data URL.
        The service does not keep it. ``currency`` is a code such as ``"EUR"``.
        """
        request: wire.LetterRequest = {"firm": firm, "currency": currency}
        sensitivity = {"sensitivity": "true"}
        return (await self._transport.call("POST", f"{self._path}/letter", body=request, params=sensitivity)).text

    async def _make_link(self, days: int = 31, letter: wire.LetterRequest | None = None) -> wire.MadeLink:
        """Makes a link under which the client reads the present letter without a key for so many ``days``.

        ``letter`` may have a ``firm`` without a logo, a ``currency`` and a ``smallest_trade``. The ``path`` of the
        answer follows the address of the service, and is shown once.
        """
        request: wire.MakeLink = {"days": days, "letter": letter or {}}
        made: wire.MadeLink = await self._transport.json("POST", f"{self._path}/links", body=request)
        return made

    async def _links(self) -> list[wire.LetterLink]:
        """Returns the links to the letter, the oldest first, also those that have expired."""
        listed: wire.LetterLinks = await self._transport.json("GET", f"{self._path}/links")
        return listed["links"]

    async def _delete_link(self, link: str) -> None:
        """Deletes a link, which leads nowhere from then on."""
        await self._transport.call("DELETE", f"/links/{quote(link, safe='')}")

    async def _export(self) -> bytes:
        """Returns the session and all its records as one document, which ``Ballast.import_session`` accepts."""
        return (await self._transport.call("GET", f"{self._path}/export")).content

    async def _history(self) -> wire.History:
        """Returns the start of the session, all reports and answers, and what the answers would be now.

        Pass it to ``Policy.session(history=...)`` to open a session that starts as this one did. The history of a
        declared problem is a :class:`wire.DeclaredHistory <ballast.wire.DeclaredHistory>`."""
        history = cast(wire.History, await self._transport.json("GET", f"{self._path}/history"))
        if self.states is None:
            history["history"] = LogReturns(history["history"])
        return history

    async def _frame(self, as_of: Literal["now", "then"] = "now") -> pd.DataFrame:
        """Returns the history as a DataFrame, with a row for each observed period: dates, returns, what was advised
        and held, and wealth (:func:`ballast.frames.history` names the columns and their units).

        ``as_of="now"`` includes every correction, and ``"then"`` shows what the service answered at the time. The frame
        of a declared problem includes every correction (:func:`ballast.frames.declared_history`). Raises
        ``ImportError`` without pandas.
        """
        history = await self._history()
        if self.states is not None:
            return frames.declared_history(cast(wire.DeclaredHistory, history))
        return frames.history(history, as_of)

    async def _assets_frame(
        self, figure: frames.AssetsFigure = "simple_return", as_of: Literal["now", "then"] = "now"
    ) -> pd.DataFrame:
        """Returns one figure of a session of several assets by period and asset: the returns, or the advised, executed
        or held shares (:func:`ballast.frames.assets_history`, which says what it raises)."""
        return frames.assets_history(await self._history(), figure, as_of)

    async def _worst_case(self) -> pd.DataFrame:
        """Returns the worst law that the advice for the coming period is robust against, as a transport of probability
        (:func:`ballast.frames.worst_case`, which says what it raises)."""
        return frames.worst_case(await self._action(explain="worst_case"))

    async def _plot(self, ax: Axes | None = None) -> Axes:
        """Draws the wealth after each period and the share held through it (:func:`ballast.plots.history`), or the
        states of a declared problem after each period (:func:`ballast.plots.declared_history`). Raises ``ImportError``
        without pandas and matplotlib."""
        history = await self._history()
        if self.states is not None:
            return plots.declared_history(cast(wire.DeclaredHistory, history), ax)
        return plots.history(history, ax)

    async def _refresh(self) -> Self:
        """Updates this object from the service: its period, wealth, holding, state and policy."""
        await self._read()
        return self

    async def _read(self) -> wire.Session:
        session: wire.Session = await self._transport.json("GET", self._path)
        self.renewals, self.policy, self.horizon = session["renewals"], session["policy"], session["horizon"]
        self.corrections = session["corrections"]
        self.period, self.state = session["period"], session["state"]
        self.wealth, self.holding = _amount(session["wealth"]), _amount(session["holding"])
        self.states, self.earned = session.get("states"), session.get("earned")
        return session

    async def _delete(self) -> None:
        """Deletes the session and all its records. Raises :class:`NotFound` if there is no such session."""
        await self._transport.call("DELETE", self._path)

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.id} at period {self.period} of {self.horizon}>"


def _amount(value: float | None) -> float:
    """Returns an amount, NaN if there is none."""
    return math.nan if value is None else value


def _by_name(report: wire.Report) -> wire.Report:
    """Returns the report with dicts instead of Series, and None instead of NaN."""
    plain = {name: value.to_dict() if hasattr(value, "to_dict") else value for name, value in report.items()}
    for name, value in plain.items():
        if isinstance(value, dict):
            plain[name] = {asset: _number(number) for asset, number in value.items()}
    return cast(wire.Report, plain)


def _number(value: Any) -> Any:
    """Returns a number as it is sent: None instead of NaN."""
    return None if isinstance(value, float) and math.isnan(value) else value


class Session(_Session):
    __doc__ = _Session.__doc__

    action = Answering(wire.AssetAction).blocking(_Session._action)
    assets_action = Answering(wire.AssetsAction).blocking(_Session._assets_action)
    actions = Answering(wire.DeclaredAdvice).blocking(_Session._actions)
    observe = blocking(_Session._observe)
    replay = blocking(_Session._replay)
    correct = Answering(wire.Corrected).blocking(_Session._correct)
    renew = Answering(wire.Renewed).blocking(_Session._renew)
    what_if = blocking(_Session._what_if)
    orders = Answering(wire.OrdersAnswer).blocking(_Session._orders)
    futures = Answering(wire.Futures).blocking(_Session._futures)
    assets_what_if = Answering(wire.AssetsWhatIfPoint).blocking(_Session._assets_what_if)
    label = Answering(wire.Labels).blocking(_Session._label)
    letter = blocking(_Session._letter)
    make_link = blocking(_Session._make_link)
    links = blocking(_Session._links)
    delete_link = blocking(_Session._delete_link)
    export = blocking(_Session._export)
    history = Answering(wire.History).blocking(_Session._history)
    frame = blocking(_Session._frame)
    assets_frame = blocking(_Session._assets_frame)
    worst_case = blocking(_Session._worst_case)
    plot = blocking(_Session._plot)
    refresh = blocking(_Session._refresh)
    delete = blocking(_Session._delete)


class AsyncSession(_Session):
    """A :class:`Session` whose calls are awaited."""

    action = _Session._action
    assets_action = _Session._assets_action
    actions = _Session._actions
    observe = _Session._observe
    replay = _Session._replay
    correct = _Session._correct
    renew = _Session._renew
    what_if = _Session._what_if
    orders = _Session._orders
    futures = _Session._futures
    assets_what_if = _Session._assets_what_if
    label = _Session._label
    letter = _Session._letter
    make_link = _Session._make_link
    links = _Session._links
    delete_link = _Session._delete_link
    export = _Session._export
    history = _Session._history
    frame = _Session._frame
    assets_frame = _Session._assets_frame
    worst_case = _Session._worst_case
    plot = _Session._plot
    refresh = _Session._refresh
    delete = _Session._delete
