"""What is tested is what is installed, and what is installed came out of the wheel that was built."""

from __future__ import annotations

import json
import re
from importlib import metadata
from pathlib import Path

from conftest import REPOSITORY

import ballast

HERE = REPOSITORY / "clients/python"


def test_the_package_under_test_is_the_one_of_the_wheel() -> None:
    found = metadata.distribution("ballast-client")
    origin = json.loads(found.read_text("direct_url.json") or "{}")
    assert re.search(r"/ballast_client-[0-9.]+-py3-none-any\.whl$", origin["url"])
    assert not Path(ballast.__file__).is_relative_to(HERE)
    shipped = {
        path.parts[1]: Path(str(found.locate_file(path))) for path in found.files or () if path.parts[0] == "ballast"
    }
    shipped.pop("__pycache__", None)
    sources = {path.name: path for path in (HERE / "src/ballast").iterdir() if path.is_file()}
    assert set(shipped) == set(sources) and {"py.typed", "wire.py"} <= set(shipped)
    for name, source in sources.items():
        assert shipped[name].read_bytes() == source.read_bytes(), f"{name}: run .ci/python, which builds and installs"


def test_what_the_package_needs_is_little_and_the_rest_is_chosen() -> None:
    needed = metadata.requires("ballast-client") or []
    always = {re.split(r"[<>=]", need)[0] for need in needed if "extra ==" not in need}
    assert always == {"httpx", "typing-extensions"}
    extras = set(re.findall(r"extra == '(\w+)'", "\n".join(needed)))
    readme = (HERE / "README.md").read_text()
    assert extras == {"pandas", "plots", "progress", "sklearn", "skfolio", "test"}
    assert extras - {"test"} <= set(re.findall(r"\[(\w+)\]", readme))
