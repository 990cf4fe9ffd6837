"""An agent's client, from its registry, and the tools of the service."""

from __future__ import annotations

import asyncio

import pytest
from conftest import RETURNS, Service
from mcp import Client
from mcp_types import TextContent

#: The handshake of earlier revisions, and the newest revision without one.
MODES = ["legacy", "auto"]


@pytest.mark.parametrize("mode", MODES)
def test_a_client_lists_the_tools_and_calls_one(service: Service, mode: str) -> None:
    async def talk() -> None:
        async with Client(f"{service.url}/mcp", mode=mode) as client:
            assert client.protocol_version == {"legacy": "2025-11-25", "auto": "2026-07-28"}[mode]
            tools = (await client.list_tools()).tools
            assert {"advise", "action", "what_if"} <= {tool.name for tool in tools}
            assert all(tool.annotations is not None and tool.annotations.read_only_hint for tool in tools)
            problem = {"history": RETURNS, "rate_per_step": 0.001}
            answer = await client.call_tool("advise", {"problem": problem})
            assert not answer.is_error and isinstance(answer.structured_content, dict)
            assert 0.0 <= answer.structured_content["allocation"] <= 1.0
            refused = await client.call_tool("advise", {"problem": {**problem, "colour": 1}})
            text = refused.content[0]
            assert refused.is_error and isinstance(text, TextContent) and "problem.colour" in text.text

    asyncio.run(talk())
