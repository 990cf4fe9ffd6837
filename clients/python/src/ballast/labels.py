"""The labels of policies and sessions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

from . import wire
from .transport import Transport


def relabelled(name: str | None, notes: str | None, tags: Sequence[str] | None) -> wire.Relabel:
    """Returns the labels that change. ``None`` leaves a label unchanged, and an empty value clears it."""
    change: wire.Relabel = {}
    if name is not None:
        change["name"] = name
    if notes is not None:
        change["notes"] = notes
    if tags is not None:
        change["tags"] = list(tags)
    return change


class Labelled:
    """An object that has labels at its path."""

    _transport: Transport
    _path: str

    async def _label(
        self, *, name: str | None = None, notes: str | None = None, tags: Sequence[str] | None = None
    ) -> wire.Labels:
        """Changes the labels, and returns all of them.

        ``None`` leaves a label unchanged, and an empty value clears it. A ``name`` has at most 100 characters and need
        not be unique. ``notes`` have at most 2,000 characters. There are at most 20 ``tags``, all different, of at most
        50 characters each. The detail and the lists show the labels.
        """
        change = relabelled(name, notes, tags)
        return cast(wire.Labels, await self._transport.json("PATCH", self._path, body=change))
