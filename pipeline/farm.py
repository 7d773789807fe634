"""The farm: the stages in batches of frames, each batch a process of its own.

`synth` is sequential in time and runs as one process; `bake` and `render` run per batch; `figure` is one process
again. Every command is idempotent, so a batch that failed is simply run again; `--dry-run` prints the commands
for a farm with a queue of its own. A blank line between them means: wait for all above.
"""

from __future__ import annotations

import shlex
import subprocess
import sys
import time
from pathlib import Path

from pipeline.errors import BadInput, FlowloomError
from pipeline.frame_ranges import spelled
from pipeline.scene import load


class BatchFailed(FlowloomError):
    """A process of the farm failed; it said why, and its exit code is ours."""

    def __init__(self, command: list[str], code: int):
        self.exit_code = code if code > 0 else 128 - code
        super().__init__(f"{shlex.join(command)} ended with exit code {self.exit_code}")


def steps(scene: Path, batch: int, quick: bool, out: Path) -> list[list[list[str]]]:
    """The commands; those of one step may run at the same time, the steps must not."""
    scenes = load(scene, quick)
    last = max(s.frames for s in scenes.variants.values())
    batches = [spelled(range(first, min(first + batch, last + 1))) for first in range(1, last + 1, batch)]
    # -P: a folder `pipeline` in the working directory is none of ours
    flowloom = [sys.executable, "-P", "-m", "pipeline.cli"]
    end = [str(scene), "--out", str(out), *(["--quick"] if quick else [])]
    per_frame = [[[*flowloom, verb, *end, "--frames", frames] for frames in batches] for verb in ("bake", "render")]
    return [[[*flowloom, "synth", *end]], *per_frame, [[*flowloom, "figure", *end]]]


def run(scene: Path, workers: int, batch: int, quick: bool, out: Path, quiet: bool, dry_run: bool) -> None:
    """Run the steps, `workers` processes at a time. Raises BatchFailed after the first that fails."""
    for name, value in (("--workers", workers), ("--batch", batch)):
        if value < 1:
            raise BadInput(name, "", f"must be at least 1, not {value}")
    for number, step in enumerate(steps(scene, batch, quick, out)):
        if dry_run:
            print(*([""] if number else []), *map(shlex.join, step), sep="\n")
        else:
            _run_step(step, workers, quiet)


def _run_step(commands: list[list[str]], workers: int, quiet: bool) -> None:
    waiting, running = list(commands), list[subprocess.Popen[bytes]]()
    try:
        while waiting or running:
            while waiting and len(running) < workers:
                # one process may show its progress; several at once would write over each other
                silent = ["--quiet"] if quiet or len(commands) > 1 else []
                running.append(subprocess.Popen(waiting.pop(0) + silent))
            for process in [p for p in running if p.poll() is not None]:
                running.remove(process)
                if process.returncode:
                    raise BatchFailed(list(map(str, process.args)), process.returncode)  # type: ignore[arg-type]
            time.sleep(0.02)
    finally:
        for process in running:
            process.terminate()
        for process in running:
            process.wait()
