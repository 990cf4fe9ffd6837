"""What can go wrong, as exceptions.

A refusal of the service is a :class:`ProblemError` with the parts of its problem document (RFC 9457); the kinds that a
program may want to tell apart have a class of their own, found by the last part of the document's ``type``. A kind that
this client does not know yet is a plain :class:`ProblemError`.
"""

from __future__ import annotations

from contextlib import suppress
from typing import Any, ClassVar

import httpx

from . import wire


class BallastError(Exception):
    """Everything this package raises, but for arguments that cannot be sent at all (``ValueError``, ``TypeError``)."""


class Unreachable(BallastError):
    """No answer came, and the request may have been carried out all the same. Where it can be sent again without harm,
    the method that sent it says so."""


class Repeating(RuntimeWarning):
    """Warns, once a call, that no answer has come and that the request is sent again: why, and for how long."""


class DamagedPolicy(BallastError):
    """The bytes of an exported policy do not hash to its name."""


class UnclearReturns(BallastError, ValueError):
    """Returns that can be read in more than one way. ``argument`` is the one that they were given as, and ``questions``
    what the service asks, each with its ``options``, whose ``choices`` settle it."""

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
            [f"{self.argument} can be read in more than one way: say which by {' and '.join(by)}.", *lines]
        )


class JobEnded(BallastError):
    """A job that was waited for failed or was cancelled. ``job`` is its last state."""

    def __init__(self, job: wire.Job) -> None:
        super().__init__(job)
        self.job = job

    def __str__(self) -> str:
        return f"the job {self.job['job']} ended as {self.job['state']}: {self.job.get('error') or 'no reason given'}"


class ProblemError(BallastError):
    """The service refused: ``type``, ``title``, ``status``, ``detail`` and, where a field is at fault, ``field``,
    ``value`` and ``rule``. ``retry_after`` is the pause the service asked for, in seconds."""

    kinds: ClassVar[dict[str, type[ProblemError]]] = {}

    def __init_subclass__(cls, slug: str, **rest: Any) -> None:
        super().__init_subclass__(**rest)
        cls.kinds[slug] = cls

    def __init__(self, problem: wire.Problem, retry_after: float | None = None) -> None:
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
    """The service asks for a key, and was shown none that is in force."""


class Forbidden(ProblemError, slug="forbidden"):
    """The key lacks the role that the call needs; ``rule`` names it."""


class NotFound(ProblemError, slug="not-found"):
    """There is no such job, policy or session."""


class InUse(ProblemError, slug="in-use"):
    """Sessions live by the policy."""


class JobNotEnded(ProblemError, slug="job-not-ended"):
    """The job is queued or runs: cancel it before it is deleted."""


class IdempotencyConflict(ProblemError, slug="idempotency-conflict"):
    """The idempotency key was used with another body."""


class ReportConflict(ProblemError, slug="report-conflict"):
    """The period, or the correction, was reported with other content."""


class ReportGap(ProblemError, slug="report-gap"):
    """The period, or the correction, is not the one expected; ``rule`` names that one."""


class Unconfirmed(ProblemError, slug="unconfirmed"):
    """The report is most likely a slip: ``doubts`` says all that is doubted in it. If it is meant, send it with
    ``confirm=True``. A doubt of missing periods lists their last days as ``missing``: report each of them with
    ``missing=True`` and its ``date``, and then the period itself."""

    def __init__(self, problem: wire.Problem, retry_after: float | None = None) -> None:
        super().__init__(problem, retry_after)
        self.doubts: list[wire.Doubt] = problem.get("doubts") or []


class SessionCompleted(ProblemError, slug="session-completed"):
    """The session has reached its horizon."""


class BodyTooLarge(ProblemError, slug="body-too-large"):
    """The body is larger than the service takes."""


class QuotaExceeded(ProblemError, slug="quota-exceeded"):
    """The tenant keeps as much as it may; ``rule`` says how much that is and what to delete."""


class InvalidHeader(ProblemError, slug="invalid-header"):
    """A header of the call breaks a rule; ``field`` names it."""


class Misdirected(ProblemError, slug="misdirected"):
    """The service does not answer to the host name it was asked by; ``rule`` says which it answers to."""


class QueueFull(ProblemError, slug="queue-full"):
    """The tenant has as many jobs queued as it may, and still did at the last of the repetitions."""


class TooManyRequests(ProblemError, slug="too-many-requests"):
    """The tenant of the key calls too often, and still did at the last of the repetitions."""


class Overloaded(ProblemError, slug="overloaded"):
    """The service cannot answer now, and could not at the last of the repetitions."""


class StorageFull(ProblemError, slug="storage-full"):
    """The data folder of the service is full: its operator must act."""


class Internal(ProblemError, slug="internal"):
    """The service failed; its log says why."""


def of_response(response: httpx.Response, retry_after: float | None) -> ProblemError:
    """The exception of an answer that is not a success, be it of the service or of something in between."""
    problem: wire.Problem = {
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
