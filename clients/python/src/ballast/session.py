"""A live investor."""

from __future__ import annotations

import itertools
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

#: What a session counts.
_Counted: TypeAlias = Literal["period", "correction", "renewal"]
#: Where its history has them, the moment they were made, and what was done.
_MADE: dict[_Counted, tuple[str, str, str]] = {
    "period": ("observations", "observed_ms", "observed"),
    "correction": ("corrections", "corrected_ms", "made"),
    "renewal": ("renewals", "renewed_ms", "made"),
}
#: Longest pause between two looks at a renewal that is due, in seconds.
_LOOK = 0.5


class _Session(Labelled):
    """A session of the service, and the period it has come to.

    ``observe`` numbers its reports, which makes them exactly-once: a report whose answer was lost is sent again under
    the same number, and the service answers as it did the first time. Where ``observe`` raises :class:`Unreachable`,
    the period is still the old one here; call it again with the same arguments. One object is one investor's and is not
    meant for several threads; after somebody else has observed or renewed, be it the service, ``refresh`` catches up.
    """

    def __init__(self, transport: Transport, session: wire.Session) -> None:
        self._transport = transport
        self._path = f"/sessions/{quote(session['session'], safe='')}"
        self.id = session["session"]
        self.policy = session["policy"]
        self.horizon = session["horizon"]
        #: The coming period, from 1; ``horizon + 1`` once completed.
        self.period = session["period"]
        #: ``waiting`` while its next policy is trained: until then it goes on by the one it has, past the horizon too.
        self.state: wire.SessionState = session["state"]
        self.wealth = session["wealth"]
        #: Share of it in the risky asset, before trading.
        self.holding = session["holding"]
        #: Policies that followed the first.
        self.renewals = session["renewals"]
        #: Corrections made of what periods reported.
        self.corrections = session["corrections"]
        #: The sentence of what was read as ``history``; ``None`` where that was the policy's own, and for a session
        #: that is found again.
        self.read: str | None = cast(dict[str, Any], session).get("read")
        #: The answer to the last ``observe``: wealth, sample size, moments, quantile, radius.
        self.observed: wire.Observed | None = None

    @property
    def completed(self) -> bool:
        """Whether the horizon is reached, and no policy is to follow."""
        return self.state == "completed"

    async def _action(
        self,
        *,
        mode: Literal["surrogate", "resolve"] | None = None,
        explain: Literal["worst_case"] | None = None,
        sensitivity: bool | None = None,
    ) -> wire.Action:
        """The robust allocation for the coming period.

        ``mode="resolve"`` solves the robust step anew at the exact state; ``explain="worst_case"`` does too, and
        shows the law it is robust against. ``sensitivity=True`` says how near the allocation is to changing. Raises
        :class:`SessionCompleted` after the horizon. A session that waits for its next policy is advised by the last
        step of the one it has, which the answer's ``caution`` says.
        """
        params = {"session": self.id, "mode": mode, "explain": explain, "sensitivity": "true" if sensitivity else None}
        return cast(wire.Action, await self._transport.json("GET", "/action", params=params))

    async def _assets_action(
        self, *, mode: Literal["surrogate", "resolve"] | None = None, explain: Literal["worst_case"] | None = None
    ) -> wire.AssetsAction:
        """The same of a session of several assets: what to hold of each by its name, of which
        :func:`ballast.frames.allocation` makes a Series."""
        params = {"session": self.id, "mode": mode, "explain": explain}
        return cast(wire.AssetsAction, await self._transport.json("GET", "/action", params=params))

    async def _observe(
        self, *, period: int | None = None, confirm: bool = False, **report: Unpack[wire.Report]
    ) -> Self:
        """Reports the coming period: its return in exactly one of three ways, or ``missing=True``; the answer is in
        ``observed``.

        :class:`wire.Report <ballast.wire.Report>` names all that can be said: ``executed_allocation`` is what was
        really held, by default what was advised; ``rate`` what the bank paid, ``flow`` what was added, by default the
        policy's; ``wealth`` what was really reached; ``date`` the last day. Of several assets ``log_returns``,
        ``simple_returns``, ``prices`` and ``executed_allocations`` are a dict or a Series by their names. ``period``
        is the coming one unless given: an earlier one with the content first reported for it gets its first answer
        again. Raises :class:`Unconfirmed` for a report that is most likely a slip, unless ``confirm`` says that it is
        meant, and :class:`ReportConflict`, :class:`ReportGap` and :class:`SessionCompleted`.
        """
        number = self.period if period is None else period
        body: wire.Observe = {"session": self.id, "period": number, "confirm": confirm, **_by_name(report)}
        observed: wire.Observed = await self._counted("/observe", body, "period" if period is None else None, number)
        self.observed = observed
        if observed["period"] >= self.period:
            self.period, self.wealth = observed["period"] + 1, observed["wealth"]
            self.holding = observed["holding"]
            self.state = "completed" if observed["completed"] else self.state
        return self

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
        """Reports a record period by period, from ``period`` on, and answers what was advised and what became of
        wealth, a row for each.

        ``returns`` are fractions or prices, oldest first, and ``kind`` says which. Of several assets they are a table
        with a column for each, or rows in their order, and so is ``executed_allocation``. ``dates`` are the last days
        of the periods, by default those of the index of a pandas object, as they stand there. ``rate``, ``flow`` and
        ``executed_allocation`` of one asset are as in :meth:`observe`: one number for all periods, or one for each
        entry of ``returns``, as ``dates`` are.

        What is on record is meant, so no report of it is doubted. Each carries the number of its period, so the same
        call again, be it after :class:`Unreachable`, reports nothing twice and answers the same. A record that goes
        on where the session stands has ``period=session.period``. A session that renews itself is waited for wherever
        a renewal is due: what is advised does not depend on how long trainings take.

        The rows have the index of ``returns`` where that is a pandas object, and else the periods. The columns are
        those of :func:`ballast.frames.history`, as they were told. Raises ``ValueError`` where an argument breaks a
        rule and ``ImportError`` without pandas, both before anything is sent; :class:`JobEnded` where the training of
        a renewal fails; and what :meth:`observe` raises.
        """
        frames.require_pandas()
        assets = (await self._history()).get("assets") if replay.has_columns(returns) else None
        reports = replay.reports(returns, kind, dates, rate, flow, executed_allocation, assets)
        renewing = (await self._read()).get("renew") is not None
        for number, report in enumerate(reports, start=period):
            if renewing:
                await self._await_renewal()
            await self._observe(period=number, confirm=True, **report)
        return replay.told(await self._history(), period, returns, kind, len(reports))

    async def _await_renewal(self) -> None:
        """Waits until no renewal is due. The service looks at those under way twice a second."""
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
        """Puts right what a period that passed reported: all of it, in the place of what was reported before. With
        ``change="insert"`` the report is of a period that was skipped before this one, and with ``change="remove"``,
        without a report, the period is taken out.

        What was reported and told stays on record; every advice from now on rests on the correction. Exactly once as
        :meth:`observe` is: ``correction`` is the number after the last one made unless given, and one whose answer was
        lost is sent again under the same number.
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
            self.corrections, self.wealth, self.holding = number, corrected["wealth"], corrected["holding"]
            self.period = corrected["observed"] + 1
        return corrected

    async def _renew(self, policy: str, *, window: int | None = None, renewal: int | None = None) -> wire.Renewed:
        """Goes on by another policy from the coming period; its law is of the last ``window`` returns seen, or of all.

        Exactly once as :meth:`observe` is: ``renewal`` is the number after the last one made unless given.
        """
        number = self.renewals + 1 if renewal is None else renewal
        body: wire.Renew = {"renewal": number, "policy": policy, "window": window}
        counted: _Counted | None = "renewal" if renewal is None else None
        renewed: wire.Renewed = await self._counted(f"{self._path}/renewals", body, counted, number)
        if number > self.renewals:
            self.renewals, self.policy, self.horizon = number, renewed["policy"], renewed["horizon"]
            self.period, self.state = renewed["period"], "active"
        return renewed

    async def _counted(
        self, path: str, body: wire.Observe | wire.Correct | wire.Renew, counted: _Counted | None, number: int
    ) -> Any:
        """Sends what has a number. Where this object ``counted`` it, and somebody else has used it since, the refusal
        says so, and when that was."""
        try:
            return await self._transport.json("POST", path, body=body)
        except ReportConflict as conflict:
            made = None if counted is None else await self._made(counted, number)
            if made is None:
                raise
            told = f"{counted} {number} was {made}, which this object has not seen; refresh() catches up"
            problem = cast(wire.Problem, {**conflict.args[0], "detail": told})
            raise ReportConflict(problem, conflict.retry_after) from conflict

    async def _made(self, counted: _Counted, number: int) -> str | None:
        """When an entry of the session was made; of a renewal also whether the service makes them by itself."""
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
        explain: Literal["worst_case"] | None = None,
        sweep: wire.Sweep | None = None,
    ) -> wire.WhatIfAnswer:
        """The advice for a hypothetical wealth, holding, radius or next return, or for a ``sweep`` of one of them.

        Touches nothing: the session stays as it is.
        """
        supposed: wire.WhatIf = {
            "session": self.id,
            "wealth": wealth,
            "holding": holding,
            "radius_scale": radius_scale,
            "radius": radius,
            "log_return": log_return,
            "simple_return": simple_return,
            "explain": explain,
            "sweep": sweep,
        }
        return cast(wire.WhatIfAnswer, await self._transport.json("POST", "/what-if", body=supposed))

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
        """The same of a session of several assets, for hypothetical holdings or next returns of each by its name, a
        dict or a Series: what ``observe`` and then ``assets_action`` would tell. :func:`ballast.frames.allocation`
        makes a Series of it."""
        supposed: dict[str, Any] = {
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
        body = {name: value.to_dict() if hasattr(value, "to_dict") else value for name, value in supposed.items()}
        return cast(wire.AssetsWhatIfPoint, await self._transport.json("POST", "/what-if", body=body))

    async def _history(self) -> wire.History:
        """Where the session started, what was reported and told, and what would be told now.

        ``Policy.session(history=...)`` takes it, and opens a session that starts as this one did."""
        history = cast(wire.History, await self._transport.json("GET", f"{self._path}/history"))
        history["history"] = LogReturns(history["history"])
        return history

    async def _frame(self, as_of: Literal["now", "then"] = "now") -> pd.DataFrame:
        """The history as a DataFrame, a row for each period observed: dates, returns, what was advised and held, and
        what wealth became (:func:`ballast.frames.history` names the columns and their units).

        ``as_of="now"`` has every correction made, ``"then"`` tells what was told at the time. Raises ``ImportError``
        without pandas.
        """
        return frames.history(await self._history(), as_of)

    async def _assets_frame(
        self, figure: frames.AssetsFigure = "simple_return", as_of: Literal["now", "then"] = "now"
    ) -> pd.DataFrame:
        """One figure of a session of several assets by period and asset: their returns, or the share advised, executed
        or held of each (:func:`ballast.frames.assets_history`, which says what it raises)."""
        return frames.assets_history(await self._history(), figure, as_of)

    async def _worst_case(self) -> pd.DataFrame:
        """The law that the advice for the coming period is robust against, as what moves where
        (:func:`ballast.frames.worst_case`, which says what it raises)."""
        return frames.worst_case(await self._action(explain="worst_case"))

    async def _plot(self, ax: Axes | None = None) -> Axes:
        """Draws wealth after each period reported, and the share held in it (:func:`ballast.plots.history`). Raises
        ``ImportError`` without pandas and matplotlib."""
        return plots.history(await self._history(), ax)

    async def _refresh(self) -> Self:
        """Reads from the service where the session stands, and by which policy it lives."""
        await self._read()
        return self

    async def _read(self) -> wire.Session:
        session: wire.Session = await self._transport.json("GET", self._path)
        self.renewals, self.policy, self.horizon = session["renewals"], session["policy"], session["horizon"]
        self.corrections = session["corrections"]
        self.period, self.wealth, self.holding = session["period"], session["wealth"], session["holding"]
        self.state = session["state"]
        return session

    async def _delete(self) -> None:
        """Deletes the session and all that is recorded of it. Raises :class:`NotFound` where there is none."""
        await self._transport.call("DELETE", self._path)

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.id} at period {self.period} of {self.horizon}>"


def _by_name(report: wire.Report) -> wire.Report:
    """The report with dicts in the place of Series."""
    plain = {name: value.to_dict() if hasattr(value, "to_dict") else value for name, value in report.items()}
    return cast(wire.Report, plain)


class Session(_Session):
    __doc__ = _Session.__doc__

    action = Answering(wire.Action).blocking(_Session._action)
    assets_action = Answering(wire.AssetsAction).blocking(_Session._assets_action)
    observe = blocking(_Session._observe)
    replay = blocking(_Session._replay)
    correct = Answering(wire.Corrected).blocking(_Session._correct)
    renew = Answering(wire.Renewed).blocking(_Session._renew)
    what_if = blocking(_Session._what_if)
    assets_what_if = Answering(wire.AssetsWhatIfPoint).blocking(_Session._assets_what_if)
    label = Answering(wire.Labels).blocking(_Session._label)
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
    observe = _Session._observe
    replay = _Session._replay
    correct = _Session._correct
    renew = _Session._renew
    what_if = _Session._what_if
    assets_what_if = _Session._assets_what_if
    label = _Session._label
    history = _Session._history
    frame = _Session._frame
    assets_frame = _Session._assets_frame
    worst_case = _Session._worst_case
    plot = _Session._plot
    refresh = _Session._refresh
    delete = _Session._delete
