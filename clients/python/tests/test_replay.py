"""Replays a record through a session: each period is reported once, and the answers are a frame."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
import pytest
from conftest import REPOSITORY, RETURNS, Network, train

from ballast import Ballast, JobEnded, ReportConflict, Session, SessionCompleted, Unreachable

REALISED = pd.Series([0.02, -0.05, 0.01], index=pd.date_range("2008-01-31", periods=3, freq="ME"))


def test_a_record_is_lived_through(session: Session) -> None:
    lived = session.replay(REALISED, kind="simple")
    assert session.completed and list(lived.index) == list(REALISED.index) and list(lived["period"]) == [1, 2, 3]
    wealth = 100.0
    for (allocation, reached), realised in zip(
        lived[["advised_allocation", "wealth"]].to_numpy(), REALISED, strict=True
    ):
        wealth *= (1 - allocation) * 1.001 + allocation * (1 + realised)
        assert reached == pytest.approx(wealth, rel=1e-12)
    assert lived["wealth"].iloc[-1] == session.wealth
    reported = [row["reported"] for row in session.history()["observations"]]
    assert [row.get("date") for row in reported] == ["2008-01-31", "2008-02-29", "2008-03-31"]
    assert [row.get("log_return") for row in reported] == [math.log1p(value) for value in REALISED]


def test_by_hand_and_by_replay_is_the_same(ballast: Ballast, session: Session) -> None:
    lived = session.replay(
        [100.0, 103.0, 99.0], kind="price", executed_allocation=[0.0, 0.5, 0.25], rate=0.002, flow=3.0
    )
    other = ballast.policy(session.policy).session()
    for earlier, later, held in ((100.0, 103.0, 0.5), (103.0, 99.0, 0.25)):
        other.observe(log_return=math.log(later / earlier), executed_allocation=held, rate=0.002, flow=3.0)
    assert list(lived.index) == [1, 2] and session.wealth == other.wealth
    pd.testing.assert_frame_equal(lived, other.frame().drop(columns="corrected"))


def test_a_replay_that_broke_off_is_taken_up_by_the_same_call(
    ballast: Ballast, session: Session, network: Network, pauses: list[float]
) -> None:
    log_returns = [0.02, -0.01, 0.03]
    session.observe(log_return=0.02)
    network.lose_answers(9)
    with pytest.raises(Unreachable):
        session.replay(log_returns, kind="log")
    network._faults.clear()
    lived = session.replay(log_returns, kind="log")
    again = ballast.session(session.id).replay(log_returns, kind="log")
    pd.testing.assert_frame_equal(lived, again)
    assert [row["period"] for row in session.history()["observations"]] == [1, 2, 3]
    # Other content under the same number is refused, and `period` says where a record continues.
    with pytest.raises(ReportConflict):
        session.replay([0.01], kind="log")
    with pytest.raises(SessionCompleted):
        session.replay([0.01], kind="log", period=session.period)


def test_a_record_goes_on_where_the_session_stands(session: Session) -> None:
    session.observe(log_return=0.02)
    lived = session.replay(np.array([0.01, 0.02]), kind="log", period=session.period)
    assert list(lived.index) == [2, 3] and list(session.frame().index) == [1, 2, 3]


def test_what_cannot_be_replayed_is_refused_before_anything_is_sent(session: Session, network: Network) -> None:
    sent = len(network.sent)
    with pytest.raises(ValueError, match=r"returns\[1\] is nan: must be finite"):
        session.replay([0.01, math.nan], kind="log")
    with pytest.raises(ValueError, match="dates has 3 entries: must have 2, one for each entry of returns"):
        session.replay([0.01, 0.02], kind="log", dates=["2008-01-31", "2008-02-29", "2008-03-31"])
    with pytest.raises(ValueError, match="dates has 2008-01-31 after 2008-02-29: must increase"):
        session.replay([0.01, 0.02], kind="log", dates=["2008-02", "2008-01"])
    with pytest.raises(ValueError, match="rate has 1 entries: must have 3, one for each entry of returns"):
        session.replay([1.0, 1.1, 1.0], kind="price", rate=[0.1])
    with pytest.raises(ValueError, match="flow of period 2 is nan: must be finite"):
        session.replay([0.01, 0.02], kind="log", flow=[1.0, math.nan])
    assert len(network.sent) == sent


def test_a_record_is_meant_as_it_is(session: Session) -> None:
    """Neither an unusual return nor a gap in the dates needs a confirmation."""
    lived = session.replay([0.3, 0.01, 0.02], kind="log", dates=["2008-01-31", "2008-02-29", "2008-07-31"])
    assert lived["log_return"].tolist() == [0.3, 0.01, 0.02]


def test_a_session_that_renews_itself_is_replayed_as_the_walk_forward_walks(ballast: Ballast) -> None:
    """Replays four years of the bundled returns: allocations and wealth equal those of `backtest`, bit for bit."""
    market = pd.read_csv(REPOSITORY / "data/us_market_monthly.csv", index_col="month")
    market = market[(market.index >= "1988-01") & (market.index <= "1994-12")]
    window, every, count, seed = 36, 12, 12, 5
    walked = ballast.backtest(
        market["market_return"],
        kind="simple",
        rate=market["risk_free_return"],
        dates=market.index,
        window=window,
        every=every,
        horizon=every + 1,
        alpha=[0.5],
        count=count,
        seed=seed,
    )
    past, lived = market.iloc[:window], market.iloc[window:]
    session = ballast.train(
        past["market_return"],
        kind="simple",
        rate_per_step=past["risk_free_return"].iloc[-1],
        horizon=every + 1,
        utility={"kind": "power", "risk_aversion": 3.0},
        radius={"rule": "bridge", "alpha": 0.5},
        support={"rule": "none"},
        design={"count": count},
        seed=seed,
    ).session(wealth=100.0, renew={"every": every, "window": window})
    replayed = session.replay(lived["market_return"], kind="simple", rate=lived["risk_free_return"])
    assert session.refresh().renewals == 3
    assert list(replayed.index) == list(lived.index)
    assert replayed["advised_allocation"].tolist() == walked.periods("allocation").iloc[:, 0].tolist()
    assert replayed["wealth"].tolist() == walked.periods().iloc[:, 0].tolist()
    assert replayed["advised_allocation"].nunique() > 12


def test_a_renewal_that_fails_ends_a_replay(session: Session, network: Network) -> None:
    due = '{"renewal": {"renewal": 1, "state": "failed", "job": "job_x", "attempts": 1}, "renew": {"every": 1}'
    state = (
        ', "renewals": 0, "policy": "p", "horizon": 3, "corrections": 0, '
        '"state": "waiting", "period": 2, "wealth": 1.0, "holding": 0.0}'
    )
    network.answer(200, text=due + state)
    network.answer(200, text=due + state)
    network.answer(200, text='{"job": "job_x", "state": "failed", "error": "no memory"}')
    with pytest.raises(JobEnded, match="job_x ended as failed: no memory"):
        session.replay(RETURNS[:1], kind="log")
    assert network.sent[-1] == ("GET", "/jobs/job_x")


def test_nothing_is_reported_where_the_answer_could_not_be_given(
    ballast: Ballast, network: Network, monkeypatch: pytest.MonkeyPatch
) -> None:
    session = train(ballast, idempotency_key="the policy of the tests").session()
    sent = len(network.sent)
    monkeypatch.setitem(__import__("sys").modules, "pandas", None)
    with pytest.raises(ImportError, match="pip install"):
        session.replay([0.01], kind="log")
    assert len(network.sent) == sent
