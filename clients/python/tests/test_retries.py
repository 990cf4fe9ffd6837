"""Lost requests, lost answers and temporary refusals are retried if that is safe, and take effect once."""

from __future__ import annotations

import time
from email.utils import formatdate

import pytest
from conftest import Network, Service, train

from ballast import Ballast, IdempotencyConflict, Overloaded, ProblemError, Repeating, Session, StorageFull, Unreachable


def test_a_lost_answer_to_observe_is_given_again_and_counts_once(
    session: Session, network: Network, pauses: list[float]
) -> None:
    network.lose_answers(2)
    session.observe(simple_return=0.02)
    first = session.observed
    assert network.sent[-3:] == [("POST", "/observe")] * 3 and len(pauses) == 2
    assert session.period == 2
    session.observe(simple_return=0.02, period=1)
    assert session.observed == first and session.period == 2
    assert len(session.history()["observations"]) == 1


def test_the_repetition_of_an_earlier_period_does_not_turn_back_time(session: Session) -> None:
    wealth = session.observe(log_return=0.02).observe(log_return=0.03).wealth
    session.observe(log_return=0.02, period=1)
    assert (session.period, session.wealth) == (3, wealth)
    assert session.observed is not None and session.observed["period"] == 1


def test_observe_goes_on_after_it_gave_up(session: Session, network: Network, pauses: list[float]) -> None:
    network.lose_answers(7)
    with pytest.raises(Unreachable, match="reset"):
        session.observe(simple_return=0.02)
    assert len(pauses) == 6 and session.period == 1
    session.observe(simple_return=0.02).observe(simple_return=0.03)
    assert [row["period"] for row in session.history()["observations"]] == [1, 2]


def test_a_lost_answer_to_train_finds_the_same_job(ballast: Ballast, network: Network, pauses: list[float]) -> None:
    before = {job["job"] for job in ballast.jobs()}
    network.lose_answers(3)
    training = train(ballast, seed=21)
    assert {job["job"] for job in ballast.jobs()} - before == {training.id}
    assert len(pauses) == 3
    assert train(ballast, seed=21).id != training.id


def test_a_session_is_not_opened_twice(
    ballast: Ballast, session: Session, network: Network, pauses: list[float]
) -> None:
    def count() -> int:
        return sum(1 for _ in ballast.sessions())

    policy, before = ballast.policy(session.policy), count()
    network.lose_answers(1)
    opened = policy.session()
    assert opened.period == 1 and count() == before + 1 and len(pauses) == 1
    network.refuse(2)
    network.answer(503, {"retry-after": "1"})
    assert policy.session().id != opened.id
    assert count() == before + 2 and len(pauses) == 4
    mine = policy.session(wealth=50.0, idempotency_key="mine")
    mine.observe(log_return=0.01)
    again = policy.session(wealth=50.0, idempotency_key="mine")
    assert (again.id, again.period, again.refresh().period) == (mine.id, 1, 2)
    with pytest.raises(IdempotencyConflict):
        policy.session(wealth=51.0, idempotency_key="mine")


def test_a_deletion_whose_answer_was_lost_is_one(session: Session, network: Network, pauses: list[float]) -> None:
    network.lose_answers(1)
    session.delete()
    assert len(pauses) == 1
    with pytest.raises(ProblemError) as refusal:
        session.delete()
    assert refusal.value.status == 404


def test_the_pause_asked_for_is_kept(ballast: Ballast, network: Network, pauses: list[float]) -> None:
    network.answer(503, {"retry-after": "4"})
    network.answer(429, {"retry-after": formatdate(time.time() + 9, usegmt=True)})
    assert ballast.health()["status"] == "ok"
    assert pauses[0] == 4.0 and 6.0 < pauses[1] < 9.5


@pytest.mark.parametrize("headers", [{}, {"retry-after": "3600"}, {"retry-after": "soon"}])
def test_without_a_bearable_pause_a_refusal_is_final(
    ballast: Ballast, network: Network, pauses: list[float], headers: dict[str, str]
) -> None:
    network.answer(503, headers)
    with pytest.raises(ProblemError):
        ballast.health()
    assert pauses == []


def test_a_full_disk_is_not_retried(session: Session, network: Network, pauses: list[float]) -> None:
    problem = '{"type": "/problems/storage-full", "title": "The data folder is full", "status": 507, "detail": "full"}'
    network.answer(507, {"content-type": "application/problem+json", "retry-after": "1"}, problem)
    with pytest.raises(StorageFull) as refusal:
        session.observe(log_return=0.0)
    assert pauses == [] and refusal.value.retry_after == 1.0


def test_a_service_that_stays_away_is_unreachable_and_a_restart_is_bridged(service: Service, session: Session) -> None:
    service.stop()
    with Ballast(service.url, retries=1) as impatient, pytest.raises(Unreachable) as error:
        impatient.health()
    assert error.value.__cause__ is not None
    assert f"nothing answers at {service.url}" in str(error.value) and "ballast serve" in str(error.value)
    service.start()
    assert session.observe(log_return=0.01).period == 2


def test_the_first_loss_is_told_and_no_other(ballast: Ballast, network: Network, pauses: list[float]) -> None:
    network.refuse(3)
    with pytest.warns(Repeating) as caught:
        ballast.health()
    (refused,) = (str(warning.message) for warning in caught)
    assert caught[0].filename == __file__
    address = str(ballast._transport.http.base_url)
    assert refused.startswith(f"nothing answers at {address} yet (connection refused): trying again for up to 13 s.")
    assert "Start a service with 'ballast serve --data ballast-data'" in refused and len(pauses) == 3
    training = train(ballast, seed=22)
    network.refuse(2)
    with pytest.warns(Repeating) as caught:
        training.policy()
    assert len(caught) == 1
    network.lose_answers(1)
    with pytest.warns(Repeating, match=r"^an answer was lost \(the connection was reset\): trying again"):
        ballast.health()


def test_overload_is_named(ballast: Ballast, network: Network, pauses: list[float]) -> None:
    problem = '{"type": "/problems/overloaded", "title": "The service cannot answer now", "status": 503, "detail": "b"}'
    for _ in range(7):
        network.answer(503, {"content-type": "application/problem+json", "retry-after": "1"}, problem)
    with pytest.raises(Overloaded):
        ballast.health()
    assert len(pauses) == 6
