"""Jobs: a training ends in a policy, an evaluation or a walk-forward in a report."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import TYPE_CHECKING, TextIO, cast
from urllib.parse import quote

import httpx

from . import frames, plots, wire
from .errors import JobEnded, ProblemError, Unreachable
from .events import parsed
from .policy import Policy
from .returns import Kind, Returns
from .session import Session
from .transport import RETRIED_STATUS, Transport, growing_pause

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

#: Called with the job at every change of it.
Watch = Callable[[wire.Job], object]

_TERMINAL = ("succeeded", "failed", "cancelled")


class Job:
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

    def refresh(self) -> wire.Job:
        """The job as it is now."""
        self.job = self._transport.json("GET", self._path)
        return self.job

    def cancel(self) -> wire.Job:
        """Asks the job to stop, which it does within a second; a job that has ended stays as it is."""
        self.job = self._transport.json("POST", f"{self._path}/cancel")
        return self.job

    def delete(self) -> None:
        """Deletes a job that has ended, its report and its idempotency key; a policy that it made stays.

        Raises :class:`JobNotEnded` while it is queued or runs, and :class:`NotFound` where there is none.
        """
        self._transport.call("DELETE", self._path)

    def events(self) -> Iterator[wire.Job]:
        """The job now, then at every change of it, up to its end. A stream that breaks is taken up where it was."""
        last_id, failures = "", 0
        while True:
            reason = "the service ended them"
            try:
                with self._transport.stream(f"{self._path}/events", last_id) as response:
                    for event in parsed(response.iter_bytes()):
                        last_id, failures = event.id, 0
                        self.job = json.loads(event.data)
                        yield self.job
                        if self.job["state"] in _TERMINAL:
                            return
            except httpx.RequestError as error:
                reason = repr(error)
            except ProblemError as error:
                if error.status not in RETRIED_STATUS:
                    raise
                reason = repr(error)
            # A service that stops ends its streams in good order, and comes back.
            if failures >= self._transport.retries:
                raise Unreachable(f"no more events of the job {self.id}: {reason}")
            time.sleep(growing_pause(failures))
            failures += 1

    def _watched(self, watch: Watch | None) -> wire.Job:
        for job in self.events():
            if watch is not None:
                watch(job)
        if self.job["state"] != "succeeded":
            raise JobEnded(self.job)
        return self.job

    def _report(self, watch: Watch | None) -> object:
        path = self._watched(watch).get("report")
        if path is None:
            raise JobEnded(self.job)
        return self._transport.json("GET", path)

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.id} {self.job['state']}>"


class Training(Job):
    """A job that ends in a policy; ``Ballast.training(id)`` finds it again."""

    def policy(self, watch: Watch | None = None) -> Policy:
        """Waits for the end of the training, showing each change to ``watch``.

        Raises :class:`JobEnded` where the job fails or is cancelled.
        """
        policy = self._watched(watch).get("policy")
        if policy is None:
            raise JobEnded(self.job)
        return Policy(self._transport, policy)

    def session(
        self,
        *,
        history: Returns | None = None,
        kind: Kind = "log",
        wealth: float | None = None,
        holding: float | None = None,
        renew: wire.Renewing | None = None,
        rolling: bool = False,
        idempotency_key: str | None = None,
        watch: Watch | None = None,
    ) -> Session:
        """Waits for the policy and opens a session of it, as :meth:`Policy.session` does."""
        return self.policy(watch).session(
            history=history,
            kind=kind,
            wealth=wealth,
            holding=holding,
            renew=renew,
            rolling=rolling,
            idempotency_key=idempotency_key,
        )


class Evaluation(Job):
    """A job that ends in a report; ``Ballast.evaluation(id)`` finds it again."""

    def report(self, watch: Watch | None = None) -> wire.EvaluationReport:
        """Waits for the end of the evaluation, showing each change to ``watch``.

        Raises :class:`JobEnded` where the job fails or is cancelled.
        """
        return cast(wire.EvaluationReport, self._report(watch))

    def frame(self, watch: Watch | None = None) -> pd.DataFrame:
        """The report's strategies, one a row (:func:`ballast.frames.evaluation`). Waits as ``report`` does, and raises
        what it raises, and ``ImportError`` without pandas."""
        return frames.evaluation(self.report(watch))


class WalkForward(Job):
    """A job that ends in a report; ``Ballast.walk_forward(id)`` finds it again."""

    def report(self, watch: Watch | None = None) -> wire.BacktestReport:
        """Waits for the end of the walk-forward, showing each change to ``watch``.

        Raises :class:`JobEnded` where the job fails or is cancelled.
        """
        return cast(wire.BacktestReport, self._report(watch))

    def frame(self, watch: Watch | None = None) -> pd.DataFrame:
        """The report's strategies, one a row (:func:`ballast.frames.walk_forward`). Waits as ``report`` does, and
        raises what it raises, and ``ImportError`` without pandas."""
        return frames.walk_forward(self.report(watch))

    def periods(self, figure: frames.Figure = "wealth", watch: Watch | None = None) -> pd.DataFrame:
        """What each strategy did or had, by date: ``"wealth"``, ``"allocation"`` and so on
        (:func:`ballast.frames.periods`). Waits as ``report`` does, and raises what it raises, ``ValueError`` for
        another figure and ``ImportError`` without pandas."""
        return frames.periods(self.report(watch), figure)

    def plot(self, ax: Axes | None = None, watch: Watch | None = None) -> Axes:
        """Draws the wealth of every strategy (:func:`ballast.plots.walk_forward`). Waits as ``report`` does, and raises
        what it raises, and ``ImportError`` without pandas and matplotlib."""
        return plots.walk_forward(self.report(watch), ax)


class Frontier(Job):
    """A job that ends in a report; ``Ballast.frontier_of(id)`` finds it again."""

    def report(self, watch: Watch | None = None) -> wire.FrontierReport:
        """Waits for the end, showing each change to ``watch``.

        Raises :class:`JobEnded` where the job fails or is cancelled.
        """
        return cast(wire.FrontierReport, self._report(watch))

    def frame(self, watch: Watch | None = None) -> pd.DataFrame:
        """What is lost at each multiple of the radius (:func:`ballast.frames.frontier`). Waits as ``report`` does, and
        raises what it raises, and ``ImportError`` without pandas."""
        return frames.frontier(self.report(watch))

    def plot(self, ax: Axes | None = None, watch: Watch | None = None) -> Axes:
        """Draws what is lost with its interval (:func:`ballast.plots.frontier`). Waits as ``report`` does, and raises
        what it raises, and ``ImportError`` without pandas and matplotlib."""
        return plots.frontier(self.report(watch), ax)


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


def progress_line(job: wire.Job) -> str:
    """A job in a line."""
    progress = job["progress"]
    line = f"{job['state']}: {progress['steps_done']} of {progress['steps_total']} steps"
    if (step := progress.get("step")) is not None:
        line += f", step {step}: {progress.get('points_done')} of {progress.get('points_total')} design points"
    if (left := progress.get("seconds_left")) is not None:
        line += f", about {left:.0f} s left"
    return line
