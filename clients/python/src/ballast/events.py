"""Server-sent events, as far as this service sends them: https://html.spec.whatwg.org/multipage/server-sent-events.html"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass


@dataclass(frozen=True)
class Event:
    """One event. ``id`` is what a reader that comes back shows as ``Last-Event-ID``."""

    id: str
    name: str
    data: str


def parsed(chunks: Iterable[bytes]) -> Iterator[Event]:
    """The events in a stream of bytes; one that was cut off is left out."""
    fields: dict[str, str] = {}
    for line in _lines(chunks):
        if line:
            name, _, value = line.partition(":")
            value = value.removeprefix(" ")
            # Several lines of data are one text; a line without a name is a comment, here the sign of life.
            fields[name] = f"{fields['data']}\n{value}" if name == "data" and "data" in fields else value
        else:
            if "data" in fields:
                yield Event(fields.get("id", ""), fields.get("event", "message"), fields["data"])
            fields = {}


def _lines(chunks: Iterable[bytes]) -> Iterator[str]:
    """Split at line feeds alone: str.splitlines would also cut at characters that JSON may hold."""
    rest = b""
    for chunk in chunks:
        *whole, rest = (rest + chunk).split(b"\n")
        for line in whole:
            yield line.removesuffix(b"\r").decode()
