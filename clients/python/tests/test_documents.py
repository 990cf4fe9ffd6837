"""The code of the READMEs and the examples runs, and prints what the documents show."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import BINARY, REPOSITORY, Service

HERE = REPOSITORY / "clients/python"
URL = "http://127.0.0.1:8080"


def blocks(text: str) -> list[str]:
    return re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)


def run(code: str, service: Service, folder: Path = HERE) -> subprocess.CompletedProcess[str]:
    assert URL in code
    command = [sys.executable, "-W", "error", "-c", code.replace(URL, service.url)]
    return subprocess.run(command, text=True, capture_output=True, check=True, cwd=folder)


def test_the_readme_of_the_client_runs(service: Service) -> None:
    first, quick_start, declared, awaited, error = blocks((HERE / "README.md").read_text())
    read, advised = run(first, service, REPOSITORY).stdout.splitlines()
    assert read.startswith("1109 monthly simple returns as fractions, ") and re.match(r"0\.78\d+ \[\]$", advised)
    lines = run(quick_start, service).stdout.splitlines()
    assert [line.split()[0] for line in lines[:3]] == ["1", "2", "3"]
    assert lines[0].endswith(" 100.0") and lines[3].count("'log_return'") == 3
    together = json.loads(run(quick_start + awaited, service).stdout.splitlines()[-1])
    assert len(together) == 2 and all(0.0 <= allocation <= 1.0 for allocation in together)
    actions, value, *compared = run(declared, service).stdout.splitlines()
    assert re.match(r"\{'order': \d+\.\d+\}$", actions) and 100 < float(value) < 250
    assert [line.split()[0] for line in compared[-2:]] == ["robust", "base"]
    expected = error.split("#")[1].strip()
    assert run(quick_start + error, service).stdout.splitlines()[-1] == expected


def test_the_readme_of_the_repository_runs(service: Service) -> None:
    (code,) = blocks((REPOSITORY / "README.md").read_text())
    assert len(code.splitlines()) == 5
    allocations = [float(line) for line in run(code, service).stdout.splitlines()]
    assert len(allocations) == 2 and all(0.0 <= allocation <= 1.0 for allocation in allocations)


def test_the_example_prints_the_table_of_the_demo(service: Service) -> None:
    count = ["--count", "20"]
    script = HERE / "examples/us_market.py"
    example = [sys.executable, "-W", "error", str(script), "--url", service.url, *count]
    printed = subprocess.run(example, text=True, capture_output=True, check=True).stdout
    demo = subprocess.run([str(BINARY), "demo", *count], text=True, capture_output=True, check=True).stdout
    assert table(printed) == table(demo)


def test_the_pictures_of_the_concepts_are_those_that_are_drawn(service: Service, tmp_path: Path) -> None:
    command = [sys.executable, "-W", "error", str(HERE / "examples/concepts.py")]
    arguments = ["--url", service.url, "--out", str(tmp_path)]
    printed = subprocess.run(command + arguments, text=True, capture_output=True, check=True).stdout
    assert f"```text\n{printed}```" in (REPOSITORY / "docs/concepts.md").read_text()
    drawn = {path.name: parts(path) for path in tmp_path.iterdir()}
    kept = {path.name: parts(path) for path in (REPOSITORY / "docs/images").glob("*.svg")}
    assert len(drawn) == 4 and drawn.keys() == kept.keys()
    for name, (marks, places) in drawn.items():
        assert marks == kept[name][0]
        # Positions have one decimal, and another processor may round a sum the other way.
        assert places == pytest.approx(kept[name][1], abs=0.11)


def parts(picture: Path) -> tuple[list[str], list[float]]:
    """Splits a picture into its text without the numbers, and the numbers."""
    pieces = re.split(r"(-?\d+(?:\.\d+)?)", picture.read_text())
    return pieces[::2], [float(number) for number in pieces[1::2]]


def test_the_first_advice_runs(service: Service, tmp_path: Path) -> None:
    page = (REPOSITORY / "docs/first-advice.md").read_text()
    (cut,) = (line for line in page.splitlines() if line.startswith("cut "))
    (tmp_path / "data").symlink_to(REPOSITORY / "data")
    subprocess.run(cut, shell=True, cwd=tmp_path, check=True)
    (code,) = blocks(page)
    printed = run(code, service, tmp_path).stdout.splitlines()
    assert printed[0].startswith("1109 monthly simple returns as fractions, ")
    quoted = re.search(r"band +(\S+) % to (\S+) %", page)
    assert quoted is not None
    allocation, low, high = (float(number) for number in re.findall(r"[\d.]+", printed[1]))
    assert (round(100 * low, 1), round(100 * high, 1)) == (float(quoted[1]), float(quoted[2])) and allocation == low


def table(text: str) -> list[str]:
    lines = text.splitlines()
    start = next(at for at, line in enumerate(lines) if line.startswith("The year 2008"))
    found = lines[start : start + 14]
    assert [line[:7] for line in found[2:]] == [f"2008-{month:02}" for month in range(1, 13)]
    return found


#: Calls of a user, with the error that the types report for each wrong one.
CALLS = [
    ('session.action()["allocation"] + 1.0', None),
    ('session.action()["alocation"]', "typeddict-item"),
    ('[job["state"] for job in ballast.jobs() if job["stat"]]', "typeddict-item"),
    ("advised: wire.Advised = ballast.advise([0.1, 0.2], kind='log', rate_per_step=0.0)", None),
    ("wrong: wire.AssetsAdvised = ballast.advise([0.1, 0.2], kind='log', rate_per_step=0.0)", "assignment"),
    ('ballast.train([0.1, 0.2], kind="price", rate_per_step=0.0)', None),
    ('ballast.train([0.1, 0.2], kind="prices", rate_per_step=0.0)', "arg-type"),
    ('ballast.train("fund.csv", choices={"unit": "percent"})', None),
    ('ballast.train("fund.csv", choices={"unit": "per mille"})', "arg-type"),
    ('ballast.train(kind="price")', "call-arg"),
    ('ballast.train([0.1, 0.2], kind="log", rate_per_step=0.0, radius={"rule": "fixed", "radius": 0.01})', None),
    ('ballast.train([0.1, 0.2], kind="log", rate_per_step=0.0, radius={"rule": "fixed", "kappa": 0.01})', "arg-type"),
    ("session.observe(simple_return=0.01).action()", None),
    ("session.observe(0.01)", "misc"),
    ("session.observe(simple_retrun=0.01)", "call-arg"),
    ('session.replay([0.1], kind="log").empty', None),
    ('(await (await other.training("x")).session(wealth=1.0)).period + 1', None),
    ('(await (await other.session("x")).action())["alocation"]', "typeddict-item"),
    ('(await other.session("x")).action()["allocation"]', "index"),
]


def test_types_reach_those_who_install_it(tmp_path: Path) -> None:
    """Checks in another folder, in which mypy finds the installed package by its py.typed."""
    lines = [
        "from ballast import AsyncBallast, Ballast, Session, wire",
        "async def use(ballast: Ballast, session: Session, other: AsyncBallast) -> None:",
    ]
    first = len(lines) + 1
    (tmp_path / "use.py").write_text("\n".join(lines + [f"    {call}" for call, _ in CALLS]) + "\n")
    # Skips the types of pandas and matplotlib, which take long to read.
    (tmp_path / "mypy.ini").write_text(
        "[mypy]\n[mypy-pandas.*,matplotlib.*]\nfollow_imports = skip\nfollow_imports_for_stubs = true\n"
    )
    command = [sys.executable, "-m", "mypy", "--strict", "--hide-error-context", "use.py"]
    output = subprocess.run(command, cwd=tmp_path, text=True, capture_output=True).stdout
    errors = re.findall(r"^use\.py:(\d+): error: .*\[([a-z-]+)\]$", output, re.MULTILINE)
    # If a line has several errors, keeps the first.
    found = {int(line): code for line, code in reversed(errors)}
    assert found == {number: code for number, (_, code) in enumerate(CALLS, start=first) if code}, output
