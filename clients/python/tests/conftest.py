"""A real service with a temporary folder, and a network that fails on demand."""

from __future__ import annotations

import datetime
import math
import os
import signal
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest

from ballast import Ballast, Evaluation, Session, Training, WalkForward, wire

REPOSITORY = Path(__file__).resolve().parents[3]
BINARY = Path(os.environ.get("BALLAST_BINARY", REPOSITORY / "target/debug/ballast")).resolve()
#: Monthly log-returns: enough for a policy that holds something.
RETURNS = [0.041, -0.014, 0.032, 0.053, 0.012, 0.037, -0.021, 0.028, 0.019, 0.044]


class Service:
    """The binary under test, which keeps its port across restarts."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._port = folder, 0
        self.start()

    def start(self) -> None:
        arguments: list[str | Path] = [BINARY, "serve", "--listen", f"127.0.0.1:{self._port}", "--data"]
        arguments.append(self._folder)
        environment = {**os.environ, "RUST_LOG": "error"}
        self._process = subprocess.Popen(arguments, stdout=subprocess.PIPE, env=environment, text=True)
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        assert line.startswith("listening on "), f"{BINARY} printed {line!r}"
        self.url = line.removeprefix("listening on ").strip()
        self._port = httpx.URL(self.url).port or 0

    def stop(self) -> None:
        """Stops the service as an operator does: it finishes its requests and exits."""
        self._process.send_signal(signal.SIGTERM)
        try:
            assert self._process.wait(timeout=60) == 0
        finally:
            self._process.kill()
            self._process.communicate()


class Network(httpx.BaseTransport):
    """Connections that fail on demand and record the requests."""

    def __init__(self) -> None:
        self._inner = httpx.HTTPTransport()
        self.sent: list[tuple[str, str]] = []
        self._faults: list[Callable[[httpx.Request], httpx.Response]] = []

    def handle_request(self, request: httpx.Request) -> httpx.Response:
        self.sent.append((request.method, request.url.path))
        return self._faults.pop(0)(request) if self._faults else self._inner.handle_request(request)

    def lose_answers(self, count: int) -> None:
        """Loses the answers of the next requests, which do arrive."""

        def lose(request: httpx.Request) -> httpx.Response:
            self._inner.handle_request(request).read()
            raise httpx.ReadError("the connection was reset", request=request)

        self._faults += [lose] * count

    def refuse(self, count: int) -> None:
        """Refuses the next connections."""

        def fail(request: httpx.Request) -> httpx.Response:
            raise httpx.ConnectError("connection refused", request=request)

        self._faults += [fail] * count

    def answer(self, status: int, headers: dict[str, str] | None = None, text: str = "") -> None:
        """Answers the next request like a proxy."""
        self._faults.append(lambda request: httpx.Response(status, headers=headers, text=text, request=request))

    def close(self) -> None:
        self._inner.close()


@pytest.fixture(scope="session")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    assert BINARY.is_file(), f"{BINARY} is missing: build it, or name another in BALLAST_BINARY"
    running = Service(tmp_path_factory.mktemp("data"))
    yield running
    running.stop()


@pytest.fixture
def network() -> Network:
    return Network()


@pytest.fixture
def ballast(service: Service, network: Network) -> Iterator[Ballast]:
    with Ballast(service.url, transport=network) as client:
        yield client


def train(ballast: Ballast, **changes: object) -> Training:
    """Queues a small training with three periods and 20 design points."""
    settings = {"horizon": 3, "rate_per_step": 0.001, "design": {"count": 20}, **changes}
    return ballast.train(RETURNS, kind="log", **settings)  # type: ignore[arg-type]


def compare(ballast: Ballast) -> Evaluation:
    """Queues an evaluation of constant mixes, which need no training."""
    problem: wire.ProblemSpecification = {"history": RETURNS, "rate_per_step": 0.002, "horizon": 2}
    return ballast.evaluate({"problem": problem, "frameworks": [], "constant_mixes": [0.0, 0.5], "paths": 200})


def walk(ballast: Ballast, **more: Any) -> WalkForward:
    """Queues a walk-forward over three years of quarters, of which the last year is tested."""
    dates = [datetime.date(2020 + quarter // 4, 3 * (quarter % 4) + 1, 1) for quarter in range(12)]
    simple = [0.02 + 0.03 * math.sin(1.7 * quarter) for quarter in range(12)]
    return ballast.backtest(simple, kind="simple", rate=0.002, dates=dates, window=8, count=10, **more)


@pytest.fixture
def session(ballast: Ballast) -> Session:
    # The key and the body never change, so every test but the first finds the finished job.
    return train(ballast, idempotency_key="the policy of the tests").session()


@pytest.fixture
def pauses(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Records the pauses between retries instead of waiting."""
    seconds: list[float] = []
    monkeypatch.setattr("time.sleep", seconds.append)
    return seconds
