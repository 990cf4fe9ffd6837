"""The exceptions of this package.

If the service refuses a request, the client raises a :class:`ProblemError` with the parts of the problem document
(RFC 9457). Kinds that a program may want to distinguish have their own class, chosen by the last part of the document's
``type``. A kind that this client does not know yet is a plain :class:`ProblemError`.
"""

from __future__ import annotations

from contextlib import suppress
from typing import Any, ClassVar

import httpx

from . import wire


class BallastError(Exception):
    """Base of all exceptions of this package, except ``ValueError`` and ``TypeError`` for arguments it cannot send."""


class Unreachable(BallastError):
    """No answer came. The service may have carried out the request nevertheless. The method that sent it says whether
    it is safe to send it again."""


class Repeating(RuntimeWarning):
    """Warns, once per call, that no answer came and the request is being retried. It says why and for how long."""


class DamagedPolicy(BallastError):
    """The SHA-256 of an exported policy differs from its name."""


class UnclearReturns(BallastError, ValueError):
    """Returns that can be read in more than one way.

    ``argument`` is the name of the argument. ``questions`` are the questions of the service. Each has ``options``, and
    the ``choices`` of an option answer the question.
    """

    def __init__(self, argument: str, questions: list[wire.Question]) -> None:
        super().__init__(argument, questions)
        self.argument = argument
        self.questions = questions

    def __str__(self) -> str:
        lines: list[str] = []
        by: dict[str, None] = {}
        for question in self.questions:
            lines.append(question["question"])
            for option in question["options"]:
                choices = option["choices"]
                name, value = ("kind", choices["kind"]) if set(choices) == {"kind"} else ("choices", choices)
                by[name] = None
                lines.append(f"  {name}={value!r}: {option.get('sentence') or option['label']}")
            if question["asks"] == "columns":
                lines.append(
                    "  or all of them as several assets: advise_assets, train_assets, backtest_assets, frontier"
                )
        return "\n".join(
            [f"{self.argument} can be read in more than one way: choose one with {' and '.join(by)}.", *lines]
        )


class JobEnded(BallastError):
    """The job that the call waited for failed or was cancelled. ``job`` is its last state."""

    def __init__(self, job: wire.Job) -> None:
        super().__init__(job)
        self.job = job

    def __str__(self) -> str:
        return f"the job {self.job['job']} ended as {self.job['state']}: {self.job.get('error') or 'no reason given'}"


class ProblemError(BallastError):
    """The service refused the request. It has ``type``, ``title``, ``status`` and ``detail``, and if a field is wrong,
    also ``field``, ``value`` and ``rule``. ``retry_after`` is the pause that the service requests, in seconds."""

    kinds: ClassVar[dict[str, type[ProblemError]]] = {}

    def __init_subclass__(cls, slug: str, **rest: Any) -> None:
        super().__init_subclass__(**rest)
        cls.kinds[slug] = cls

    def __init__(self, problem: wire.ProblemDocument, retry_after: float | None = None) -> None:
        super().__init__(problem, retry_after)
        self.type = problem["type"]
        self.title = problem["title"]
        self.status = problem["status"]
        self.detail = problem["detail"]
        self.field = problem.get("field")
        self.value = problem.get("value")
        self.rule = problem.get("rule")
        self.retry_after = retry_after

    def __str__(self) -> str:
        return f"{self.title} ({self.status}): {self.detail}"


class InvalidField(ProblemError, slug="invalid-field"):
    """A field breaks a rule."""


class InvalidQuery(ProblemError, slug="invalid-query"):
    """A query parameter breaks a rule."""


class Unauthenticated(ProblemError, slug="unauthenticated"):
    """The service requires a key, and the request has no valid one."""


class Forbidden(ProblemError, slug="forbidden"):
    """The key lacks the role that the call needs; ``rule`` names it."""


class NotFound(ProblemError, slug="not-found"):
    """There is no such job, policy or session."""


class InUse(ProblemError, slug="in-use"):
    """Sessions still use the policy."""


class JobNotEnded(ProblemError, slug="job-not-ended"):
    """The job is queued or running: cancel it before you delete it."""


class IdempotencyConflict(ProblemError, slug="idempotency-conflict"):
    """The idempotency key was used with another body."""


class ReportConflict(ProblemError, slug="report-conflict"):
    """The period, or the correction, was reported with other content."""


class ReportGap(ProblemError, slug="report-gap"):
    """The period, or the correction, is not the one expected; ``rule`` names that one."""


class Unconfirmed(ProblemError, slug="unconfirmed"):
    """The report is probably a mistake, and ``doubts`` lists the reasons. If it is correct, send it with
    ``confirm=True``. If periods are missing, ``missing`` lists their last days. Report each of them with
    ``missing=True`` and its ``date``, and then the period itself."""

    def __init__(self, problem: wire.ProblemDocument, retry_after: float | None = None) -> None:
        super().__init__(problem, retry_after)
        self.doubts: list[wire.Doubt] = problem.get("doubts") or []


class SessionCompleted(ProblemError, slug="session-completed"):
    """The session has reached its horizon."""


class BodyTooLarge(ProblemError, slug="body-too-large"):
    """The body is larger than the service accepts."""


class QuotaExceeded(ProblemError, slug="quota-exceeded"):
    """The tenant's quota is used up; ``rule`` gives the quota and says what to delete."""


class InvalidHeader(ProblemError, slug="invalid-header"):
    """A header of the call breaks a rule; ``field`` names it."""


class Misdirected(ProblemError, slug="misdirected"):
    """The service does not accept the host name of the request; ``rule`` lists those it accepts."""


class QueueFull(ProblemError, slug="queue-full"):
    """The tenant has as many queued jobs as it is allowed, even after the last retry."""


class TooManyRequests(ProblemError, slug="too-many-requests"):
    """The tenant of the key exceeds its rate limit, even after the last retry."""


class Overloaded(ProblemError, slug="overloaded"):
    """The service cannot answer now, even after the last retry."""


class StorageFull(ProblemError, slug="storage-full"):
    """The data folder of the service is full: its operator must act."""


class Internal(ProblemError, slug="internal"):
    """The service failed; its log says why."""


def of_response(response: httpx.Response, retry_after: float | None) -> ProblemError:
    """Returns the exception for an unsuccessful answer, whether the service sent it or a proxy did."""
    problem: wire.ProblemDocument = {
        "type": "about:blank",
        "title": response.reason_phrase or "Error",
        "status": response.status_code,
        "detail": response.text[:200],
    }
    if response.headers.get("content-type", "").startswith("application/problem+json"):
        with suppress(ValueError):
            problem.update(response.json())
    kind = ProblemError.kinds.get(problem["type"].rpartition("/")[2], ProblemError)
    return kind(problem, retry_after)
