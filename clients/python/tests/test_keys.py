"""A service that requires keys."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from conftest import BINARY, Service

from ballast import Ballast, Forbidden, Unauthenticated


def key(folder: Path, *roles: str) -> str:
    given = [argument for role in roles for argument in ("--role", role)]
    command = [str(BINARY), "keys", "create", "--new", "--data", str(folder), *given]
    return subprocess.run(command, text=True, capture_output=True, check=True).stdout.strip()


def test_a_key_is_given_or_taken_from_the_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    read, admin = key(tmp_path, "read"), key(tmp_path, "admin")
    service = Service(tmp_path)
    try:
        monkeypatch.delenv("BALLAST_KEY", raising=False)
        with Ballast(service.url) as nobody, pytest.raises(Unauthenticated):
            nobody.health()
        monkeypatch.setenv("BALLAST_KEY", read)
        with Ballast(service.url) as reader:
            assert list(reader.jobs()) == []
            with pytest.raises(Forbidden) as refusal:
                reader.health()
            assert refusal.value.rule == "must be a key with the role admin"
        with Ballast(service.url, key=admin) as operator:
            assert operator.health()["status"] == "ok"
    finally:
        service.stop()
