"""Jobs: a training ends in a policy, an evaluation or a walk-forward in a report."""

from __future__ import annotations

import json
import sys
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any, TextIO, cast
from urllib.parse import quote

import httpx
from typing_extensions import Self

from . import frames, plots, wire
from .driving import Answering, awaiting_into, blocking, blocking_into
from .errors import JobEnded, ProblemError, Unreachable
from .events import Parser
from .policy import AsyncPolicy, Policy, _Policy
from .returns import Kind, Returns
from .session import AsyncSession, Session
from .transport import RETRIED_STATUS, Transport, growing_pause

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

#: Called with the job at every change of it.
Watch = Callable[[wire.Job], object]

_TERMINAL = ("succeeded", "failed", "cancelled")


class _Job:
    """A job of the service. It goes on whether or not anybody waits for it."""

    def __init__(self, transport: Transport, job: wire.Job) -> None:
        self._transport = transport
        self._path = f"/jobs/{quote(job['job'], safe='')}"
        #: The job as last seen.
        self.job = job
        #: What in the request may be a mistake, as the service said when it took it; empty for a job found again.
        self.warnings: list[wire.Warning] = list(cast(wire.AcceptedJob, job).get("warnings", []))

    @property
    def id(self) -> str:
        return self.job["job"]

    async def _refresh(self) -> Self:
        """Asks the service how far it is, which ``job`` then says."""
        self.job = await self._transport.json("GET", self._path)
        return self

    async def _cancel(self) -> Self:
        """Asks the job to stop, which it does within a second; a job that has ended stays as it is."""
        self.job = await self._transport.json("POST", f"{self._path}/cancel")
        return self

    async def _delete(self) -> None:
        """Deletes a job that has ended, its report and its idempotency key; a policy that it made stays.

        Raises :class:`JobNotEnded` while it is queued or runs, and :class:`NotFound` where there is none.
        """
        await self._transport.call("DELETE", self._path)

    async def _events(self) -> AsyncIterator[wire.Job]:
        """The job now, then at every change of it, up to its end. A stream that breaks is taken up where it was."""
        last_id, failures = "", 0
        while True:
            reason, cause = "the service ended them", None
            try:
                async with self._transport.stream(f"{self._path}/events", last_id) as chunks:
                    parser = Parser()
                    async for chunk in chunks:
                        for event in parser.feed(chunk):
                            last_id, failures = event.id, 0
                            self.job = json.loads(event.data)
                            yield self.job
                            if self.job["state"] in _TERMINAL:
                                return
            except httpx.RequestError as error:
                reason, cause = repr(error), error
                if not failures:
                    self._transport.warn(error)
            except ProblemError as error:
                if error.status not in RETRIED_STATUS:
                    raise
                reason = repr(error)
            # A service that stops ends its streams in good order, and comes back.
            if failures >= self._transport.retries:
                told = f"no more events of the job {self.id}"
                raise Unreachable(
                    f"{told}: {reason}" if cause is None else self._transport.silence(told, cause, failures + 1)
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
    """A job that ends in a policy; ``Ballast.training(id)`` finds it again."""

    async def _policy(self, watch: Watch | None = None) -> str:
        """Waits for the end of the training, showing each change to ``watch``.

        Raises :class:`JobEnded` where the job fails or is cancelled.
        """
        policy = (await self._watched(watch)).get("policy")
        if policy is None:
            raise JobEnded(self.job)
        return policy

    async def _session(
        self,
        *,
        history: Returns | None = None,
        kind: Kind | None = None,
        choices: wire.Choices | None = None,
        wealth: float | None = None,
        holding: float | None = None,
        holdings: Mapping[str, float] | None = None,
        renew: wire.Renewing | None = None,
        rolling: bool = False,
        name: str | None = None,
        notes: str | None = None,
        tags: Sequence[str] | None = None,
        idempotency_key: str | None = None,
        watch: Watch | None = None,
    ) -> wire.Session:
        """Waits for the policy and opens a session of it, as :meth:`Policy.session` does."""
        policy = _Policy(self._transport, await self._policy(watch))
        return await policy._session(
            history=history,
            kind=kind,
            choices=choices,
            wealth=wealth,
            holding=holding,
            holdings=holdings,
            renew=renew,
            rolling=rolling,
            name=name,
            notes=notes,
            tags=tags,
            idempotency_key=idempotency_key,
        )


class _Evaluation(_Job):
    """A job that ends in a report; ``Ballast.evaluation(id)`` finds it again."""

    async def _report(self, watch: Watch | None = None) -> wire.EvaluationReport:
        """Waits for the end of the evaluation, showing each change to ``watch``.

        Raises :class:`JobEnded` where the job fails or is cancelled.
        """
        return cast(wire.EvaluationReport, await self._ended(watch))

    async def _frame(self, watch: Watch | None = None) -> pd.DataFrame:
        """The report's strategies, one a row (:func:`ballast.frames.evaluation`). Waits as ``report`` does, and raises
        what it raises, and ``ImportError`` without pandas."""
        return frames.evaluation(await self._report(watch))

    async def _plot(self, ax: Axes | None = None, watch: Watch | None = None) -> Axes:
        """Draws what each strategy is worth for certain (:func:`ballast.plots.evaluation`). Waits as ``report`` does,
        and raises what it raises, and ``ImportError`` without pandas and matplotlib."""
        return plots.evaluation(await self._report(watch), ax)


class _WalkForward(_Job):
    """A job that ends in a report; ``Ballast.walk_forward(id)`` finds it again."""

    async def _report(self, watch: Watch | None = None) -> wire.BacktestReport:
        """Waits for the end of the walk-forward, showing each change to ``watch``.

        Raises :class:`JobEnded` where the job fails or is cancelled.
        """
        return cast(wire.BacktestReport, await self._ended(watch))

    async def _frame(self, watch: Watch | None = None) -> pd.DataFrame:
        """The report's strategies, one a row (:func:`ballast.frames.walk_forward`). Waits as ``report`` does, and
        raises what it raises, and ``ImportError`` without pandas."""
        return frames.walk_forward(await self._report(watch))

    async def _periods(self, figure: frames.Figure = "wealth", watch: Watch | None = None) -> pd.DataFrame:
        """What each strategy did or had, by date: ``"wealth"``, ``"allocation"`` and so on
        (:func:`ballast.frames.periods`). Waits as ``report`` does, and raises what it raises, ``ValueError`` for
        another figure and ``ImportError`` without pandas."""
        return frames.periods(await self._report(watch), figure)

    async def _plot(self, ax: Axes | None = None, watch: Watch | None = None) -> Axes:
        """Draws the wealth of every strategy (:func:`ballast.plots.walk_forward`). Waits as ``report`` does, and raises
        what it raises, and ``ImportError`` without pandas and matplotlib."""
        return plots.walk_forward(await self._report(watch), ax)


class _Frontier(_Job):
    """A job that ends in a report; ``Ballast.frontier_of(id)`` finds it again."""

    async def _report(self, watch: Watch | None = None) -> wire.FrontierReport:
        """Waits for the end, showing each change to ``watch``.

        Raises :class:`JobEnded` where the job fails or is cancelled.
        """
        return cast(wire.FrontierReport, await self._ended(watch))

    async def _frame(self, watch: Watch | None = None) -> pd.DataFrame:
        """What is lost at each multiple of the radius (:func:`ballast.frames.frontier`). Waits as ``report`` does, and
        raises what it raises, and ``ImportError`` without pandas."""
        return frames.frontier(await self._report(watch))

    async def _plot(self, ax: Axes | None = None, watch: Watch | None = None) -> Axes:
        """Draws what is lost with its interval (:func:`ballast.plots.frontier`). Waits as ``report`` does, and raises
        what it raises, and ``ImportError`` without pandas and matplotlib."""
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


class WalkForward(Job, _WalkForward):
    __doc__ = _WalkForward.__doc__

    report = Answering(wire.BacktestReport).blocking(_WalkForward._report)
    frame = blocking(_WalkForward._frame)
    periods = blocking(_WalkForward._periods)
    plot = blocking(_WalkForward._plot)


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


class AsyncWalkForward(AsyncJob, _WalkForward):
    """A :class:`WalkForward` whose calls are awaited."""

    report = _WalkForward._report
    frame = _WalkForward._frame
    periods = _WalkForward._periods
    plot = _WalkForward._plot


class AsyncFrontier(AsyncJob, _Frontier):
    """A :class:`Frontier` whose calls are awaited."""

    report = _Frontier._report
    frame = _Frontier._frame
    plot = _Frontier._plot


class ProgressPrinter:
    """A ``watch`` that prints: one line that is rewritten on a terminal, a line for each finished step elsewhere."""

    def __init__(self, file: TextIO | None = None) -> None:
        self._file = sys.stderr if file is None else file
        self._shown: tuple[str, int] | None = None

    def __call__(self, job: wire.Job) -> None:
        line = progress_line(job)
        with suppress(BrokenPipeError):
            if self._file.isatty():
                end = "\n" if job["state"] in _TERMINAL else ""
                print(f"\r\x1b[K{line}", end=end, file=self._file, flush=True)
            elif self._shown != (now := (job["state"], job["progress"]["steps_done"])):
                self._shown = now
                print(line, file=self._file, flush=True)


class ProgressBar:
    """A ``watch`` that draws a bar of steps by tqdm, in a terminal or a notebook; it ends with the job.

    Raises ``ImportError`` without tqdm.
    """

    def __init__(self, **tqdm: Any) -> None:
        try:
            from tqdm.auto import tqdm as bar
        except ImportError as error:
            raise ImportError("bars are drawn by tqdm: pip install 'ballast-client[progress]'") from error
        self._bar: Any = bar(**{"unit": "step", **tqdm})

    def __call__(self, job: wire.Job) -> None:
        progress = job["progress"]
        self._bar.total, self._bar.n = progress["steps_total"], progress["steps_done"]
        self._bar.set_description(job["state"], refresh=False)
        self._bar.refresh()
        if job["state"] in _TERMINAL:
            self._bar.close()


def progress_line(job: wire.Job) -> str:
    """A job in a line."""
    progress = job["progress"]
    line = f"{job['state']}: {progress['steps_done']} of {progress['steps_total']} steps"
    if (step := progress.get("step")) is not None:
        line += f", step {step}: {progress.get('points_done')} of {progress.get('points_total')} design points"
    if (left := progress.get("seconds_left")) is not None:
        line += f", about {left:.0f} s left"
    return line
