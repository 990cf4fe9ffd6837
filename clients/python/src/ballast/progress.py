"""Shows the progress of a job."""

from __future__ import annotations

import sys
from collections.abc import Callable
from contextlib import suppress
from typing import Any, TextIO

from . import wire

#: A function that is called with the job at every change.
Watch = Callable[[wire.Job], object]

#: States that a job does not leave.
TERMINAL = ("succeeded", "failed", "cancelled")


class ProgressPrinter:
    """A ``watch`` that prints the progress. On a terminal it rewrites one line; elsewhere it prints a line per step."""

    def __init__(self, file: TextIO | None = None) -> None:
        self._file = sys.stderr if file is None else file
        self._shown: tuple[str, int] | None = None

    def __call__(self, job: wire.Job) -> None:
        line = progress_line(job)
        with suppress(BrokenPipeError):
            if self._file.isatty():
                end = "\n" if job["state"] in TERMINAL else ""
                print(f"\r\x1b[K{line}", end=end, file=self._file, flush=True)
            elif self._shown != (now := (job["state"], job["progress"]["steps_done"])):
                self._shown = now
                print(line, file=self._file, flush=True)


class ProgressBar:
    """A ``watch`` that draws a bar of steps with tqdm, in a terminal or a notebook, until the job ends.

    Raises ``ImportError`` without tqdm.
    """

    def __init__(self, **tqdm: Any) -> None:
        try:
            from tqdm.auto import tqdm as bar
        except ImportError as error:
            raise ImportError("progress bars need tqdm: pip install 'ballast-client[progress]'") from error
        self._bar: Any = bar(**{"unit": "step", **tqdm})

    def __call__(self, job: wire.Job) -> None:
        progress = job["progress"]
        self._bar.total, self._bar.n = progress["steps_total"], progress["steps_done"]
        self._bar.set_description(job["state"], refresh=False)
        self._bar.refresh()
        if job["state"] in TERMINAL:
            self._bar.close()


def progress_line(job: wire.Job) -> str:
    """Describes a job in one line."""
    progress = job["progress"]
    line = f"{job['state']}: {progress['steps_done']} of {progress['steps_total']} steps"
    if (step := progress.get("step")) is not None:
        line += f", step {step}: {progress.get('points_done')} of {progress.get('points_total')} design points"
    if (left := progress.get("seconds_left")) is not None:
        line += f", about {left:.0f} s left"
    return line
