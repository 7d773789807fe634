"""What a run measured as Markdown, in bench/RESULTS.md: one section a part, each between two markers.

    <!-- part: search -->
    ## … (`search`)
    <!-- end of search -->

`write` replaces the section of one part and leaves every other byte of the file as it is. A section without its end
marker ends where the next section begins; a section that is missing is inserted in the order of `SECTIONS`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from bench.targets import HEADER, ROWS, Row, verdict
from pipeline.files import atomic

RESULTS = Path(__file__).with_name("RESULTS.md")

TITLES = {
    "synthesis": "ma09 in the plane: time, memory, and the speed-up over NumPy and SciPy",
    "search": "The exact search of ma09 beside FAISS",
    "density": "The density window of ma09 beside SciPy",
    "repeat": "The same bits in every run",
    "solid": "ma09 in space: time, memory, growth with the voxels, quality",
    "smoke": "One frame of smoke: ray marched, path traced, and Blender's Cycles",
    "quality": "How well the detail of ma09 reproduces its exemplar, and what each step gains",
    "boundary": "ma09 §3.6, Eq. 3: flow through a wall, and what observing the wall costs the texture",
    "potential": "ma09 §3.6: a potential synthesized instead of the motion",
    "lagrangian": "ma09 §5: detail at samples that move with the flow",
    "elements": "ma13: time, memory, growth with the elements, fidelity, jitter",
    "fidelity": "ma13: statistics of every scene beside those of its exemplar",
    "texture": "wang05: how like their sample moving textures stay, how they move, time, memory",
    "loops": "wang05: loops of 120 frames, 512² from 128²",
    "photo": "okabe11: look, motion, loop and truth on targets it was not tuned on, minimizers, time, memory",
}
PARTS = tuple(TITLES)  # measured by `python -m bench PART`
SECTIONS = (*PARTS, "figures", "earlier")  # the last two are written by hand

INTRODUCTION = """# Results

`python -m bench PART …` measures the parts it is given, or all of them, and replaces their sections here; everything
else in this file stays as it is. **ma09** is *Motion Field Texture Synthesis* (Ma, Wei, Guo, Zhou 2009), **ma13** is
*Dynamic Element Textures* (Ma, Wei, Lefebvre, Tong 2013), **wang05** is *Synthesizing 2D Directional Moving Texture*
(Wang, Wang, Sun, Yong 2005), **okabe11** is *Creating Fluid Animation from a Single Image using Video Database*
(Okabe, Anjyo, Onai 2011). Times are wall-clock seconds; processor time is summed over all cores and is the steadier
number on a shared machine. The targets are our own. The last column gives the number of the paper, or of another
program that does the same.
"""


def text(value: Any) -> str:
    """A value as it stands in a table."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return verdict(value)
    return f"{value:g}" if isinstance(value, float) else str(value)


def tables(found: Mapping[str, Any]) -> Iterator[tuple[str, list[dict[str, Any]]]]:
    """The lists of equal rows in what a part found, by name."""
    for name, lines in found.items():
        if isinstance(lines, list) and lines and all(isinstance(line, dict) for line in lines):
            yield name, lines


def markdown(header: Sequence[str], lines: Iterable[Sequence[Any]]) -> str:
    """A table; columns of numbers are set to the right."""
    lines = list(lines)
    numeric = [all(isinstance(line[i], int | float | None) and not isinstance(line[i], bool) for line in lines)
               for i in range(len(header))]
    rules = ["---:" if right else "---" for right in numeric]
    cells = [[text(cell).replace("|", "\\|") for cell in line] for line in (header, *lines)]
    return "\n".join(f"| {' | '.join(line)} |" for line in (cells[0], rules, *cells[1:]))


def driver(device: str) -> str:
    """The name of an OpenCL device and its platform, without the list of build options that PoCL adds."""
    name, *options = device.split(",")
    return " ".join(name.split()) + (")" if options and name.count("(") > name.count(")") else "")


def heading(part: str) -> str:
    return f"## {TITLES[part]} (`{part}`)"


def section(part: str, rows: Iterable[Row], lists: Iterable[tuple[str, list[dict[str, Any]]]],
            machine: Mapping[str, Any], revision: str, date: str) -> str:
    """What is written between the markers of a part."""
    rows = list(rows)
    missed = sum(row.met is False for row in rows)
    where = (f"Measured {date} at revision {revision}.\n{machine['processor']}, {machine['cores']} cores, load "
             f"{machine['load when it began']} when it began; OpenCL device {driver(machine['device'])}.")
    blocks = [heading(part), where]
    if missed:
        blocks.append(f"**{missed} of {sum(row.met is not None for row in rows)} targets MISSED.**")
    if rows:
        blocks.append(markdown(HEADER, [row.cells for row in rows]))
    for name, lines in lists:
        blocks += [f"### {name}", markdown(list(lines[0]), [list(line.values()) for line in lines])]
    return "\n\n".join(blocks)


def placeholder(part: str) -> str:
    """What stands in the place of a part that was not measured."""
    return f"{heading(part)}\n\nNot measured yet with this revision; run `python -m bench {part}`."


def between_markers(name: str, content: str) -> str:
    return f"<!-- part: {name} -->\n{content.strip()}\n<!-- end of {name} -->"


def replaced(page: str, name: str, content: str) -> str:
    """The page with another content of one section, every other byte as it was. ValueError for an unknown section."""
    if name not in SECTIONS:
        raise ValueError(f"no part is called {name!r}; there are {', '.join(SECTIONS)}")
    new = between_markers(name, content)
    start = page.find(f"<!-- part: {name} -->")
    if start >= 0:
        after = re.compile(r"<!-- part: ").search(page, start + 1)
        limit = after.start() if after else len(page)
        ending = f"<!-- end of {name} -->"
        end = page.find(ending, start, limit)
        if end >= 0:
            return page[:start] + new + page[end + len(ending):]
        return page[:start] + new + ("\n\n" if after else "\n") + page[limit:]
    later = [page.find(f"<!-- part: {other} -->") for other in SECTIONS[SECTIONS.index(name) + 1:]]
    at = min((place for place in later if place >= 0), default=None)
    if at is None:
        return f"{page.rstrip()}\n\n{new}\n" if page.strip() else f"{new}\n"
    return f"{page[:at]}{new}\n\n{page[at:]}"


def skeleton() -> str:
    """A page of which no part is measured."""
    return "\n".join([INTRODUCTION, *(f"{between_markers(part, placeholder(part))}\n" for part in PARTS)])


def write(part: str, found: Mapping[str, Any], machine: Mapping[str, Any], revision: str, date: str,
          path: Path = RESULTS) -> None:
    """Replace the section of a part, as a whole or not at all."""
    if part not in PARTS:
        raise ValueError(f"no part is called {part!r}; there are {', '.join(PARTS)}")
    page = path.read_text(encoding="utf-8") if path.exists() else skeleton()
    content = section(part, ROWS[part](dict(found)), tables(found), machine, revision, date)
    atomic.write_text(path, replaced(page, part, content))
