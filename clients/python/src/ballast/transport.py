"""Sends requests over one pool of connections, and retries those that failed. Two transports, blocking and
asynchronous, share the rules for retries.

Every call of this client is safe to retry, for one of four reasons. It only reads. It deletes. Its content is the whole
new state (an imported policy, labels). Or the service recognises the request (by the idempotency key of a job or a
session, or the period of an observation).
"""

from __future__ import annotations

import asyncio
import inspect
import itertools
import json
import math
import random
import time
import uuid
import warnings
from abc import ABC, abstractmethod
from collections.abc import AsyncIterator, Iterator, Mapping, Sequence
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from email.utils import parsedate_to_datetime
from pathlib import Path
from typing import Any, TypeAlias

import httpx

from .errors import Repeating, Unreachable, of_response

#: Pause before the first retry, in seconds. It doubles with each retry, up to the longest pause.
FIRST_PAUSE = 0.2
#: The longest pause, also for ``Retry-After``. If the service requests a longer one, the problem is raised at once.
LONGEST_PAUSE = 30.0
#: A stream of events counts as lost after this silence, in seconds. The service sends a keep-alive every 15 s.
STREAM_SILENCE = 60.0

#: The body of a request: a value to encode as JSON, or bytes that are sent unchanged.
Body: TypeAlias = Mapping[str, Any] | Sequence[Any] | bytes

#: Statuses of temporary refusals, which are retried.
RETRIED_STATUS = (429, 503)
_HERE = Path(__file__).parent
#: Errors that mean that nothing listens at the address, or that it cannot be reached.
_NOBODY = (httpx.ConnectError, httpx.ConnectTimeout)
_START = "Start a service with 'ballast serve --data ballast-data', or give its address as Ballast(url)."
_LOST = (httpx.TimeoutException, httpx.NetworkError, httpx.RemoteProtocolError)


def idempotent(key: str | None) -> dict[str, str]:
    """Returns the header that makes the service carry out a request only once, even if it arrives twice.

    If the caller gives no key, this call makes one, so that a retry after a lost answer finds the result of the first.
    """
    return {"Idempotency-Key": str(uuid.uuid4()) if key is None else key}


class Transport(ABC):
    """Sends requests to one service."""

    http: httpx.Client | httpx.AsyncClient
    retries: int

    @abstractmethod
    async def send(self, request: httpx.Request) -> httpx.Response:
        """Returns the complete answer, whatever its status."""

    @abstractmethod
    async def pause(self, seconds: float) -> None:
        """Waits."""

    @abstractmethod
    def stream(self, path: str, last_event_id: str) -> AbstractAsyncContextManager[AsyncIterator[bytes]]:
        """Opens a stream of events that begins after ``last_event_id``."""

    @abstractmethod
    async def close(self) -> None:
        """Closes the connections."""

    async def call(
        self,
        method: str,
        path: str,
        *,
        body: Body | None = None,
        params: Mapping[str, str | int | None] | None = None,
        headers: Mapping[str, str] | None = None,
    ) -> httpx.Response:
        """Returns a successful answer.

        Raises :class:`ProblemError` if the service refuses and :class:`Unreachable` if no answer comes.
        """
        content = body if body is None or isinstance(body, bytes) else encoded(body)
        media = {} if body is None else {"content-type": "application/json"}
        given = {name: value for name, value in (params or {}).items() if value is not None}
        request = self.http.build_request(
            method, path, content=content, params=given or None, headers={**media, **(headers or {})}
        )
        lost = False
        for attempt in range(self.retries + 1):
            last = attempt == self.retries
            try:
                response = await self.send(request)
            except httpx.RequestError as error:
                if last or not isinstance(error, _LOST):
                    raise Unreachable(self.silence(f"{method} {request.url}", error, attempt + 1)) from error
                if not lost:
                    self.warn(error)
                lost, pause = True, growing_pause(attempt)
            else:
                # If the object is gone, the request whose answer was lost has deleted it.
                deleted = lost and method == "DELETE" and response.status_code == httpx.codes.NOT_FOUND
                if response.is_success or deleted:
                    return response
                wait = retry_after(response)
                if last or response.status_code not in RETRIED_STATUS or wait is None or wait > LONGEST_PAUSE:
                    raise of_response(response, wait)
                pause = max(wait, growing_pause(attempt))
            await self.pause(pause)
        raise AssertionError("the last attempt returns or raises")

    def silence(self, request: str, error: httpx.RequestError, tries: int) -> str:
        """Returns the message for a request that got no answer after the last retry."""
        if isinstance(error, _NOBODY):
            return f"nothing answers at {self.http.base_url}, tried {tries} times: {error}. {_START}"
        return f"no answer to {request}: {error!r}"

    def warn(self, error: httpx.RequestError) -> None:
        """Warns that the request is being retried, which may take long."""
        longest = sum(min(FIRST_PAUSE * 2.0**attempt, LONGEST_PAUSE) for attempt in range(self.retries))
        lacking = f"nothing answers at {self.http.base_url} yet" if isinstance(error, _NOBODY) else "an answer was lost"
        advised = f" {_START}" if isinstance(error, _NOBODY) else ""
        text = f"{lacking} ({error}): trying again for up to {longest:.0f} s.{advised}"
        # Points the warning at the line of the program, not at one of this package.
        own = itertools.takewhile(lambda frame: Path(frame.filename).parent == _HERE, inspect.stack(0))
        warnings.warn(text, Repeating, stacklevel=1 + sum(1 for _ in own))

    async def json(
        self,
        method: str,
        path: str,
        *,
        body: Body | None = None,
        params: Mapping[str, str | int | None] | None = None,
        headers: Mapping[str, str] | None = None,
    ) -> Any:
        """Returns the JSON of a successful answer; otherwise as :meth:`call`."""
        response = await self.call(method, path, body=body, params=params, headers=headers)
        try:
            return response.json()
        except ValueError as error:
            # The answer came from something in between, such as a sign-in page.
            raise of_response(response, None) from error

    def _listening(self, last_event_id: str) -> dict[str, Any]:
        headers = {"accept": "text/event-stream"} | ({"last-event-id": last_event_id} if last_event_id else {})
        return {"headers": headers, "timeout": httpx.Timeout(self.http.timeout.connect, read=STREAM_SILENCE)}


class Waiting(Transport):
    """A blocking transport, whose coroutines never suspend. You can share it between threads."""

    def __init__(self, http: httpx.Client, retries: int) -> None:
        self.http: httpx.Client = http
        self.retries = retries

    async def send(self, request: httpx.Request) -> httpx.Response:
        return self.http.send(request)

    async def pause(self, seconds: float) -> None:
        time.sleep(seconds)

    @asynccontextmanager
    async def stream(self, path: str, last_event_id: str) -> AsyncIterator[AsyncIterator[bytes]]:
        with self.http.stream("GET", path, **self._listening(last_event_id)) as response:
            if not response.is_success:
                response.read()
                raise of_response(response, retry_after(response))
            yield _in_turn(response.iter_bytes())

    async def close(self) -> None:
        self.http.close()


class Awaiting(Transport):
    """An asynchronous transport. Use it in one event loop of asyncio only."""

    def __init__(self, http: httpx.AsyncClient, retries: int) -> None:
        self.http: httpx.AsyncClient = http
        self.retries = retries

    async def send(self, request: httpx.Request) -> httpx.Response:
        return await self.http.send(request)

    async def pause(self, seconds: float) -> None:
        await asyncio.sleep(seconds)

    @asynccontextmanager
    async def stream(self, path: str, last_event_id: str) -> AsyncIterator[AsyncIterator[bytes]]:
        async with self.http.stream("GET", path, **self._listening(last_event_id)) as response:
            if not response.is_success:
                await response.aread()
                raise of_response(response, retry_after(response))
            yield response.aiter_bytes()

    async def close(self) -> None:
        await self.http.aclose()


async def _in_turn(chunks: Iterator[bytes]) -> AsyncIterator[bytes]:
    for chunk in chunks:
        yield chunk


def encoded(body: Mapping[str, Any] | Sequence[Any]) -> bytes:
    """Encodes JSON. NumPy scalars become numbers. Raises ``ValueError``, which names the first NaN or infinity."""

    def plain(value: Any) -> Any:
        if hasattr(value, "item"):
            return value.item()
        raise TypeError(f"{value!r} of type {type(value).__name__} is not JSON")

    try:
        return json.dumps(body, allow_nan=False, default=plain).encode()
    except ValueError:
        for path, value in _numbers(body, ""):
            if not math.isfinite(value):
                raise ValueError(f"{path} is {value}: must be finite") from None
        raise


def _numbers(value: Any, path: str) -> Iterator[tuple[str, float]]:
    """Iterates over the floating-point numbers of a body, each with its dotted path."""
    if isinstance(value, float):
        yield path, value
    elif isinstance(value, Mapping):
        for name, inner in value.items():
            yield from _numbers(inner, f"{path}.{name}" if path else str(name))
    elif isinstance(value, (list, tuple)):
        for index, inner in enumerate(value):
            yield from _numbers(inner, f"{path}[{index}]")


def retry_after(response: httpx.Response) -> float | None:
    """Returns the pause that an answer requests, in seconds. RFC 9110 allows a number or a date."""
    text = response.headers.get("retry-after")
    if text is None:
        return None
    try:
        return max(0.0, float(text) if text.isdigit() else parsedate_to_datetime(text).timestamp() - time.time())
    except ValueError:
        return None


def growing_pause(attempt: int) -> float:
    """Returns the seconds before retry ``attempt`` (from 0), randomised so that clients do not retry all at once."""
    return random.uniform(0.5, 1.0) * min(FIRST_PAUSE * 2.0**attempt, LONGEST_PAUSE)
