"""Exceptions carry the fields of the problem document."""

from __future__ import annotations

import math
import pickle
import re

import pytest
from conftest import REPOSITORY, RETURNS, Network, train

import ballast as package
from ballast import Ballast, ProblemError, Session

#: Kinds that no call of this client can cause.
DEFECTS = {"malformed-json", "unknown-route", "wrong-method", "unsupported-media-type"}


def test_a_field_that_breaks_a_rule_is_named(ballast: Ballast) -> None:
    with pytest.raises(package.InvalidField) as refusal:
        train(ballast, horizon=0)
    error = refusal.value
    assert (error.type, error.status) == ("/problems/invalid-field", 422)
    assert (error.field, error.value) == ("problem.horizon", 0)
    assert error.rule is not None and error.rule.startswith("must lie in [1, ")
    assert str(error) == f"A field breaks a rule (422): problem.horizon is 0: {error.rule}"
    copy = pickle.loads(pickle.dumps(error))
    assert type(copy) is package.InvalidField and copy.rule == error.rule


def test_unknown_things_are_not_found(ballast: Ballast) -> None:
    for ask in (ballast.session, ballast.training, lambda name: ballast.policy(name).session()):
        with pytest.raises(package.NotFound) as refusal:
            ask("no/such?thing")
        assert refusal.value.value == "no/such?thing"


def test_conflicts_have_their_kinds(ballast: Ballast, session: Session) -> None:
    with pytest.raises(package.ReportGap) as gap:
        session.observe(log_return=0.01, period=2)
    assert gap.value.rule == "must be 1"
    session.observe(log_return=0.01)
    with pytest.raises(package.ReportConflict) as conflict:
        session.observe(log_return=0.02, period=1)
    assert (conflict.value.field, conflict.value.value) == ("period", 1)
    with pytest.raises(package.InUse):
        ballast.policy(session.policy).delete()
    train(ballast, idempotency_key="once")
    with pytest.raises(package.IdempotencyConflict):
        train(ballast, idempotency_key="once", seed=5)


def test_a_session_stays_where_it_was_after_a_refusal(session: Session) -> None:
    with pytest.raises(package.InvalidField):
        session.observe(log_return=0.01, simple_return=0.01)
    with pytest.raises(ValueError, match=r"^log_return is nan: must be finite$"):
        session.observe(log_return=float("nan"))
    with pytest.raises(ValueError, match=r"^sweep\.radius_scale\.to is inf: must be finite$"):
        session.what_if(sweep={"radius_scale": {"from": 0.0, "to": math.inf, "points": 3}})
    assert (session.period, session.wealth, session.observed) == (1, 100.0, None)


def test_a_document_that_is_no_policy_is_refused(ballast: Ballast) -> None:
    with pytest.raises(ProblemError) as refusal:
        ballast.import_policy(b'{"format": 1}')
    assert refusal.value.status == 422 and refusal.value.field is not None


def test_a_damaged_export_is_noticed(ballast: Ballast, session: Session, network: Network) -> None:
    policy = ballast.policy(session.policy)
    network.answer(200, text=policy.export().decode().replace("0", "1", 1))
    with pytest.raises(package.DamagedPolicy, match=policy.id):
        policy.export()


def test_an_answer_of_something_in_between_is_a_problem_too(ballast: Ballast, network: Network) -> None:
    network.answer(502, {"content-type": "text/html"}, "<h1>Bad gateway</h1>")
    with pytest.raises(ProblemError) as refusal:
        ballast.health()
    error = refusal.value
    assert (error.type, error.status, error.title) == ("about:blank", 502, "Bad Gateway")
    assert "<h1>Bad gateway</h1>" in str(error)


def test_an_answer_that_is_not_json_is_a_problem_too(ballast: Ballast, network: Network) -> None:
    network.answer(200, {"content-type": "text/html"}, "<h1>Sign in</h1>")
    with pytest.raises(ProblemError, match="Sign in"):
        ballast.health()
    network.answer(422, {"content-type": "application/problem+json"}, "cut of")
    with pytest.raises(ProblemError, match="cut of"):
        ballast.health()


def test_an_address_without_a_protocol_is_said_at_once(pauses: list[float]) -> None:
    with Ballast("localhost") as nowhere, pytest.raises(package.Unreachable, match="http://"):
        nowhere.health()
    assert pauses == []


def test_every_kind_of_the_service_has_its_class() -> None:
    source = (REPOSITORY / "src/http/problem.rs").read_text()
    kinds = set(re.findall(r'\("([a-z-]+)", S::', source))
    assert len(kinds) >= 17
    assert kinds - DEFECTS == set(ProblemError.kinds)


def test_every_exception_is_one_of_the_package() -> None:
    assert {kind.__name__ for kind in ProblemError.kinds.values()} <= set(package.__all__)
    assert all(issubclass(kind, package.BallastError) for kind in ProblemError.kinds.values())


def test_the_history_of_a_session_is_checked(ballast: Ballast, session: Session) -> None:
    with pytest.raises(ValueError, match=r"^history: One number is not a record of returns"):
        ballast.policy(session.policy).session(history=RETURNS[:1], kind="log")
