"""The tests run on the installed package, which comes from the built wheel."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import venv
from importlib import metadata
from pathlib import Path

from conftest import BINARY, REPOSITORY

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


def test_one_wheel_brings_the_program_and_the_client(tmp_path: Path) -> None:
    """Installs it into an environment with only Python, as on a machine without Rust."""
    program = tmp_path / "ballast"
    shutil.copy(BINARY, program)
    if strip := shutil.which("strip"):
        # The build of the tests has symbols that are larger than the program.
        subprocess.run([strip, program], check=True)
    environment = {**os.environ, "BALLAST_PROGRAM": str(program)}
    build = [sys.executable, "-m", "build", "--wheel", "--outdir", str(tmp_path), str(HERE)]
    subprocess.run(build, env=environment, check=True, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    assert re.match(r"ballast_client-[0-9.]+-py3-none-(?!any)\w+\.whl$", wheel.name)
    venv.create(tmp_path / "empty", with_pip=True)
    scripts = tmp_path / "empty/bin"
    subprocess.run([scripts / "pip", "install", "--quiet", wheel], check=True)
    advise: list[str | Path] = [scripts / "ballast", "advise", REPOSITORY / "data/us_market_monthly.csv", "--json"]
    advice = json.loads(subprocess.run(advise, check=True, capture_output=True, text=True).stdout)
    code = (
        "import subprocess, sys\n"
        "from ballast import Ballast\n"
        "arguments = ['ballast', 'serve', '--listen', '127.0.0.1:0', '--data', sys.argv[1]]\n"
        "service = subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True)\n"
        "url = service.stdout.readline().removeprefix('listening on ').strip()\n"
        "print(Ballast(url).advise(sys.argv[2])['allocation'])\n"
        "service.terminate()\n"
    )
    arguments: list[str | Path] = [
        scripts / "python",
        "-c",
        code,
        tmp_path / "data",
        REPOSITORY / "data/us_market_monthly.csv",
    ]
    # The environment contains only what the wheel brought.
    from_python = subprocess.run(
        arguments, check=True, capture_output=True, text=True, env={"PATH": str(scripts)}, cwd=tmp_path
    )
    assert float(from_python.stdout) == advice["allocation"]
