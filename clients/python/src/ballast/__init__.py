"""Client of Ballast, a service that advises investors robustly.

    from ballast import Ballast

    with Ballast("http://127.0.0.1:8080") as ballast:
        session = ballast.train(returns, rate_per_step=0.0025, horizon=12).session()
        while not session.completed:
            allocation = session.action()["allocation"]
            session.observe(simple_return=...)

:class:`AsyncBallast` is the same client for asyncio. Requests and answers are the JSON of the service, typed in
:mod:`ballast.wire`. :mod:`ballast.frames` converts answers to pandas objects, and :mod:`ballast.plots` draws them.
:mod:`ballast.errors` has the exceptions.
"""

from . import frames, plots, wire
from .client import AsyncBallast, Ballast
from .errors import (
    BallastError,
    BodyTooLarge,
    DamagedPolicy,
    Forbidden,
    IdempotencyConflict,
    Internal,
    InUse,
    InvalidField,
    InvalidHeader,
    InvalidQuery,
    JobEnded,
    JobNotEnded,
    Misdirected,
    NotFound,
    Overloaded,
    ProblemError,
    QueueFull,
    QuotaExceeded,
    Repeating,
    ReportConflict,
    ReportGap,
    SessionCompleted,
    StorageFull,
    TooManyRequests,
    Unauthenticated,
    UnclearReturns,
    Unconfirmed,
    Unreachable,
)
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
from .policy import AsyncPolicy, Policy
from .problem import Expression, Problem, symbols
from .progress import ProgressBar, ProgressPrinter
from .session import AsyncSession, Session

__all__ = [
    "AssetsWalkForward",
    "AsyncAssetsWalkForward",
    "AsyncBallast",
    "AsyncComparison",
    "AsyncDeclaredWalkForward",
    "AsyncEvaluation",
    "AsyncFrontier",
    "AsyncPolicy",
    "AsyncSession",
    "AsyncTraining",
    "AsyncWalkForward",
    "Ballast",
    "BallastError",
    "BodyTooLarge",
    "Comparison",
    "DamagedPolicy",
    "DeclaredWalkForward",
    "Evaluation",
    "Expression",
    "Forbidden",
    "Frontier",
    "IdempotencyConflict",
    "InUse",
    "Internal",
    "InvalidField",
    "InvalidHeader",
    "InvalidQuery",
    "JobEnded",
    "JobNotEnded",
    "Misdirected",
    "NotFound",
    "Overloaded",
    "Policy",
    "Problem",
    "ProblemError",
    "ProgressBar",
    "ProgressPrinter",
    "QueueFull",
    "QuotaExceeded",
    "Repeating",
    "ReportConflict",
    "ReportGap",
    "Session",
    "SessionCompleted",
    "StorageFull",
    "TooManyRequests",
    "Training",
    "Unauthenticated",
    "UnclearReturns",
    "Unconfirmed",
    "Unreachable",
    "WalkForward",
    "frames",
    "plots",
    "symbols",
    "wire",
]
