"""Makes a blocking and an asynchronous call from each coroutine, so that every call is written once.

A call is a coroutine of a class whose name begins with an underscore, such as ``_Session._observe``. The coroutine
decides what to send, what to retry and what to make of the answer. It suspends only in a :class:`Transport
<ballast.transport.Transport>`. A :class:`Waiting <ballast.transport.Waiting>` transport blocks and never suspends, so
:func:`run` gets the result at once and needs no event loop. It also works inside a running loop, as in a notebook. Over
an :class:`Awaiting <ballast.transport.Awaiting>` transport the call is an ordinary coroutine.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import AsyncIterator, Awaitable, Callable, Coroutine, Iterator
from types import GenericAlias
from typing import Any, Concatenate, Generic, ParamSpec, Protocol, TypeVar

from .transport import Transport


class _Driven(Protocol):
    _transport: Transport


S = TypeVar("S")
D = TypeVar("D", bound=_Driven)
P = ParamSpec("P")
#: The answer on the wire, and the object made from it.
W = TypeVar("W")
R = TypeVar("R")


def run(awaitable: Awaitable[R]) -> R:
    """Returns the result of an awaitable that never suspends."""
    steps = awaitable.__await__()
    try:
        next(steps)
    except StopIteration as end:
        result: R = end.value
        return result
    raise RuntimeError("a call over a blocking transport was suspended")


def blocking(method: Callable[Concatenate[S, P], Coroutine[Any, Any, R]]) -> Callable[Concatenate[S, P], R]:
    """Returns the blocking call of a coroutine."""

    @functools.wraps(method)
    def call(self: S, /, *args: P.args, **kwargs: P.kwargs) -> R:
        return run(method(self, *args, **kwargs))

    return call


class Answering(Generic[R]):
    """Makes blocking calls that return this TypedDict.

    mypy loses the name of a TypedDict that it infers together with a ParamSpec, so it is given here.
    ``tests/test_async.py`` compares it with the annotation of the coroutine.
    """

    def __init__(self, answer: type[R]) -> None:
        self._answer = answer

    def blocking(self, method: Callable[Concatenate[S, P], Coroutine[Any, Any, Any]]) -> Callable[Concatenate[S, P], R]:
        """Returns the blocking call of a coroutine."""
        return _answering(blocking(method), method, self._answer)

    def iterating(
        self, method: Callable[Concatenate[S, P], AsyncIterator[Any]]
    ) -> Callable[Concatenate[S, P], Iterator[R]]:
        """Returns the blocking iterator. If it is abandoned early, it closes what it holds open."""

        @functools.wraps(method)
        def call(this: S, /, *args: P.args, **kwargs: P.kwargs) -> Iterator[R]:
            found = method(this, *args, **kwargs)
            try:
                while True:
                    try:
                        yield run(found.__anext__())
                    except StopAsyncIteration:
                        return
            finally:
                if inspect.isasyncgen(found):
                    run(found.aclose())

        return _answering(call, method, GenericAlias(Iterator, self._answer))


def blocking_into(
    method: Callable[Concatenate[D, P], Coroutine[Any, Any, W]], made: Callable[[Transport, W], R]
) -> Callable[Concatenate[D, P], R]:
    """Returns the blocking call, which makes an object of the answer."""

    @functools.wraps(method)
    def call(self: D, /, *args: P.args, **kwargs: P.kwargs) -> R:
        return made(self._transport, run(method(self, *args, **kwargs)))

    return _answering(call, method, made)


def awaiting_into(
    method: Callable[Concatenate[D, P], Coroutine[Any, Any, W]], made: Callable[[Transport, W], R]
) -> Callable[Concatenate[D, P], Coroutine[Any, Any, R]]:
    """Returns the asynchronous call, which makes an object of the answer."""

    @functools.wraps(method)
    async def call(self: D, /, *args: P.args, **kwargs: P.kwargs) -> R:
        return made(self._transport, await method(self, *args, **kwargs))

    return _answering(call, method, made)


def _answering(call: S, method: Callable[..., object], made: object) -> S:
    """Annotates the call with what it makes instead of what the coroutine returns."""
    setattr(call, "__signature__", inspect.signature(method).replace(return_annotation=made))  # noqa: B010
    return call
