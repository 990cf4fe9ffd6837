"""One core, two drivers: calls are written once, as coroutines, and become those that wait and those to be awaited.

What a call does (what it sends, what it repeats, what it makes of the answer) is a coroutine of a class whose name
begins with an underscore, such as ``_Session._observe``. It suspends nowhere but in a :class:`Transport
<ballast.transport.Transport>`. Over a :class:`Waiting <ballast.transport.Waiting>` transport, which waits on the
spot, it does not suspend at all, so that :func:`run` gets its result in one go and needs no event loop, not even
where one runs already, as in a notebook. Over an :class:`Awaiting <ballast.transport.Awaiting>` transport it is an
ordinary coroutine.
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
#: What comes over the wire, and what is made of it.
W = TypeVar("W")
R = TypeVar("R")


def run(awaitable: Awaitable[R]) -> R:
    """The result of something that never suspends."""
    steps = awaitable.__await__()
    try:
        next(steps)
    except StopIteration as end:
        result: R = end.value
        return result
    raise RuntimeError("a call over a transport that waits was suspended")


def blocking(method: Callable[Concatenate[S, P], Coroutine[Any, Any, R]]) -> Callable[Concatenate[S, P], R]:
    """The call that waits."""

    @functools.wraps(method)
    def call(self: S, /, *args: P.args, **kwargs: P.kwargs) -> R:
        return run(method(self, *args, **kwargs))

    return call


class Answering(Generic[R]):
    """Calls that wait and answer with this TypedDict, which mypy otherwise shows without its name: it forgets that of
    one that it infers beside a ParamSpec. ``tests/test_async.py`` compares it with what the coroutine says."""

    def __init__(self, answer: type[R]) -> None:
        self._answer = answer

    def blocking(self, method: Callable[Concatenate[S, P], Coroutine[Any, Any, Any]]) -> Callable[Concatenate[S, P], R]:
        """The call that waits."""
        return _answering(blocking(method), method, self._answer)

    def iterating(
        self, method: Callable[Concatenate[S, P], AsyncIterator[Any]]
    ) -> Callable[Concatenate[S, P], Iterator[R]]:
        """The iterator that waits; where it is left early, what it holds open is closed."""

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
    """The call that waits, and makes an object of what it gets."""

    @functools.wraps(method)
    def call(self: D, /, *args: P.args, **kwargs: P.kwargs) -> R:
        return made(self._transport, run(method(self, *args, **kwargs)))

    return _answering(call, method, made)


def awaiting_into(
    method: Callable[Concatenate[D, P], Coroutine[Any, Any, W]], made: Callable[[Transport, W], R]
) -> Callable[Concatenate[D, P], Coroutine[Any, Any, R]]:
    """The call to be awaited that makes an object of what it gets."""

    @functools.wraps(method)
    async def call(self: D, /, *args: P.args, **kwargs: P.kwargs) -> R:
        return made(self._transport, await method(self, *args, **kwargs))

    return _answering(call, method, made)


def _answering(call: S, method: Callable[..., object], made: object) -> S:
    """Shows what is made in the place of what the coroutine says."""
    setattr(call, "__signature__", inspect.signature(method).replace(return_annotation=made))  # noqa: B010
    return call
