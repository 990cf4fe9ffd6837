"""Jobs. A training produces a policy; an evaluation, a walk-forward or a frontier produces a report."""

from __future__ import annotations

import json
from collections.abc import AsyncIterator, Sequence
from typing import TYPE_CHECKING, Any, cast
from urllib.parse import quote

import httpx
from typing_extensions import Self, Unpack

from . import frames, plots, wire
from .driving import Answering, awaiting_into, blocking, blocking_into
from .errors import JobEnded, ProblemError, Unreachable
from .events import Parser
from .policy import AsyncPolicy, Opening, Policy, _Policy
from .progress import TERMINAL, Watch
from .session import AsyncSession, Session
from .transport import RETRIED_STATUS, Transport, growing_pause

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes


class _Job:
    """A job of the service. It runs whether or not anybody waits for it."""

    def __init__(self, transport: Transport, job: wire.Job) -> None:
        self._transport = transport
        self._path = f"/jobs/{quote(job['job'], safe='')}"
        #: The last known state of the job.
        self.job = job
        #: Warnings about probable mistakes in the request. Empty for a job that was looked up by its id.
        self.warnings: list[wire.Warning] = list(cast(wire.AcceptedJob, job).get("warnings", []))
        #: Says how the returns were read; ``None`` without returns and for a job that was looked up by its id.
        self.read: str | None = cast(dict[str, Any], job).get("read")

    @property
    def id(self) -> str:
        return self.job["job"]

    async def _refresh(self) -> Self:
        """Updates ``job`` from the service."""
        self.job = await self._transport.json("GET", self._path)
        return self

    async def _cancel(self) -> Self:
        """Asks the job to stop, which it does within a second. A job that has ended does not change."""
        self.job = await self._transport.json("POST", f"{self._path}/cancel")
        return self

    async def _delete(self) -> None:
        """Deletes a job that has ended, its report and its idempotency key, but not the policy that it produced.

        Raises :class:`JobNotEnded` while the job is queued or running, and :class:`NotFound` if there is no such job.
        """
        await self._transport.call("DELETE", self._path)

    async def _events(self) -> AsyncIterator[wire.Job]:
        """Yields the job now and at every change until it ends. After a lost connection the stream resumes."""
        last_id, failures = "", 0
        while True:
            reason, cause = "the service closed the stream", None
            try:
                async with self._transport.stream(f"{self._path}/events", last_id) as chunks:
                    parser = Parser()
                    async for chunk in chunks:
                        for event in parser.feed(chunk):
                            last_id, failures = event.id, 0
                            self.job = json.loads(event.data)
                            yield self.job
                            if self.job["state"] in TERMINAL:
                                return
            except httpx.RequestError as error:
                reason, cause = repr(error), error
                if not failures:
                    self._transport.warn(error)
            except ProblemError as error:
                if error.status not in RETRIED_STATUS:
                    raise
                reason = repr(error)
            # A service that stops closes its streams normally, and may start again.
            if failures >= self._transport.retries:
                message = f"no more events of the job {self.id}"
                raise Unreachable(
                    f"{message}: {reason}" if cause is None else self._transport.silence(message, cause, failures + 1)
                ) from cause
            await self._transport.pause(growing_pause(failures))
            failures += 1

    async def _watched(self, watch: Watch | None) -> wire.Job:
        async for job in self._events():
            if watch is not None:
                watch(job)
        if self.job["state"] != "succeeded":
            raise JobEnded(self.job)
        return self.job

    async def _ended(self, watch: Watch | None) -> Any:
        path = (await self._watched(watch)).get("report")
        if path is None:
            raise JobEnded(self.job)
        return await self._transport.json("GET", path)

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.id} {self.job['state']}>"


class _Training(_Job):
    """A job that produces a policy; ``Ballast.training(id)`` looks it up."""

    async def _policy(self, watch: Watch | None = None) -> str:
        """Waits for the end of the training, and calls ``watch`` at each change.

        Raises :class:`JobEnded` if the job fails or is cancelled.
        """
        policy = (await self._watched(watch)).get("policy")
        if policy is None:
            raise JobEnded(self.job)
        return policy

    async def _session(self, *, watch: Watch | None = None, **opening: Unpack[Opening]) -> wire.Session:
        """Waits for the policy and opens a session with it, as :meth:`Policy.session` does."""
        return await _Policy(self._transport, await self._policy(watch))._session(**opening)


class _Evaluation(_Job):
    """A job that produces a report; ``Ballast.evaluation(id)`` looks it up."""

    async def _report(self, watch: Watch | None = None) -> wire.EvaluationReport:
        """Waits for the end of the evaluation, and calls ``watch`` at each change.

        Raises :class:`JobEnded` if the job fails or is cancelled.
        """
        return cast(wire.EvaluationReport, await self._ended(watch))

    async def _frame(self, watch: Watch | None = None) -> pd.DataFrame:
        """Returns the strategies of the report, one per row (:func:`ballast.frames.evaluation`).

        Waits and raises as ``report`` does, and raises ``ImportError`` without pandas.
        """
        return frames.evaluation(await self._report(watch))

    async def _plot(
        self, ax: Axes | None = None, strategies: Sequence[str] | None = None, watch: Watch | None = None
    ) -> Axes:
        """Draws the certainty equivalent of ``strategies``, by default of all (:func:`ballast.plots.evaluation`).

        Waits and raises as ``report`` does, and raises ``ValueError`` for an unknown strategy and ``ImportError``
        without pandas and matplotlib.
        """
        return plots.evaluation(await self._report(watch), ax, strategies)


class _Comparison(_Job):
    """A job that compares policies and rules of a declared problem; ``Ballast.comparison(id)`` looks it up."""

    async def _report(self, watch: Watch | None = None) -> wire.ComparisonReport:
        """Waits for the end of the comparison, and calls ``watch`` at each change.

        Raises :class:`JobEnded` if the job fails or is cancelled.
        """
        return cast(wire.ComparisonReport, await self._ended(watch))

    async def _frame(self, watch: Watch | None = None) -> pd.DataFrame:
        """Returns policies and rules, one per row (:func:`ballast.frames.comparison`).

        Waits and raises as ``report`` does, and raises ``ImportError`` without pandas.
        """
        return frames.comparison(await self._report(watch))


class _Walk(_Job):
    """Calls that walk-forwards of one asset and of several share."""

    async def _frame(self, watch: Watch | None = None) -> pd.DataFrame:
        """Returns the strategies of the report, one per row (:func:`ballast.frames.walk_forward`).

        Waits and raises as ``report`` does, and raises ``ImportError`` without pandas.
        """
        return frames.walk_forward(await self._ended(watch))

    async def _periods(self, figure: frames.Figure = "wealth", watch: Watch | None = None) -> pd.DataFrame:
        """Returns one figure of each strategy by date (:func:`ballast.frames.periods`).

        The figure is ``"wealth"``, ``"traded"``, ``"radius"`` or, for one asset, ``"allocation"`` and so on. Waits and
        raises as ``report`` does, and raises ``ValueError`` for another figure and ``ImportError`` without pandas.
        """
        return frames.periods(await self._ended(watch), figure)

    async def _plot(
        self, ax: Axes | None = None, watch: Watch | None = None, strategies: Sequence[str] | None = None
    ) -> Axes:
        """Draws the wealth of ``strategies``, by default of the ten with the highest certainty equivalent
        (:func:`ballast.plots.walk_forward`).

        Waits and raises as ``report`` does, and raises ``ValueError`` for an unknown strategy and ``ImportError``
        without pandas and matplotlib.
        """
        return plots.walk_forward(await self._ended(watch), ax, strategies)


class _WalkForward(_Walk):
    """A job that produces a report; ``Ballast.walk_forward(id)`` looks it up."""

    async def _report(self, watch: Watch | None = None) -> wire.BacktestReport:
        """Waits for the end of the walk-forward, and calls ``watch`` at each change.

        Raises :class:`JobEnded` if the job fails or is cancelled.
        """
        return cast(wire.BacktestReport, await self._ended(watch))


class _AssetsWalkForward(_Walk):
    """A job that produces a report on several assets; ``Ballast.assets_walk_forward(id)`` looks it up."""

    async def _report(self, watch: Watch | None = None) -> wire.AssetsBacktestReport:
        """Waits for the end of the walk-forward, and calls ``watch`` at each change.

        Raises :class:`JobEnded` if the job fails or is cancelled.
        """
        return cast(wire.AssetsBacktestReport, await self._ended(watch))

    async def _held(self, strategy: str | None = None, watch: Watch | None = None) -> pd.DataFrame:
        """Returns the share of wealth in each asset (:func:`ballast.frames.held`).

        With ``strategy`` there is a row for each date; without it, a row for each strategy with its average shares.
        Waits and raises as ``report`` does, and raises ``ValueError`` for an unknown strategy and ``ImportError``
        without pandas.
        """
        return frames.held(await self._report(watch), strategy)


class _DeclaredWalkForward(_Job):
    """A job that produces a report on a declared problem; ``Ballast.declared_walk_forward(id)`` looks it up."""

    async def _report(self, watch: Watch | None = None) -> wire.DeclaredWalkReport:
        """Waits for the end of the walk-forward, and calls ``watch`` at each change.

        Raises :class:`JobEnded` if the job fails or is cancelled.
        """
        return cast(wire.DeclaredWalkReport, await self._ended(watch))

    async def _frame(self, watch: Watch | None = None) -> pd.DataFrame:
        """Returns policies and rules, one per row (:func:`ballast.frames.declared_walk`).

        Waits and raises as ``report`` does, and raises ``ImportError`` without pandas.
        """
        return frames.declared_walk(await self._report(watch))

    async def _periods(self, strategy: str | None = None, watch: Watch | None = None) -> pd.DataFrame:
        """Returns the periods of a strategy, by default of the first (:func:`ballast.frames.declared_periods`).

        Waits and raises as ``report`` does, and raises ``ValueError`` for an unknown strategy and ``ImportError``
        without pandas.
        """
        return frames.declared_periods(await self._report(watch), strategy)


class _Frontier(_Job):
    """A job that produces a report; ``Ballast.frontier_of(id)`` looks it up."""

    async def _report(self, watch: Watch | None = None) -> wire.FrontierReport:
        """Waits for the end of the job, and calls ``watch`` at each change.

        Raises :class:`JobEnded` if the job fails or is cancelled.
        """
        return cast(wire.FrontierReport, await self._ended(watch))

    async def _frame(self, watch: Watch | None = None) -> pd.DataFrame:
        """Returns what is lost at each multiple of the radius (:func:`ballast.frames.frontier`).

        Waits and raises as ``report`` does, and raises ``ImportError`` without pandas.
        """
        return frames.frontier(await self._report(watch))

    async def _plot(self, ax: Axes | None = None, watch: Watch | None = None) -> Axes:
        """Draws what is lost with its interval (:func:`ballast.plots.frontier`).

        Waits and raises as ``report`` does, and raises ``ImportError`` without pandas and matplotlib.
        """
        return plots.frontier(await self._report(watch), ax)


class Job(_Job):
    __doc__ = _Job.__doc__

    refresh = blocking(_Job._refresh)
    cancel = blocking(_Job._cancel)
    delete = blocking(_Job._delete)
    events = Answering(wire.Job).iterating(_Job._events)


class Training(Job, _Training):
    __doc__ = _Training.__doc__

    policy = blocking_into(_Training._policy, Policy)
    session = blocking_into(_Training._session, Session)


class Evaluation(Job, _Evaluation):
    __doc__ = _Evaluation.__doc__

    report = Answering(wire.EvaluationReport).blocking(_Evaluation._report)
    frame = blocking(_Evaluation._frame)
    plot = blocking(_Evaluation._plot)


class Comparison(Job, _Comparison):
    __doc__ = _Comparison.__doc__

    report = Answering(wire.ComparisonReport).blocking(_Comparison._report)
    frame = blocking(_Comparison._frame)


class _WaitedWalk(Job, _Walk):
    frame = blocking(_Walk._frame)
    periods = blocking(_Walk._periods)
    plot = blocking(_Walk._plot)


class WalkForward(_WaitedWalk, _WalkForward):
    __doc__ = _WalkForward.__doc__

    report = Answering(wire.BacktestReport).blocking(_WalkForward._report)


class AssetsWalkForward(_WaitedWalk, _AssetsWalkForward):
    __doc__ = _AssetsWalkForward.__doc__

    report = Answering(wire.AssetsBacktestReport).blocking(_AssetsWalkForward._report)
    held = blocking(_AssetsWalkForward._held)


class DeclaredWalkForward(Job, _DeclaredWalkForward):
    __doc__ = _DeclaredWalkForward.__doc__

    report = Answering(wire.DeclaredWalkReport).blocking(_DeclaredWalkForward._report)
    frame = blocking(_DeclaredWalkForward._frame)
    periods = blocking(_DeclaredWalkForward._periods)


class Frontier(Job, _Frontier):
    __doc__ = _Frontier.__doc__

    report = Answering(wire.FrontierReport).blocking(_Frontier._report)
    frame = blocking(_Frontier._frame)
    plot = blocking(_Frontier._plot)


class AsyncJob(_Job):
    """A :class:`Job` whose calls are awaited."""

    refresh = _Job._refresh
    cancel = _Job._cancel
    delete = _Job._delete
    events = _Job._events


class AsyncTraining(AsyncJob, _Training):
    """A :class:`Training` whose calls are awaited."""

    policy = awaiting_into(_Training._policy, AsyncPolicy)
    session = awaiting_into(_Training._session, AsyncSession)


class AsyncEvaluation(AsyncJob, _Evaluation):
    """A :class:`Evaluation` whose calls are awaited."""

    report = _Evaluation._report
    frame = _Evaluation._frame
    plot = _Evaluation._plot


class AsyncComparison(AsyncJob, _Comparison):
    """A :class:`Comparison` whose calls are awaited."""

    report = _Comparison._report
    frame = _Comparison._frame


class _AwaitedWalk(AsyncJob, _Walk):
    frame = _Walk._frame
    periods = _Walk._periods
    plot = _Walk._plot


class AsyncWalkForward(_AwaitedWalk, _WalkForward):
    """A :class:`WalkForward` whose calls are awaited."""

    report = _WalkForward._report


class AsyncAssetsWalkForward(_AwaitedWalk, _AssetsWalkForward):
    """An :class:`AssetsWalkForward` whose calls are awaited."""

    report = _AssetsWalkForward._report
    held = _AssetsWalkForward._held


class AsyncDeclaredWalkForward(AsyncJob, _DeclaredWalkForward):
    """A :class:`DeclaredWalkForward` whose calls are awaited."""

    report = _DeclaredWalkForward._report
    frame = _DeclaredWalkForward._frame
    periods = _DeclaredWalkForward._periods


class AsyncFrontier(AsyncJob, _Frontier):
    """A :class:`Frontier` whose calls are awaited."""

    report = _Frontier._report
    frame = _Frontier._frame
    plot = _Frontier._plot
