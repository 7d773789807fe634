"""`python -m bench [part …]`, the parts below, all without: measure, print tables, replace the parts' sections in
bench/RESULTS.md, and write out/bench.json."""

from __future__ import annotations

import argparse
import datetime
import json
import subprocess
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from bench import results
from bench.machine import machine, revision
from bench.results import PARTS
from bench.targets import HEADER, ROWS, Row
from pipeline.files import atomic

JSON = Path("out/bench.json")


def measured(module: str) -> dict[str, Any]:
    """What `python -m bench.<module>` prints, run in a process of its own."""
    child = subprocess.run([sys.executable, "-m", f"bench.{module}"], stdout=subprocess.PIPE, text=True, check=True)
    found: dict[str, Any] = json.loads(child.stdout)
    return found


def table(header: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """Columns as wide as their widest entry; numbers to the right."""
    lines = [list(header), *(["" if cell is None else cell for cell in line] for line in rows)]
    widths = [max(len(results.text(line[i])) for line in lines) for i in range(len(header))]
    return "\n".join("  ".join(results.text(cell).rjust(width) if isinstance(cell, int | float)
                               else results.text(cell).ljust(width)
                               for cell, width in zip(line, widths, strict=True)).rstrip() for line in lines)


def main() -> int:
    options = argparse.ArgumentParser(prog="python -m bench", description=__doc__)
    options.add_argument("parts", nargs="*", metavar="part", help=f"{', '.join(PARTS)}; all without")
    chosen = options.parse_args().parts or PARTS
    if unknown := set(chosen) - {*PARTS}:
        options.error(f"no part is called {', '.join(sorted(unknown))}")
    found: dict[str, Any] = {"machine": machine(), "revision": revision()}
    print("\n".join(f"{key}: {value}" for key, value in found["machine"].items()))
    print(f"revision: {found['revision']}", flush=True)
    rows: list[Row] = []
    failed = []
    for part in chosen:
        print(f"... {part}", file=sys.stderr, flush=True)
        facts, at, today = machine(), revision(), datetime.datetime.now(datetime.UTC).date().isoformat()
        try:
            found[part] = measured(part)
        except subprocess.CalledProcessError as error:
            failed.append(part)
            print(f"    {part} failed (exit {error.returncode}); its section stays as it was", file=sys.stderr)
            continue
        rows += ROWS[part](found[part])
        results.write(part, found[part], facts, at, today)
    if rows:
        print(f"\n{table(HEADER, [row.cells for row in rows])}")
    for part in (part for part in PARTS if part in found):
        for name, lines in results.tables(found[part]):
            print(f"\n{name}\n{table(list(lines[0]), (list(line.values()) for line in lines))}")
    atomic.write_text(JSON, json.dumps(found, indent=1, ensure_ascii=False) + "\n")
    print(f"\nwritten: bench/{results.RESULTS.name}, {JSON}")
    if failed:
        print(f"failed: {', '.join(failed)}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
