"""A live investor."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, cast
from urllib.parse import quote

from typing_extensions import Unpack

from . import frames, wire
from .transport import Transport

if TYPE_CHECKING:
    import pandas as pd


class Session:
    """A session of the service, and the period it has come to.

    ``observe`` numbers its reports, which makes them exactly-once: a report whose answer was lost is sent again under
    the same number, and the service answers as it did the first time. Where ``observe`` raises :class:`Unreachable`,
    the period is still the old one here; call it again with the same arguments. One object is one investor's and is not
    meant for several threads; after somebody else has observed for him, ``refresh`` catches up.
    """

    def __init__(self, transport: Transport, session: wire.Session) -> None:
        self._transport = transport
        self._path = f"/sessions/{quote(session['session'], safe='')}"
        self.id = session["session"]
        self.policy = session["policy"]
        self.horizon = session["horizon"]
        #: The coming period, from 1; ``horizon + 1`` once completed.
        self.period = session["period"]
        self.wealth = session["wealth"]
        #: Share of it in the risky asset, before trading.
        self.holding = session["holding"]
        #: Policies that followed the first.
        self.renewals = session["renewals"]
        #: Corrections made of what periods reported.
        self.corrections = session["corrections"]
        #: The answer to the last ``observe``: wealth, sample size, moments, quantile, radius.
        self.observed: wire.Observed | None = None

    @property
    def completed(self) -> bool:
        return self.period > self.horizon

    def action(
        self,
        *,
        mode: Literal["surrogate", "resolve"] | None = None,
        explain: Literal["worst_case"] | None = None,
        sensitivity: bool | None = None,
    ) -> wire.Action:
        """The robust allocation for the coming period.

        ``mode="resolve"`` solves the robust step anew at the exact state; ``explain="worst_case"`` does too, and shows
        the law it is robust against. ``sensitivity=True`` says how near the allocation is to changing. Raises
        :class:`SessionCompleted` after the horizon.
        """
        params = {"session": self.id, "mode": mode, "explain": explain, "sensitivity": "true" if sensitivity else None}
        return cast(wire.Action, self._transport.json("GET", "/action", params=params))

    def observe(self, *, period: int | None = None, confirm: bool = False, **report: Unpack[wire.Report]) -> Session:
        """Reports the coming period: its return in exactly one of three ways, or ``missing=True``; the answer is in
        ``observed``.

        :class:`wire.Report <ballast.wire.Report>` names all that can be said: ``executed_allocation`` is what was
        really held, by default what was advised; ``rate`` what the bank paid, ``flow`` what was added, by default the
        policy's; ``wealth`` what was really reached; ``date`` the last day. ``period`` is the coming one unless given:
        an earlier one with the content first reported for it gets its first answer again. Raises
        :class:`UnusualReturn` for a return far from the record, unless ``confirm`` says that it is meant, and
        :class:`ReportConflict`, :class:`ReportGap` and :class:`SessionCompleted`.
        """
        number = self.period if period is None else period
        body: wire.Observe = {"session": self.id, "period": number, "confirm": confirm, **report}
        observed: wire.Observed = self._transport.json("POST", "/observe", body=body)
        self.observed = observed
        if observed["period"] >= self.period:
            self.period, self.wealth = observed["period"] + 1, observed["wealth"]
            self.holding = observed["holding"]
        return self

    def correct(
        self,
        period: int,
        reason: str,
        *,
        correction: int | None = None,
        confirm: bool = False,
        **report: Unpack[wire.Report],
    ) -> wire.Corrected:
        """Puts right what a period that passed reported: all of it, in the place of what was reported before.

        What was reported and told stays on record; every advice from now on rests on the correction. Exactly once as
        :meth:`observe` is: ``correction`` is the number after the last one made unless given, and one whose answer was
        lost is sent again under the same number.
        """
        number = self.corrections + 1 if correction is None else correction
        body: wire.Correct = {
            "correction": number,
            "period": period,
            "reason": reason,
            "confirm": confirm,
            **report,
        }
        corrected: wire.Corrected = self._transport.json("POST", f"{self._path}/corrections", body=body)
        if number > self.corrections:
            self.corrections, self.wealth, self.holding = number, corrected["wealth"], corrected["holding"]
            self.period = corrected["observed"] + 1
        return corrected

    def renew(self, policy: str, *, window: int | None = None, renewal: int | None = None) -> wire.Renewed:
        """Goes on by another policy from the coming period; its law is of the last ``window`` returns seen, or of all.

        Exactly once as :meth:`observe` is: ``renewal`` is the number after the last one made unless given.
        """
        number = self.renewals + 1 if renewal is None else renewal
        body: wire.Renew = {"renewal": number, "policy": policy, "window": window}
        renewed: wire.Renewed = self._transport.json("POST", f"{self._path}/renewals", body=body)
        if number > self.renewals:
            self.renewals, self.policy, self.horizon = number, renewed["policy"], renewed["horizon"]
            self.period = renewed["period"]
        return renewed

    def what_if(
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
        return cast(wire.WhatIfAnswer, self._transport.json("POST", "/what-if", body=supposed))

    def history(self) -> wire.History:
        """Where the session started, what was reported and told, and what would be told now."""
        return cast(wire.History, self._transport.json("GET", f"{self._path}/history"))

    def frame(self, as_of: Literal["now", "then"] = "now") -> pd.DataFrame:
        """The history as a DataFrame, a row for each period observed: dates, returns, what was advised and held, and
        what wealth became (:func:`ballast.frames.history` names the columns and their units).

        ``as_of="now"`` has every correction made, ``"then"`` tells what was told at the time. Raises ``ImportError``
        without pandas.
        """
        return frames.history(self.history(), as_of)

    def refresh(self) -> Session:
        """Reads from the service where the session stands, and by which policy it lives."""
        session: wire.Session = self._transport.json("GET", self._path)
        self.renewals, self.policy, self.horizon = session["renewals"], session["policy"], session["horizon"]
        self.corrections = session["corrections"]
        self.period, self.wealth, self.holding = session["period"], session["wealth"], session["holding"]
        return self

    def delete(self) -> None:
        """Deletes the session and all that is recorded of it. Raises :class:`NotFound` where there is none."""
        self._transport.call("DELETE", self._path)

    def __repr__(self) -> str:
        return f"<Session {self.id} at period {self.period} of {self.horizon}>"
