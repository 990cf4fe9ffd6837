"""Several assets walked forward: what is asked for, and the job with its report."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

from . import frames, wire
from .driving import Answering, blocking
from .training import AsyncJob, Job, Watch, _Job

if TYPE_CHECKING:
    import pandas as pd


class _AssetsWalkForward(_Job):
    """A job that ends in a report on several assets; ``Ballast.assets_walk_forward(id)`` finds it again."""

    async def _report(self, watch: Watch | None = None) -> wire.AssetsBacktestReport:
        """Waits for the end of the walk-forward, showing each change to ``watch``.

        Raises :class:`JobEnded` where the job fails or is cancelled.
        """
        return cast(wire.AssetsBacktestReport, await self._ended(watch))

    async def _frame(self, watch: Watch | None = None) -> pd.DataFrame:
        """The report's strategies, one a row (:func:`ballast.frames.walk_forward`). Waits as ``report`` does, and
        raises what it raises, and ``ImportError`` without pandas."""
        return frames.walk_forward(await self._report(watch))

    async def _periods(self, figure: frames.Figure = "wealth", watch: Watch | None = None) -> pd.DataFrame:
        """What each strategy did or had, by date: ``"wealth"``, ``"traded"`` or ``"radius"``
        (:func:`ballast.frames.periods`). Waits as ``report`` does, and raises what it raises, ``ValueError`` for
        another figure and ``ImportError`` without pandas."""
        return frames.periods(await self._report(watch), figure)

    async def _held(self, strategy: str | None = None, watch: Watch | None = None) -> pd.DataFrame:
        """The share of wealth in each asset: of one strategy by date, or without one on average, a strategy a row
        (:func:`ballast.frames.held`). Waits as ``report`` does, and raises what it raises, ``ValueError`` for a
        strategy that there is not and ``ImportError`` without pandas."""
        return frames.held(await self._report(watch), strategy)


class AssetsWalkForward(Job, _AssetsWalkForward):
    __doc__ = _AssetsWalkForward.__doc__

    report = Answering(wire.AssetsBacktestReport).blocking(_AssetsWalkForward._report)
    frame = blocking(_AssetsWalkForward._frame)
    periods = blocking(_AssetsWalkForward._periods)
    held = blocking(_AssetsWalkForward._held)


class AsyncAssetsWalkForward(AsyncJob, _AssetsWalkForward):
    """An :class:`AssetsWalkForward` whose calls are awaited."""

    report = _AssetsWalkForward._report
    frame = _AssetsWalkForward._frame
    periods = _AssetsWalkForward._periods
    held = _AssetsWalkForward._held
