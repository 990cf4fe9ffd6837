"""The advice on several assets as a scikit-learn estimator. It needs scikit-learn: ``pip install
'ballast-client[sklearn]'``. Only this module and :mod:`ballast.skfolio` import it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.base import BaseEstimator
from sklearn.utils.validation import check_is_fitted, validate_data
from typing_extensions import Self

from . import wire
from .client import Ballast

#: The default address of the service.
URL = "http://127.0.0.1:8080"


class Advised:
    """Base of the estimators of this package. It keeps the arguments of the constructor and calls the service."""

    url: str
    rate_per_step: float | None
    bank: str | int | None
    weights_: NDArray[np.float64]

    #: Arguments of the constructor that are fields of the problem.
    _PROBLEM = (
        "initial_wealth",
        "risk_aversion",
        "utility",
        "radius",
        "ground_norm",
        "limits",
        "means",
        "action_interval",
        "caution",
        "support",
        "periods_per_year",
    )

    def _fit(self, X: Any) -> None:
        table: NDArray[np.float64] = validate_data(self, X, dtype=np.float64, ensure_min_samples=2)
        columns = list(getattr(X, "columns", [f"x{number}" for number in range(table.shape[1])]))
        if (self.bank is None) == (self.rate_per_step is None):
            raise ValueError("rate_per_step and bank: exactly one of the two must be given")
        bank = None if self.bank is None else _place(self.bank, columns)
        rate = float(self.rate_per_step or 0.0) if bank is None else float(table[-1, bank])
        assets = [place for place in range(len(columns)) if place != bank]
        problem = {name: getattr(self, name) for name in self._PROBLEM}
        names = [str(columns[asset]) for asset in assets]
        # Dates are left out, because the rows of a validation may have gaps. The unit is given, because the fractions
        # of a calm window could be read as percent.
        choices: wire.Choices = {"unit": "fraction"}
        with Ballast(self.url) as ballast:
            advice = ballast.advise_assets(
                table[:, assets], kind="simple", choices=choices, rate_per_step=rate, assets=names, **problem
            )
        self.advice_: wire.AssetsAdvised = advice
        self.rate_per_step_ = rate
        weights = np.zeros(len(columns))
        weights[assets] = [advice["allocation"][name] for name in names]
        if bank is not None:
            weights[bank] = 1.0 - math.fsum(weights)
        self.weights_ = weights


class RobustAllocation(Advised, BaseEstimator):
    """A robust allocation to several assets, as ``Ballast.advise_assets`` advises.

    ``X`` has the simple returns of an asset in each column, as fractions, the oldest period first. Give either
    ``rate_per_step``, what the bank pays per period, or ``bank``, a column of ``X`` with the rates of the bank. The
    column is named in a DataFrame and numbered in an array. It is not an asset, and its last number is used.

    ``url`` is the address of the service, and the key comes from ``BALLAST_KEY``. ``initial_wealth``,
    ``risk_aversion``, ``utility``, ``radius``, ``ground_norm``, ``limits``, ``means``, ``action_interval``,
    ``caution``, ``support`` and ``periods_per_year`` are fields of the problem of ``POST /advise``. The service chooses
    those you leave out.

    After ``fit``, ``weights_`` is the share of wealth in each column of ``X``: the advised share in each asset, and the
    rest in the column ``bank``. Without that column the rest is also in the bank, but the weights sum to less than 1.
    ``advice_`` is the whole answer, and ``rate_per_step_`` the rate that was used.
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
    ) -> None:
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

        Raises ``ValueError`` if ``X`` or an argument is invalid, and what ``Ballast.advise_assets`` raises.
        """
        self._fit(X)
        return self

    def predict(self, X: Any) -> NDArray[np.float64]:
        """Returns an array of the shape of ``X`` that repeats the weights in every row.

        Raises ``sklearn.exceptions.NotFittedError`` before ``fit``, and ``ValueError`` if the columns differ from those
        of ``fit``.
        """
        check_is_fitted(self)
        rows: NDArray[np.float64] = validate_data(self, X, reset=False, dtype=np.float64)
        return np.tile(self.weights_, (len(rows), 1))


def _place(bank: str | int, columns: Sequence[Any]) -> int:
    """Returns the index of the column, from 0. A negative number counts from the end."""
    places = range(len(columns))
    if isinstance(bank, int) and -len(places) <= bank < len(places):
        return places[bank]
    if bank not in columns:
        raise ValueError(f"bank is {bank!r}: must be one of the columns {columns}")
    return columns.index(bank)
