"""Progress of long work on stderr: what is being made, how many frames are done, and an honest time to go."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass


@dataclass(frozen=True)
class Progress:
    """Shows one bar per artifact on a terminal; says nothing when `quiet` or when stderr is a pipe or a file."""

    quiet: bool = False

    @contextmanager
    def task(self, label: str, total: int, done: int = 0) -> Iterator[Callable[[], None]]:
        """`with task(...) as advance:` call advance() after each of the frames that are left."""
        if self.quiet or not sys.stderr.isatty():
            yield lambda: None
            return
        from rich import console, progress

        bar = progress.Progress(
            progress.TextColumn("{task.description}"), progress.BarColumn(), progress.MofNCompleteColumn(),
            progress.TextColumn("{task.fields[left]}"), console=console.Console(stderr=True))
        start, made = time.monotonic(), 0
        with bar:
            task = bar.add_task(label, total=total, completed=done, left="")

            def advance() -> None:
                nonlocal made
                made += 1
                left = remaining(time.monotonic() - start, made, total - done - made)
                bar.update(task, advance=1, left=f"{spelled(left)} to go" if total > done + made else "")

            yield advance

    def note(self, line: str) -> None:
        """Tell the user one line that needs no answer: on stderr, also in a log, but for a `quiet` run."""
        if not self.quiet:
            sys.stderr.write(f"{line}\n")


def remaining(elapsed: float, made: int, left: int) -> float:
    """Seconds to go, from what this run alone has made: frames that were there before cost it nothing."""
    return elapsed / made * left


def spelled(seconds: float) -> str:
    """A duration as one reads it: 48 s, 12 min, 3 h 05 min."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 90 else f"{minutes // 60} h {minutes % 60:02d} min"
