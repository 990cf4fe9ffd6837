"""The whole workflow: train, open a session, get advice, report, and read the history."""

from __future__ import annotations

import inspect
import json
import math
from typing import Any, cast

import numpy as np
import pytest
from conftest import REPOSITORY, RETURNS, Network, compare, train, walk

import ballast as package
from ballast import Ballast, Session, frames, wire
from ballast.policy import Opening


def test_an_investor_lives_to_the_horizon(session: Session) -> None:
    rate, wealth, realised = 0.001, session.wealth, [0.02, -0.04, 0.01]
    assert (session.period, session.horizon, wealth) == (1, 3, 100.0)
    for number, simple_return in enumerate(realised, start=1):
        action = session.action()
        allocation = action["allocation"]
        assert action["period"] == session.period == number
        assert action["certainty_equivalent"] >= action["floor"]
        wealth *= (1 - allocation) * (1 + rate) + allocation * (1 + simple_return)
        assert session.observe(simple_return=simple_return) is session
        assert session.wealth == pytest.approx(wealth, rel=1e-12)
        assert session.observed is not None
        assert session.observed["sample_size"] == len(RETURNS) + number
        assert session.observed["completed"] == session.completed == (number == 3)
    with pytest.raises(package.SessionCompleted):
        session.action()
    with pytest.raises(package.SessionCompleted) as refusal:
        session.observe(simple_return=0.0)
    assert (refusal.value.field, refusal.value.value, refusal.value.rule) == ("period", 4, "must be at most 3")
    history = session.history()
    assert history["history"] == RETURNS
    assert [row["log_return"] for row in history["observations"]] == pytest.approx([math.log1p(r) for r in realised])
    assert history["observations"][-1]["wealth"] == session.wealth


def test_the_chain_of_the_readme(ballast: Ballast) -> None:
    action = train(ballast).session(wealth=100.0).observe(log_return=0.01).action(explain="worst_case")
    assert action["period"] == 2 and 0.0 <= action["allocation"] <= 1.0
    worst = action.get("worst_case")
    assert worst is not None and sum(move["mass"] for move in worst["transport"]) == pytest.approx(1.0)


def test_advice_without_a_policy(ballast: Ballast) -> None:
    simple = [math.expm1(value) for value in RETURNS]
    advised = ballast.advise(
        simple,
        kind="simple",
        rate_per_step=0.002,
        wealth=250.0,
        holding=0.5,
        utility={"kind": "log"},
        radius={"rule": "fixed", "radius": 1e-4},
    )
    assert advised["trade"] == pytest.approx(advised["allocation"] - 0.5)
    assert advised["certainty_equivalent"] >= advised["floor"] and advised["worst_case"]["sentence"]
    with pytest.raises(package.InvalidField) as refusal:
        ballast.advise(simple, kind="simple", rate_per_step=0.002, horizon=3)
    assert refusal.value.field == "problem.horizon"


def test_a_plan(ballast: Ballast) -> None:
    simple = [math.expm1(value) for value in RETURNS]
    terms: dict[str, Any] = {"kind": "simple", "rate_per_step": 0.002, "radius": {"rule": "fixed", "radius": 1e-3}}
    plan = ballast.plan(
        simple, horizon=12, wealth=250.0, wanted=10.0, paths=500, spending={"inflation": 0.001}, **terms
    )
    assert len(plan["periods"]) == 12 and plan["sentences"] and 0.0 <= plan["wanted"]["lasts"]["worst"]["value"] <= 1.0
    spending = plan["advice"].get("spending")
    assert spending is not None and spending["amount"] == pytest.approx(250.0 * spending["share"])
    aimed = ballast.plan(simple, horizon=12, wealth=250.0, goal=280.0, saved=1.0, aim="goal", paths=500, **terms)
    states = aimed.get("states")
    assert states is not None and states["described_by"] == "funded" and not aimed["periods"]
    limited = ballast.plan(simple, horizon=12, drawdown_limit=0.1, drawdown=0.02, paths=500, **terms)
    assert limited["strategies"][0]["max_drawdown"]["worst"]["value"] <= 0.1 + 1e-9
    with pytest.raises(package.InvalidField) as refusal:
        ballast.plan(simple, horizon=12, certainty=1.0, **terms)
    assert refusal.value.field == "certainty"


def test_the_share_of_a_strategy(ballast: Ballast) -> None:
    terms: dict[str, Any] = {"kind": "log", "rate_per_step": 0.0, "caution": {"scale": 0.2}}
    sleeve = ballast.sleeve(RETURNS, record_of="trades", **terms)
    advised = ballast.advise(RETURNS, utility={"kind": "log"}, **terms)
    assert sleeve["share"] == advised["allocation"] and sleeve["read"]
    kelly = sleeve["kelly"]
    assert kelly is not None and sleeve["share"] <= kelly and sleeve["sentences"]
    with pytest.raises(package.InvalidField) as refusal:
        ballast.sleeve(RETURNS, utility={"kind": "power", "risk_aversion": 3}, **terms)
    assert refusal.value.field == "problem.utility.kind"


def test_a_declared_problem(ballast: Ballast) -> None:
    declared = json.loads((REPOSITORY / "examples/problems/stock.json").read_text())
    declared["problem"]["horizon"], declared["design"] = 2, {"count": 20}
    policy = ballast.submit(declared, name="The shop").policy()
    first = policy.decide()
    assert first == policy.decide(period=1, state={"stock": 4.0})
    assert first["period"] == 1 and 0.0 <= first["actions"]["order"] <= 56.0
    assert sum(move["share"] for move in first["worst_law"]) == pytest.approx(1.0)
    assert policy.decide(period=2, state={"stock": 0}, noises=[20])["value"] < first["value"]
    problem = cast(wire.DeclaredProblem, policy.detail()["specification"]["problem"])
    assert problem["states"]["stock"]["start"] == 4.0
    with pytest.raises(package.InvalidField) as refusal:
        policy.decide(period=2, state={"stock": 0})
    assert refusal.value.field == "noises"
    with pytest.raises(package.InvalidField) as refusal:
        policy.session(wealth=100.0)
    assert refusal.value.field == "wealth"
    compared = ballast.compare({"robust": policy}, rules={"base": {"order": "max(25 - stock, 0)"}}, paths=200)
    frame = compared.frame()
    assert list(frame.index) == ["robust", "base"] and list(frame["is_rule"]) == [False, True]
    base = frame.loc["base"]
    assert base["difference_low"] < base["difference"] < base["difference_high"]
    assert frame.loc["robust", "robust_value"] == pytest.approx(first["value"])
    assert ballast.comparison(compared.id).report()["problem"]["horizon"] == 2


def test_frameworks_and_rules_of_a_declared_problem(ballast: Ballast) -> None:
    declared = cast(wire.DeclaredSpecification, json.loads((REPOSITORY / "examples/problems/stock.json").read_text()))
    declared["problem"]["horizon"], declared["design"] = 2, {"count": 20}
    rules = {"base": {"order": "max(25 - stock, 0)"}}
    compared = ballast.compare(
        specification=declared, frameworks=["adaptive", "known_law"], rules=rules, paths=200, seed=3
    )
    frame = compared.frame()
    assert list(frame.index) == ["adaptive", "known_law", "base"]
    assert frame.loc["known_law", "robust_value"] > frame.loc["adaptive", "robust_value"]
    declared["problem"]["history"] = [9.1, 27.3, 11.6, 19.0, 22.3, 21.1, 18.7, 14.0]
    walk = ballast.backtest_declared(declared, window=5, frameworks=["adaptive", "plug_in"], rules=rules)
    frame = walk.frame()
    assert list(frame.index) == ["adaptive", "plug_in", "base"] and math.isnan(frame.loc["adaptive", "difference"])
    base = ballast.declared_walk_forward(walk.id).periods("base")
    assert list(base.columns) == ["noise", "reward", "radius", "state.stock", "action.order"]
    assert list(base["noise"]) == [21.1, 18.7, 14.0] and base["radius"].isna().all()
    assert list(base["action.order"]) == [25 - stock for stock in base["state.stock"]]
    assert frame.loc["base", "earned"] == pytest.approx(base["reward"].sum())
    assert walk.periods()["radius"].iloc[0] > 0.0
    with pytest.raises(ValueError, match="no strategy 'bass': adaptive, plug_in, base"):
        walk.periods("bass")


def test_a_session_of_a_declared_problem(ballast: Ballast) -> None:
    declared = json.loads((REPOSITORY / "examples/problems/stock.json").read_text())
    declared["problem"]["horizon"], declared["design"] = 3, {"count": 20}
    policy = ballast.submit(declared).policy()
    session = policy.session(state={"stock": 7.0}, idempotency_key="the shop", name="The shop")
    assert policy.session(state={"stock": 7.0}, idempotency_key="the shop", name="The shop").id == session.id
    assert session.states == {"stock": 7.0} and session.earned == 0.0 and math.isnan(session.wealth)
    advised = session.actions()
    decided = policy.decide(state={"stock": 7.0})
    assert advised["actions"] == decided["actions"] and advised["worst_law"] == decided["worst_law"]
    assert session.frame().empty
    session.observe(noise=18.5, executed={"order": 12}, date="2026-01-31")
    moved = session.moved
    assert moved is not None and moved["advised"] == advised["actions"] and moved["noise"] == 18.5
    # 18.5 of 19 are sold for 9, 12 were bought for 5, and 0.5 is held at 0.5.
    assert session.states == {"stock": 0.5} and session.earned == pytest.approx(9 * 18.5 - 5 * 12 - 0.25)
    coming = session.actions()
    assert coming["actions"] == policy.decide(period=2, state={"stock": 0.5}, noises=[18.5])["actions"]
    session.observe(noise=25.0, state={"stock": 1.5})
    assert session.states == {"stock": 1.5}
    session.correct(1, "it was counted again", noise=10.0, executed={"order": 12})
    assert session.corrections == 1 and session.states == {"stock": 1.5}
    found = ballast.session(session.id)
    assert (found.period, found.states, found.earned) == (3, session.states, session.earned)
    frame = session.frame()
    assert list(frame.index) == [1, 2] and list(frame["state.stock"]) == [9.0, 1.5]
    assert list(frame["executed.order"]) == [12.0, coming["actions"]["order"]]
    assert frame["advised.order"].tolist() == [advised["actions"]["order"], coming["actions"]["order"]]
    assert str(frame["date"].iloc[0].date()) == "2026-01-31" and frame["earned"].iloc[-1] == pytest.approx(
        session.earned
    )
    axes = session.plot()
    assert [line.get_label() for line in axes.get_lines()] == ["stock"]
    assert list(cast(Any, axes.get_lines()[0].get_ydata())) == [7.0, 9.0, 1.5]
    with pytest.raises(package.InvalidField) as refusal:
        session.observe(noise=41.0)
    assert refusal.value.field == "noise" and session.period == 3
    supposed = cast(dict[str, Any], session.what_if(state={"stock": 1.5}, radius_scale=1.0))
    assert supposed["actions"] == session.actions()["actions"]
    assert session.observe(noise=20.0).completed
    with pytest.raises(package.SessionCompleted):
        session.actions()
    renewed = cast(wire.DeclaredRenewed, session.renew(policy.id))
    assert (session.period, session.horizon, session.renewals, session.completed) == (4, 6, 1, False)
    assert renewed["problem"]["horizon"] == 3
    assert session.actions()["actions"] == policy.decide(state=session.states)["actions"]
    session.delete()


def test_advice_on_several_assets(ballast: Ballast) -> None:
    rows = [[value, value * value - 0.0005] for value in RETURNS]
    advised = ballast.advise_assets(
        rows, kind="log", assets=["stocks", "bonds"], rate_per_step=0.0, radius={"rule": "fixed", "radius": 1e-4}
    )
    assert sum(advised["allocation"].values()) == pytest.approx(advised["total"])
    assert set(advised["composition"]) == set(advised["worst_means"]) == {"stocks", "bonds"}
    assert advised["bound"] >= advised["certainty_equivalent"] >= advised["floor"]
    with pytest.raises(ValueError, match=r"returns: line 3: bonds is \"-1.0\": must be above -1"):
        ballast.advise_assets(
            [[0.1, 0.1], [-0.1, -1.0]], choices={"unit": "fraction"}, assets=["stocks", "bonds"], rate_per_step=0.0
        )
    with pytest.raises(ValueError, match="assets is None: must name the columns"):
        ballast.advise_assets(rows, kind="log", rate_per_step=0.0)


def test_a_session_of_several_assets(ballast: Ballast) -> None:
    pd = pytest.importorskip("pandas")
    record = pd.DataFrame({"stocks": RETURNS, "bonds": [value * value - 0.0005 for value in RETURNS]})
    training = ballast.train_assets(
        record, kind="log", rate_per_step=0.0, horizon=2, radius={"rule": "fixed", "radius": 1e-4}, design={"count": 20}
    )
    policy = training.policy()
    moved = policy.session(history=record[["bonds", "stocks"]], kind="log", holdings={"stocks": 0.5, "bonds": 0.0})
    np.testing.assert_allclose(cast("Any", moved.history()["history"]), record.to_numpy(), atol=1e-15)
    assert moved.assets_action()["holdings"]["stocks"] == 0.5
    with pytest.raises(ValueError, match="must have those of the policy"):
        policy.session(history=record.rename(columns={"bonds": "gold"}))
    session = policy.session(wealth=100.0)
    advised = frames.allocation(session.assets_action())
    assert set(advised.index) == {"stocks", "bonds"} and 0.0 < advised.sum() <= 1.0
    held = advised * 0.5
    session.observe(simple_returns=pd.Series({"stocks": 0.1, "bonds": -0.01}), executed_allocations=held, confirm=True)
    assert session.wealth == pytest.approx(100.0 + 100.0 * (0.1 * held["stocks"] - 0.01 * held["bonds"]))
    assert session.observed is not None and session.observed["assets"]["one_step"]["bound"] > 0.0  # type: ignore[index]
    session.correct(1, "a slip", simple_returns={"stocks": 0.2, "bonds": 0.0}, executed_allocations=held, confirm=True)
    assert session.wealth == pytest.approx(100.0 + 20.0 * held["stocks"])


def test_what_may_be_a_mistake_is_said(ballast: Ballast) -> None:
    training = train(ballast, rate_per_step=0.03, periods_per_year=12)
    assert [warning["code"] for warning in training.warnings] == ["rate_high", "rate_above_record"]
    detail = training.policy().detail()
    assert detail["warnings"] == training.warnings
    annualised = detail.get("annualised")
    assert annualised is not None and annualised["rate"] == pytest.approx(1.03**12 - 1)
    assert train(ballast).warnings == ballast.training(training.id).warnings == []


def test_how_near_the_advice_is_to_changing(ballast: Ballast, session: Session) -> None:
    advised = ballast.advise(RETURNS, kind="log", rate_per_step=0.002, sensitivity=True)
    answers: list[wire.Advised | wire.AssetAction] = [advised, session.action(sensitivity=True)]
    for answer in answers:
        without_one = answer["sensitivity"]["without_one"]  # type: ignore[index]
        assert without_one["lowest"]["allocation"] <= without_one["highest"]["allocation"]  # type: ignore[index]
        assert without_one["lowest"]["log_return"] in RETURNS  # type: ignore[index]
        assert answer["caution"][0]["code"] == "short_record"
    assert "sensitivity" not in session.action()


def test_prices_and_what_was_really_done(session: Session) -> None:
    session.observe(price=103.0, previous_price=100.0, executed_allocation=0.5)
    assert session.wealth == pytest.approx(100.0 * (0.5 * 1.001 + 0.5 * 1.03), rel=1e-12)
    session.observe(price=103.0 * 1.01, wealth=90.0)
    assert session.observed is not None
    assert session.observed["log_return"] == pytest.approx(math.log(1.01))
    assert session.wealth == 90.0


def test_what_was_reported_is_put_right(session: Session) -> None:
    session.observe(log_return=0.01, executed_allocation=0.5, date="2008-01-31", rate=0.002, flow=5.0)
    session.observe(missing=True)
    with pytest.raises(package.Unconfirmed, match="standard deviations"):
        session.correct(1, "typed twice", log_return=1.2)
    corrected = session.correct(1, "the index was revised", log_return=0.02, executed_allocation=0.5)
    assert (session.corrections, session.period) == (1, 3)
    assert session.wealth == corrected["wealth"] == session.refresh().wealth
    again = session.correct(1, "the index was revised", correction=1, log_return=0.02, executed_allocation=0.5)
    assert again == corrected and session.corrections == 1
    history = session.history()
    first = history["observations"][0]
    assert (first["log_return"], first["reported"].get("date")) == (0.01, "2008-01-31")
    now = first.get("now")
    assert now is not None and now["log_return"] == 0.02
    assert history["corrections"][0]["answer"] == corrected
    # An answer from before the correction does not restore the wrong wealth.
    session.observe(missing=True, period=2)
    assert session.wealth == corrected["wealth"]


def test_what_was_skipped_is_reported_or_put_in(session: Session) -> None:
    session.observe(log_return=0.01, date="2008-01-31").observe(log_return=0.01, date="2008-02-29")
    with pytest.raises(package.Unconfirmed) as refused:
        session.observe(log_return=0.01, date="2008-04-30")
    [doubt] = refused.value.doubts
    assert (doubt["reason"], doubt.get("missing")) == ("missing_periods", ["2008-03-31"])
    session.observe(log_return=0.01, date="2008-04-30", confirm=True)
    session.correct(3, "the whole quarter came", change="remove")
    assert session.period == 3
    session.correct(2, "it was skipped", change="insert", missing=True, date="2008-02-15")
    rows = session.history()["observations"]
    assert [row["reported"].get("date") for row in rows] == ["2008-01-31", "2008-02-15", "2008-02-29"]
    assert (session.period, session.refresh().period) == (4, 4)


def test_a_session_is_found_again_where_it_was(ballast: Ballast, session: Session) -> None:
    session.observe(log_return=0.01)
    other = ballast.session(session.id)
    assert (other.period, other.wealth, other.policy) == (2, session.wealth, session.policy)
    other.observe(log_return=0.02)
    assert session.period == 2 and session.refresh().period == 3 and session.wealth == other.wealth


def test_a_policy_travels_and_its_specification_trains_it_again(ballast: Ballast) -> None:
    policy = train(ballast, seed=7).policy()
    detail, document = policy.detail(), policy.export()
    assert detail["policy"] == policy.id and detail["specification"].get("seed") == 7
    policy.delete()
    with pytest.raises(package.NotFound):
        policy.detail()
    assert ballast.import_policy(document).id == policy.id
    assert ballast.submit(detail["specification"]).policy().id == policy.id


def test_a_session_goes_on_by_another_policy(ballast: Ballast, session: Session) -> None:
    session.observe(log_return=0.01)
    horizon = session.horizon
    renewed = session.renew(session.policy, window=5)
    assert (session.renewals, session.period, session.horizon) == (1, 2, horizon + 1)
    assert (renewed["sample_size"], renewed["terms"]["horizon"]) == (5, horizon)
    assert session.renew(session.policy, window=5, renewal=1) == renewed
    assert session.refresh().renewals == 1
    kept = ballast.policy(session.policy).session(renew={"every": 1})
    assert kept.observe(log_return=0.02).period == 2


def test_things_are_called(ballast: Ballast) -> None:
    policy = train(ballast, seed=9, name="World", tags=["equity"]).policy()
    detail = policy.detail()
    assert (detail["name"], detail["notes"], detail["tags"]) == ("World", "", ["equity"])
    assert policy.label(notes="monthly", tags=[]) == {"name": "World", "notes": "monthly", "tags": []}
    session = policy.session(name="Ada", tags=["x"])
    assert session.label(name="") == {"name": "", "notes": "", "tags": ["x"]}
    assert next(ballast.sessions())["tags"] == ["x"]
    assert next(ballast.policies())["notes"] == "monthly"
    with pytest.raises(package.InvalidField) as refusal:
        session.label(tags=["a", "a"])
    assert refusal.value.field == "tags[1]"


def test_sessions_are_found_and_in_order(ballast: Ballast, session: Session) -> None:
    opened = [ballast.policy(session.policy).session(name=f"Ordered {n}", wealth=100.0 + n, tags=["o"]) for n in (2, 1)]
    opened[0].observe(log_return=0.01, date="2020-01-31")
    richest = list(ballast.sessions(search="ORDERED", sort="-wealth"))
    assert [entry["name"] for entry in richest] == ["Ordered 2", "Ordered 1"]
    assert [entry["session"] for entry in ballast.sessions(tag="o", sort="name", state="active")] == [
        opened[1].id,
        opened[0].id,
    ]
    assert richest[0]["wealth"] == opened[0].wealth and richest[0]["wealth_change"] == opened[0].wealth - 102.0
    pd = pytest.importorskip("pandas")
    frame = package.frames.sessions(richest)
    assert list(frame.index) == [opened[0].id, opened[1].id]
    assert frame["date"].iloc[0] == pd.Timestamp("2020-01-31") and pd.isna(frame["last_report"].iloc[1])
    assert package.frames.sessions([]).empty


def test_many_sessions_report_at_once(ballast: Ballast, session: Session) -> None:
    other = ballast.policy(session.policy).session()
    reports: list[wire.Observe] = [
        {"session": session.id, "period": 1, "log_return": 0.01},
        {"session": other.id, "period": 2, "log_return": 0.01},
        {"session": "nobody", "period": 1, "log_return": 0.01},
    ]
    answers = ballast.observe(reports)
    assert [answer["status"] for answer in answers] == [200, 409, 404]
    assert ballast.observe(iter(reports)) == answers
    first, second = cast(wire.Observed | None, answers[0].get("answer")), answers[1].get("problem")
    assert first is not None and session.refresh().wealth == first["wealth"] and session.period == 2
    assert second is not None and second["type"] == "/problems/report-gap"
    with pytest.raises(package.InvalidField) as refusal:
        ballast.observe([reports[0], reports[0]])
    assert refusal.value.field == "[1].session"
    assert ballast.observe([]) == []


def test_the_client_reaches_every_operation(ballast: Ballast, network: Network, session: Session) -> None:
    """Compares the requests with api/openapi.json, so that it fails for an operation that the client lacks."""
    ballast.advise(RETURNS, kind="log", rate_per_step=0.001)
    ballast.read_returns("1.5 -2 3")
    training = train(ballast, seed=8)
    policy = training.policy()
    own = policy.session(history=RETURNS[:5], kind="simple")
    own.action(mode="resolve")
    own.what_if(radius_scale=0.5)
    ordered = own.orders({"asset": 10.0}, {"asset": 3.0}, 70.0, lots={"asset": 0.5})
    assert ordered["wealth"] == 100.0 and ordered["cash"] >= 0.0
    assert own.futures(20)["period"] == 1
    own.observe(log_return=0.01).correct(1, "revised", log_return=0.02)
    own.renew(policy.id)
    own.refresh().history()
    own.label(name="Ada")
    letter = own.letter({"name": "The <firm>", "closing": "Please call us."}, currency="EUR")
    assert "<h2>Ada</h2>" in letter and "The &lt;firm&gt;" in letter and "Amounts in EUR." in letter
    with pytest.raises(package.InvalidField, match="currency"):
        own.letter(currency="euro")
    document, wealth = own.export(), own.wealth
    own.delete()
    own = ballast.import_session(document)
    assert own.wealth == wealth
    policy.label(name="World")
    assert own.id in [entry["session"] for entry in ballast.sessions()]
    own.delete()
    assert policy.id in [entry["policy"] for entry in ballast.policies()]
    policy.detail()
    assert policy.surface(across="deviation")["step"] == 0
    assert policy.futures(20)["paths"] == 20
    ballast.import_policy(policy.export())
    with pytest.raises(package.InvalidField, match="declared"):
        policy.decide()
    policy.delete()
    assert training.id in [job["job"] for job in ballast.jobs()]
    assert ballast.training(training.id).cancel().job["state"] == "succeeded"
    told = ballast.subscribe("https://example.com/hook", ["advice_changed"], sessions=[session.id], least_change=0.1)
    assert told["secret"].startswith("whsec_")
    assert ballast.rotate_secret(told["subscription"])["secret"] != told["secret"]
    assert [listed["least_change"] for listed in ballast.subscriptions()] == [0.1]
    assert ballast.resend(told["subscription"]) == 0
    ballast.unsubscribe(told["subscription"])
    assert ballast.subscriptions() == []
    made = session.make_link(7, {"currency": "EUR"})
    assert [link["link"] for link in session.links()] == [made["link"]]
    session.delete_link(made["link"])
    assert ballast.sleeve(RETURNS, kind="log", rate_per_step=0.002)["share"] >= 0.0
    assert ballast.calendar().startswith("BEGIN:VCALENDAR")
    assert ballast.health()["status"] == "ok"
    assert len(ballast.plan(RETURNS, kind="log", rate_per_step=0.002, horizon=2, paths=200)["periods"]) == 2
    evaluation = compare(ballast)
    assert ballast.evaluation(evaluation.id).report()["reference"] == "All in the bank"
    walked = walk(ballast)
    assert ballast.walk_forward(walked.id).report()["choices"]["window"] == 8
    tried = ballast.frontier(
        [0.01 * math.sin(period) for period in range(12)], kind="log", rate_per_step=0.0, resamples=20
    )
    assert ballast.frontier_of(tried.id).report()["format"] == "ballast-frontier-1"
    ballast.training(training.id).delete()
    assert training.id not in [job["job"] for job in ballast.jobs()]

    ids = {
        training.id: "{id}",
        evaluation.id: "{id}",
        walked.id: "{id}",
        tried.id: "{id}",
        policy.id: "{id}",
        own.id: "{id}",
        session.id: "{id}",
        told["subscription"]: "{id}",
        made["link"]: "{id}",
    }
    reached = {(method, "/".join(ids.get(part, part) for part in path.split("/"))) for method, path in network.sent}
    paths = json.loads((REPOSITORY / "api/openapi.json").read_text())["paths"]
    described = {(method.upper(), path) for path, item in paths.items() for method in item if for_clients(item)}
    # A client's browser opens this one, with the secret of a link.
    described.remove(("GET", "/letter"))
    assert len(described) >= 17
    assert described - reached == set()


def test_what_if_supposes_and_touches_nothing(session: Session) -> None:
    before = session.action()
    answer = session.what_if(sweep={"radius_scale": {"from": 0.0, "to": 2.0, "points": 3}})
    worths = [point["certainty_equivalent"] for point in answer["points"]]  # type: ignore[typeddict-item]
    assert worths == sorted(worths, reverse=True)
    assert session.action() == before


def test_an_evaluation_ends_in_a_report(ballast: Ballast) -> None:
    report = compare(ballast).report()
    bank, half = report["strategies"]
    assert bank["strategy"] == "All in the bank"
    # All paths of the bank have the same end, up to rounding.
    assert bank["utility"]["variance"]["value"] == pytest.approx(0.0, abs=1e-20)
    assert half["utility"]["mean"]["low"] <= half["utility"]["mean"]["value"] <= half["utility"]["mean"]["high"]


def test_a_walk_forward_ends_in_a_report(ballast: Ballast) -> None:
    report = walk(ballast, alpha=[0.5]).report()
    assert (report["frequency"], report["dates"]) == ("quarterly", ["2022-01", "2022-04", "2022-07", "2022-10"])
    stock = next(line for line in report["periods"] if line["strategy"] == "All in stocks")
    wealth = 100.0
    for quarter, found in zip(range(8, 12), stock["wealth"], strict=True):
        wealth *= 1.02 + 0.03 * math.sin(1.7 * quarter)
        assert found == pytest.approx(wealth, rel=1e-12)
    assert report["sentences"][0].startswith("With “Cautious, learns” a year that starts at 100 ")


def test_a_frontier_tells_what_caution_costs(ballast: Ballast) -> None:
    pd = pytest.importorskip("pandas")
    record = [0.01 + 0.05 * math.sin(1.7 * period) for period in range(24)]
    one = ballast.frontier(record, kind="log", rate_per_step=0.002, scales=[0.0, 1.0], resamples=20).report()
    table = pd.DataFrame({"stocks": record, "bonds": [0.001 + 0.3 * value for value in reversed(record)]})
    two = ballast.frontier(table, kind="log", rate_per_step=0.002, resamples=20, block=3).report()
    assert [point["scale"] for point in one["resampled"][0]["points"]] == [0.0, 1.0]
    assert [len(found["best"]) for found in one["resampled"] + two["resampled"]] == [1, 1, 1, 2, 2, 2]
    assert all(point["lost"]["value"] > -1e-6 for found in two["resampled"] for point in found["points"])


def test_every_field_of_a_walk_forward_is_an_argument() -> None:
    arguments = set(inspect.signature(Ballast.backtest).parameters)
    assert arguments - {"self", "returns", "kind", "choices", "idempotency_key"} == set(
        wire.BacktestRequest.__annotations__
    ) - {
        "log_returns",
        "simple_returns",
    }


def test_every_hypothesis_is_an_argument() -> None:
    calls = (Session.what_if, Session.assets_what_if)
    arguments = {name for call in calls for name in inspect.signature(call).parameters} - {"self"}
    assert arguments == set(wire.WhatIf.__annotations__) - {"session"}


def for_clients(item: dict[str, dict[str, list[str]]]) -> bool:
    """Returns false for what operators call, and for what agents call by a protocol of their own."""
    return all(operation["tags"] not in (["operations"], ["agents"]) for operation in item.values())


def test_every_field_of_a_specification_is_an_argument() -> None:
    arguments = set(inspect.signature(Ballast.train).parameters) - {
        "self",
        "returns",
        "kind",
        "choices",
        "idempotency_key",
    }
    problem, whole = wire.ProblemSpecification.__annotations__, wire.Specification.__annotations__
    of_whole = set(whole) - {"problem", "fund"}
    assert arguments == (set(problem) - {"history", "levels"}) | of_whole | set(wire.Relabel.__annotations__)


def test_every_field_of_an_opening_is_an_argument(ballast: Ballast, session: Session) -> None:
    of_returns = {"kind", "choices", "idempotency_key"}
    assert set(Opening.__annotations__) - of_returns == set(wire.OpenSession.__annotations__) - {"policy"}
    blank = cast(Opening, dict.fromkeys(Opening.__annotations__))
    opened = ballast.policy(session.policy).session(**blank)
    assert (opened.policy, opened.wealth, opened.holding) == (session.policy, 100.0, 0.0)
    opened.delete()


def test_every_field_of_a_report_is_an_argument() -> None:
    report = set(wire.Report.__annotations__)
    observe = set(inspect.signature(Session.observe).parameters) - {"self", "report"}
    correct = set(inspect.signature(Session.correct).parameters) - {"self", "report"}
    assert observe | report == set(wire.Observe.__annotations__) - {"session"}
    assert correct | report == set(wire.Correct.__annotations__)


def test_pages_are_joined(ballast: Ballast, session: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    opened = [session.id] + [ballast.policy(session.policy).session().id for _ in range(4)]
    monkeypatch.setattr("ballast.client._PAGE", 2)
    listed = [entry["session"] for entry in ballast.sessions()]
    assert listed[:5] == opened[::-1] and len(listed) == len(set(listed))


def test_the_client_closes_its_connections(ballast: Ballast) -> None:
    ballast.close()
    with pytest.raises(RuntimeError, match="closed"):
        ballast.health()
