"""The asynchronous client has the same names, answers, retries and errors, and sends requests concurrently."""

from __future__ import annotations

import asyncio
import inspect
from collections.abc import AsyncIterator, Callable
from types import GenericAlias
from typing import Any

import httpx
import pandas as pd
import pytest
from conftest import RETURNS, Service, walk

import ballast as package
from ballast import AsyncBallast, Ballast, JobEnded, ReportGap, Unreachable, jobs
from ballast.driving import run

TWINS = {
    name.removeprefix("Async"): (getattr(package, name.removeprefix("Async")), getattr(package, name))
    for name in package.__all__
    if name.startswith("Async")
} | {"Job": (jobs.Job, jobs.AsyncJob)}


class AsyncNetwork(httpx.AsyncBaseTransport):
    """Connections whose next answers are lost on demand."""

    def __init__(self) -> None:
        self._inner = httpx.AsyncHTTPTransport()
        self.sent: list[str] = []
        self.lost = 0
        self.open = self.most_open = 0

    async def handle_async_request(self, request: httpx.Request) -> httpx.Response:
        self.sent.append(request.url.path)
        self.open += 1
        self.most_open = max(self.open, self.most_open)
        try:
            response = await self._inner.handle_async_request(request)
            if self.lost:
                self.lost -= 1
                await response.aread()
                raise httpx.ReadError("the connection was reset", request=request)
            return response
        finally:
            self.open -= 1

    async def aclose(self) -> None:
        await self._inner.aclose()


def test_the_twins_have_the_same_names_and_arguments() -> None:
    walked = {"WalkForward", "AssetsWalkForward", "DeclaredWalkForward"}
    others = {"Ballast", "Comparison", "Evaluation", "Frontier", "Job", "Policy", "Session", "Training"}
    assert set(TWINS) == walked | others
    for waits, awaited in TWINS.values():
        assert public(waits) == public(awaited) and len(public(waits)) >= 2
        for name in public(waits):
            one, other = getattr(waits, name), getattr(awaited, name)
            if not callable(one):
                continue
            assert one.__doc__ == other.__doc__ and one.__doc__, name
            assert inspect.signature(one).parameters == inspect.signature(other).parameters, name
            assert not inspect.iscoroutinefunction(one) and not inspect.isasyncgenfunction(one), name
            assert answer_name(one) == answer_name(other).removeprefix("Async"), name


def answer_name(call: Callable[..., object]) -> str:
    """Returns the name of the answer in the signature."""
    answer = inspect.signature(call).return_annotation
    if isinstance(answer, GenericAlias):
        return f"Iterator[wire.{answer.__args__[0].__name__}]"
    if not isinstance(answer, type):
        return str(answer).replace("AsyncIterator", "Iterator")
    return f"wire.{answer.__name__}" if answer.__module__ == "ballast.wire" else answer.__name__


def public(made: type) -> set[str]:
    return {name for name in dir(made) if not name.startswith("_")}


def test_what_a_call_makes_is_shown_in_its_signature() -> None:
    assert inspect.signature(Ballast.train).return_annotation is package.Training
    assert inspect.signature(AsyncBallast.train).return_annotation is package.AsyncTraining


async def lived(service: Service, network: AsyncNetwork) -> tuple[list[float], pd.DataFrame]:
    """Runs the example of the README with the asynchronous client."""
    async with AsyncBallast(service.url, transport=network) as ballast:
        assert (await ballast.health())["status"] == "ok"
        queued = await ballast.train(
            RETURNS, kind="log", horizon=3, rate_per_step=0.001, design={"count": 20}, idempotency_key="of the twins"
        )
        steps = [job["progress"]["steps_done"] async for job in queued.events()]
        assert steps == sorted(steps) and steps[-1] == 3
        session = await queued.session()
        allocations = []
        for realised in (0.02, -0.04):
            allocations.append((await session.action())["allocation"])
            assert await session.observe(simple_return=realised) is session
        with pytest.raises(ReportGap):
            await session.observe(log_return=0.0, period=9)
        found = await ballast.session(session.id)
        assert (found.period, found.wealth) == (session.period, session.wealth)
        assert session.id in [entry["session"] async for entry in ballast.sessions()]
        assert (await (await queued.policy()).detail())["horizon"] == 3
        frame = await session.replay([0.01], kind="log", period=3)
        assert session.completed
        whole = await session.frame()
        await session.delete()
        return allocations, pd.concat([whole.iloc[:2], frame.assign(corrected=False)])


def test_an_investor_lives_as_in_the_twin(service: Service, ballast: Ballast) -> None:
    allocations, frame = asyncio.run(lived(service, AsyncNetwork()))
    queued = ballast.train(
        RETURNS, kind="log", horizon=3, rate_per_step=0.001, design={"count": 20}, idempotency_key="of the twins"
    )
    session = queued.session()
    for expected, realised in zip(allocations, (0.02, -0.04), strict=True):
        assert session.action()["allocation"] == expected
        session.observe(simple_return=realised)
    session.observe(log_return=0.01)
    pd.testing.assert_frame_equal(frame, session.frame())


def test_reports_are_the_same(service: Service, ballast: Ballast) -> None:
    queued = walk(ballast, alpha=[0.5])

    async def ask() -> tuple[Any, pd.DataFrame]:
        async with AsyncBallast(service.url) as other:
            found = await other.walk_forward(queued.id)
            return await found.report(), await found.periods("allocation")

    report, allocations = asyncio.run(ask())
    assert report == queued.report()
    pd.testing.assert_frame_equal(allocations, queued.periods("allocation"))


def test_lost_answers_are_asked_for_again_and_count_once(service: Service, monkeypatch: pytest.MonkeyPatch) -> None:
    pauses: list[float] = []

    async def pause(seconds: float) -> None:
        pauses.append(seconds)

    async def observed() -> None:
        network = AsyncNetwork()
        async with AsyncBallast(service.url, transport=network) as ballast:
            queued = await ballast.train(RETURNS, kind="log", horizon=2, rate_per_step=0.001, design={"count": 20})
            session = await queued.session()
            monkeypatch.setattr("asyncio.sleep", pause)
            network.lost = 2
            await session.observe(simple_return=0.02)
            assert network.sent[-3:] == ["/observe"] * 3 and len(pauses) == 2
            network.lost = 7
            with pytest.raises(Unreachable, match="reset"):
                await session.observe(simple_return=0.03)
            await session.observe(simple_return=0.03)
            assert [row["period"] for row in (await session.history())["observations"]] == [1, 2]

    asyncio.run(observed())


def test_questions_go_out_side_by_side(service: Service) -> None:
    async def ask() -> None:
        network = AsyncNetwork()
        async with AsyncBallast(service.url, transport=network) as ballast:
            scales = [0.0, 0.5, 1.0, 2.0]
            answers = await asyncio.gather(
                *(
                    ballast.advise(
                        RETURNS,
                        kind="log",
                        rate_per_step=0.002,
                        radius={"rule": "bridge", "alpha": 0.1, "scale": scale},
                    )
                    for scale in scales
                )
            )
        assert network.most_open == len(scales)
        worths = [answer["certainty_equivalent"] for answer in answers]
        assert worths == sorted(worths, reverse=True) and worths[0] > worths[-1]

    asyncio.run(ask())


def test_a_job_is_cancelled_while_it_is_watched(service: Service) -> None:
    async def watched() -> None:
        async with AsyncBallast(service.url) as ballast:
            queued = await ballast.train(
                RETURNS, kind="log", horizon=12, rate_per_step=0.001, design={"count": 400}, seed=41
            )
            waiting = asyncio.create_task(queued.policy())
            await queued.cancel()
            with pytest.raises(JobEnded, match="ended as cancelled"):
                await waiting
            await queued.delete()

    asyncio.run(watched())


def test_the_waiting_client_works_where_a_loop_runs(ballast: Ballast) -> None:
    """A notebook has a running loop."""

    async def ask() -> str:
        return ballast.health()["status"]

    assert asyncio.run(ask()) == "ok"


def test_a_call_that_suspends_is_a_mistake_of_the_transport() -> None:
    with pytest.raises(RuntimeError, match="was suspended"):
        run(asyncio.sleep(0))


def test_an_iterator_that_is_left_early_closes_its_stream(ballast: Ballast) -> None:
    closed: list[str] = []

    class Stream:
        def __call__(self, path: str, last: str) -> Any:
            return self

        async def __aenter__(self) -> AsyncIterator[bytes]:
            return self.chunks()

        async def chunks(self) -> AsyncIterator[bytes]:
            while True:
                yield b'id: a\ndata: {"job": "x", "state": "running"}\n\n'

        async def __aexit__(self, *error: object) -> None:
            closed.append("yes")

    queued = walk(ballast, alpha=[0.5])
    stream: Callable[..., Any] = Stream()
    queued._transport.stream = stream  # type: ignore[method-assign]
    events = queued.events()
    assert next(events)["state"] == "running"
    events.close()  # type: ignore[attr-defined]
    assert closed == ["yes"]
