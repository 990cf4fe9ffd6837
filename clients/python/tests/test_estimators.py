"""Estimators of scikit-learn and skfolio: their weights are the advice of the service for the fitted rows."""

from __future__ import annotations

import inspect
import math
from typing import Any

import httpx
import numpy as np
import pandas as pd
import pytest
from conftest import REPOSITORY, Service
from skfolio.model_selection import WalkForward
from skfolio.model_selection import cross_val_predict as walked
from skfolio.optimization import BaseOptimization
from skfolio.portfolio import FailedPortfolio
from sklearn.base import clone
from sklearn.exceptions import NotFittedError
from sklearn.model_selection import KFold, ParameterGrid, cross_val_predict

from ballast import InvalidField, wire
from ballast.skfolio import RobustAllocation as Optimiser
from ballast.sklearn import RobustAllocation

ASSETS = ["utilities", "health", "energy"]
BANK = "risk_free_return"
#: The radius of the tests, small enough that something is held.
RADIUS: wire.RadiusRule = {"rule": "bridge", "alpha": 0.5, "scale": 0.25}


@pytest.fixture(scope="module")
def returns() -> pd.DataFrame:
    """Twelve years of three industries and the bank."""
    whole = pd.read_csv(REPOSITORY / "data/us_industries_monthly.csv", index_col="date", parse_dates=True)
    return whole.loc["1985":"1996", [*ASSETS, BANK]]  # type: ignore[misc]


def advised(service: Service, record: pd.DataFrame) -> dict[str, Any]:
    """Requests the advice for a record without this package."""
    problem = {
        "assets": ASSETS,
        "history": [[math.log1p(value) for value in row] for row in record[ASSETS].to_numpy()],
        "rate_per_step": record[BANK].iloc[-1],
        "radius": RADIUS,
    }
    answer = httpx.post(f"{service.url}/advise", json={"problem": problem}, timeout=60.0)
    assert answer.is_success, answer.text
    found: dict[str, Any] = answer.json()
    return found


def test_the_weights_are_the_advice(service: Service, returns: pd.DataFrame) -> None:
    past, coming = returns[:60], returns[60:66]
    estimator = RobustAllocation(url=service.url, bank=BANK, radius=RADIUS)
    with pytest.raises(NotFittedError):
        estimator.predict(coming)
    assert estimator.fit(past) is estimator
    advice = advised(service, past)
    assert dict(zip(ASSETS, estimator.weights_, strict=False)) == advice["allocation"]
    assert 0.1 < advice["total"] < 1.0 and estimator.weights_[-1] == pytest.approx(1.0 - advice["total"])
    assert estimator.advice_["bound"] == advice["bound"] and estimator.rate_per_step_ == past[BANK].iloc[-1]
    assert list(estimator.feature_names_in_) == [*ASSETS, BANK]
    assert estimator.predict(coming).tolist() == [estimator.weights_.tolist()] * 6
    with pytest.raises(ValueError, match="feature names"):
        estimator.predict(coming[[*ASSETS[::-1], BANK]])


def test_an_array_and_a_rate_give_the_same_as_a_column_of_the_bank(service: Service, returns: pd.DataFrame) -> None:
    past = returns[:60]
    named = RobustAllocation(url=service.url, bank=BANK, radius=RADIUS).fit(past)
    placed = RobustAllocation(url=service.url, bank=-1, radius=RADIUS).fit(past.to_numpy())
    rate = past[BANK].iloc[-1]
    alone = RobustAllocation(url=service.url, rate_per_step=rate, radius=RADIUS).fit(past[ASSETS])
    assert named.weights_.tolist() == placed.weights_.tolist() == [*alone.weights_, named.weights_[-1]]
    assert list(placed.advice_["allocation"]) == ["x0", "x1", "x2"]


def test_it_behaves_as_scikit_learn_expects(service: Service, returns: pd.DataFrame) -> None:
    estimator = RobustAllocation(url=service.url, bank=BANK, radius=RADIUS)
    assert clone(estimator.fit(returns[:60])).get_params() == estimator.get_params()
    held = cross_val_predict(estimator, returns[:90], cv=KFold(3))
    assert held.shape == (90, 4) and held.sum(axis=1) == pytest.approx(np.ones(90))
    first = RobustAllocation(url=service.url, bank=BANK, radius=RADIUS).fit(returns[30:90])
    assert held[0].tolist() == first.weights_.tolist() != held[-1].tolist()
    totals = [
        clone(estimator).set_params(**choice).fit(returns[:60]).advice_["total"]
        for choice in ParameterGrid({"radius": [{"rule": "fixed", "radius": radius} for radius in (0.0, 0.004, 0.05)]})
    ]
    assert totals == sorted(totals, reverse=True) and totals[0] > totals[-1]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({}, "rate_per_step and bank: exactly one of the two must be given"),
        ({"rate_per_step": 0.0, "bank": BANK}, "rate_per_step and bank: exactly one of the two must be given"),
        ({"bank": "cash"}, "bank is 'cash': must be one of the columns"),
        ({"bank": 4}, "bank is 4: must be one of the columns"),
    ],
)
def test_what_cannot_be_meant_is_refused(arguments: dict[str, Any], message: str, returns: pd.DataFrame) -> None:
    with pytest.raises(ValueError, match=message):
        RobustAllocation(url="http://127.0.0.1:1", **arguments).fit(returns)
    with pytest.raises(ValueError, match="NaN"):
        RobustAllocation(url="http://127.0.0.1:1", bank=BANK).fit(returns.mask(returns > 0.1))


def test_skfolio_walks_forward_with_it(service: Service, returns: pd.DataFrame) -> None:
    estimator = Optimiser(url=service.url, bank=BANK, radius=RADIUS, portfolio_params={"compounded": True})
    path = walked(estimator, returns, cv=WalkForward(train_size=60, test_size=12))
    folds = range(60, len(returns) - 11, 12)
    assert len(path.portfolios) == len(folds) == 7
    expected = []
    for start, portfolio in zip(folds, path.portfolios, strict=True):
        advice = advised(service, returns[start - 60 : start])
        weights = [*(advice["allocation"][name] for name in ASSETS), 1.0 - advice["total"]]
        assert portfolio.weights.tolist() == pytest.approx(weights, abs=1e-15)
        expected += (returns[start : start + 12].to_numpy() @ weights).tolist()
    assert path.returns.tolist() == pytest.approx(expected, abs=1e-15)
    assert path.cumulative_returns[-1] == pytest.approx(np.prod(1.0 + np.array(expected)))


def test_a_refusal_goes_the_way_of_skfolio(service: Service, returns: pd.DataFrame) -> None:
    refused = Optimiser(url=service.url, bank=BANK, radius={"rule": "fixed", "radius": -1.0})
    with pytest.raises(InvalidField, match=r"problem\.radius\.radius"):
        refused.fit(returns)
    with pytest.warns(UserWarning, match=r"problem\.radius\.radius"):
        refused.set_params(raise_on_failure=False).fit(returns)
    assert isinstance(refused.predict(returns), FailedPortfolio)


def test_both_take_the_same_arguments(service: Service, returns: pd.DataFrame) -> None:
    optimiser = Optimiser(url=service.url, bank=BANK, radius=RADIUS).fit(returns)
    assert clone(optimiser).get_params() == optimiser.get_params()
    of_skfolio = set(inspect.signature(BaseOptimization.__init__).parameters) - {"self"}
    assert set(optimiser.get_params()) - of_skfolio == set(RobustAllocation().get_params())
    fields = {"rate_per_step", *RobustAllocation._PROBLEM}
    of_a_policy = {"composition", "horizon", "trading_cost", "contributions", "spending"}
    assert fields == set(wire.AssetsProblem.__annotations__) - {"assets", "history"} - of_a_policy
