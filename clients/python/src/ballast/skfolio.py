"""The advice on several assets as an optimiser of skfolio. It needs skfolio: ``pip install 'ballast-client[skfolio]'``;
no other module of this package imports it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from skfolio.optimization import BaseOptimization
from typing_extensions import Self

from . import wire
from .sklearn import URL, Advised


class RobustAllocation(Advised, BaseOptimization):
    """:class:`ballast.sklearn.RobustAllocation` for skfolio, with the same arguments and attributes.

    ``portfolio_params``, ``fallback``, ``previous_weights`` and ``raise_on_failure`` are arguments of skfolio.
    ``predict`` is skfolio's too and returns a ``Portfolio``, so ``cross_val_predict`` runs a walk-forward. skfolio pays
    no interest on wealth that is in none of its columns. Therefore ``bank`` should name a column with the returns of
    the bank.
    """

    def __init__(
        self,
        *,
        url: str = URL,
        rate_per_step: float | None = None,
        bank: str | int | None = None,
        initial_wealth: float | None = None,
        risk_aversion: float | None = None,
        utility: wire.UtilitySpecification | None = None,
        radius: wire.RadiusRule | None = None,
        ground_norm: wire.GroundNorm | None = None,
        limits: wire.WeightLimits | None = None,
        means: wire.MeansRule | None = None,
        action_interval: Sequence[float] | None = None,
        caution: wire.CautionLevel | None = None,
        support: wire.Support | None = None,
        periods_per_year: float | None = None,
        portfolio_params: dict[str, Any] | None = None,
        fallback: Any = None,
        previous_weights: Any = None,
        raise_on_failure: bool = True,
    ) -> None:
        super().__init__(
            portfolio_params=portfolio_params,
            fallback=fallback,
            previous_weights=previous_weights,
            raise_on_failure=raise_on_failure,
        )
        self.url = url
        self.rate_per_step = rate_per_step
        self.bank = bank
        self.initial_wealth = initial_wealth
        self.risk_aversion = risk_aversion
        self.utility = utility
        self.radius = radius
        self.ground_norm = ground_norm
        self.limits = limits
        self.means = means
        self.action_interval = action_interval
        self.caution = caution
        self.support = support
        self.periods_per_year = periods_per_year

    def fit(self, X: Any, y: object = None) -> Self:
        """Asks the service for the advice on the returns ``X``; ``y`` is not used.

        Raises what :meth:`ballast.sklearn.RobustAllocation.fit` raises, unless ``raise_on_failure`` is ``False`` or
        there is a ``fallback``.
        """
        self._fit(X)
        return self
