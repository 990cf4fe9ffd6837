"""Server-sent events, as this service sends them: https://html.spec.whatwg.org/multipage/server-sent-events.html"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass


@dataclass(frozen=True)
class Event:
    """One event. A client that reconnects sends its ``id`` as ``Last-Event-ID``."""

    id: str
    name: str
    data: str


class Parser:
    """Parses the events of a stream of bytes as they arrive. It leaves out an event that is cut off."""

    def __init__(self) -> None:
        self._rest = b""
        self._fields: dict[str, str] = {}

    def feed(self, chunk: bytes) -> Iterator[Event]:
        """Yields the events that end in this chunk."""
        # Split at line feeds alone: str.splitlines would also cut at characters that JSON may hold.
        *whole, self._rest = (self._rest + chunk).split(b"\n")
        for line in whole:
            yield from self._line(line.removesuffix(b"\r").decode())

    def _line(self, line: str) -> Iterator[Event]:
        fields = self._fields
        if line:
            name, _, value = line.partition(":")
            value = value.removeprefix(" ")
            # Several lines of data are one text. A line without a name is a comment, which here is the keep-alive.
            fields[name] = f"{fields['data']}\n{value}" if name == "data" and "data" in fields else value
            return
        self._fields = {}
        if "data" in fields:
            yield Event(fields.get("id", ""), fields.get("event", "message"), fields["data"])
