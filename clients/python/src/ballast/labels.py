"""What policies and sessions are called."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

from . import wire
from .transport import Transport


def relabelled(name: str | None, notes: str | None, tags: Sequence[str] | None) -> wire.Relabel:
    """The labels that are given; one that is ``None`` stays as it is, and one that is empty is cleared."""
    change: wire.Relabel = {}
    if name is not None:
        change["name"] = name
    if notes is not None:
        change["notes"] = notes
    if tags is not None:
        change["tags"] = list(tags)
    return change


class Labelled:
    """What has labels at its path."""

    _transport: Transport
    _path: str

    async def _label(
        self, *, name: str | None = None, notes: str | None = None, tags: Sequence[str] | None = None
    ) -> wire.Labels:
        """Changes what it is called, and answers what it is called now.

        What is ``None`` stays as it is, and what is empty is cleared. A ``name`` has at most 100 characters and need
        not be of this one alone, ``notes`` have at most 2,000, and of ``tags`` there are at most 20, each another, of
        at most 50. Detail and lists show them.
        """
        change = relabelled(name, notes, tags)
        return cast(wire.Labels, await self._transport.json("PATCH", self._path, body=change))
