"""Progress by server-sent events: complete and in order, across lost connections and restarts."""

from __future__ import annotations

import io
from collections.abc import Iterator
from itertools import pairwise

import httpx
import pytest
from conftest import Network, Service, train

from ballast import Ballast, JobEnded, JobNotEnded, ProgressBar, ProgressPrinter, Unreachable, wire
from ballast.events import Event, Parser

#: Steps of a training that outlasts a restart.
LONG = 12


def test_events_lead_to_the_end(ballast: Ballast) -> None:
    jobs = list(train(ballast, seed=31).events())
    steps = [job["progress"]["steps_done"] for job in jobs]
    assert steps == sorted(steps) and steps[-1] == jobs[-1]["progress"]["steps_total"] == 3
    assert [job["state"] for job in jobs].count("succeeded") == 1 and jobs[-1]["state"] == "succeeded"


def test_a_finished_training_has_one_event(ballast: Ballast) -> None:
    training = train(ballast, seed=32)
    policy = training.policy()
    again = ballast.training(training.id)
    assert [job.get("policy") for job in again.events()] == [policy.id]
    assert again.policy().id == policy.id


def test_a_training_that_is_looked_at_is_itself(ballast: Ballast) -> None:
    training = train(ballast, seed=30)
    ended = ballast.training(training.id).policy()
    assert "succeeded" not in repr(training)
    assert training.refresh() is training and training.job["state"] == "succeeded"
    assert training.refresh().policy().id == ended.id and training.cancel() is training


def test_a_restart_in_the_middle_is_bridged(service: Service, ballast: Ballast) -> None:
    training = train(ballast, horizon=LONG, seed=33)
    seen: list[wire.Job] = []
    for job in training.events():
        seen.append(job)
        if len(seen) == 3:
            service.stop()
            service.start()
    assert seen[2]["state"] == "running" and seen[2]["progress"]["steps_done"] < LONG
    assert seen[-1]["state"] == "succeeded" and seen[-1]["progress"]["steps_done"] == LONG
    # Only the step that the restart interrupted is solved again, and no event comes twice in a row.
    steps = [job["progress"]["steps_done"] for job in seen]
    assert steps == sorted(steps)
    assert all(before != after for before, after in pairwise(seen))


def test_a_cancelled_training_says_so(ballast: Ballast) -> None:
    training = train(ballast, horizon=LONG, design={"count": 400}, seed=34)
    with pytest.raises(JobNotEnded):
        training.delete()
    training.cancel()
    with pytest.raises(JobEnded, match="ended as cancelled") as end:
        training.session()
    assert end.value.job["job"] == training.id


def test_a_stream_that_cannot_be_had_is_given_up(ballast: Ballast, network: Network, pauses: list[float]) -> None:
    training = train(ballast, seed=35)
    network.refuse(7)
    with pytest.raises(Unreachable, match="connection refused"):
        training.policy()
    assert len(pauses) == 6


def test_a_broken_stream_is_taken_up_where_it_was(ballast: Ballast, network: Network, pauses: list[float]) -> None:
    training = train(ballast, seed=36)
    training.policy()
    shown: list[str | None] = []

    class Half(httpx.SyncByteStream):
        def __iter__(self) -> Iterator[bytes]:
            yield b'id: running-1-\nevent: state\ndata: {"job": "x", "state": "running"}\n\nid: running-2-\ndata: {"jo'
            raise httpx.ReadError("reset")

    def half(request: httpx.Request) -> httpx.Response:
        return httpx.Response(200, stream=Half(), request=request)

    def resumed(request: httpx.Request) -> httpx.Response:
        shown.append(request.headers.get("last-event-id"))
        return httpx.Response(200, text='id: failed-1-\ndata: {"job": "x", "state": "failed"}\n\n', request=request)

    network._faults += [half, resumed]
    assert [job["state"] for job in training.events()] == ["running", "failed"]
    assert shown == ["running-1-"] and len(pauses) == 1


def test_progress_is_printed_a_line_a_step(ballast: Ballast) -> None:
    out = io.StringIO()
    train(ballast, seed=37).policy(watch=ProgressPrinter(out))
    lines = out.getvalue().splitlines()
    assert lines[-1].startswith("succeeded: 3 of 3 steps")
    assert len(lines) == len(set(lines)) <= 1 + 4 + 1


def test_on_a_terminal_the_line_is_rewritten(ballast: Ballast) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    out = Terminal()
    train(ballast, seed=38).policy(watch=ProgressPrinter(out))
    assert out.getvalue().count("\n") == 1 and out.getvalue().startswith("\r")


def test_events_are_parsed_however_they_are_cut() -> None:
    stream = (
        ': alive\n\nid: a\r\nevent: state\r\ndata: {"x": "\u2028"}\r\n\r\nid: b\ndata:1\ndata: 2\n\n'
        "id: c\ndata: cut off"
    ).encode()
    whole = [Event("a", "state", '{"x": "\u2028"}'), Event("b", "message", "1\n2")]
    for size in range(1, len(stream) + 1):
        parser, chunks = Parser(), [stream[at : at + size] for at in range(0, len(stream), size)]
        assert [event for chunk in chunks for event in parser.feed(chunk)] == whole


def test_a_bar_ends_with_its_job(ballast: Ballast) -> None:
    drawn = io.StringIO()
    train(ballast, seed=39).policy(watch=ProgressBar(file=drawn))
    assert drawn.getvalue().rstrip().rpartition("\r")[2].startswith("succeeded: 100%|") and "3/3" in drawn.getvalue()
