"""`python -m bench [part …]`, the parts below, all without: measure, print tables, write out/bench.json."""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from bench.machine import machine

Row = tuple[str, str, str, str, str]
HEADER = ("what", "here", "reach", "", "the paper, or the peer")


def measured(module: str) -> dict[str, Any]:
    """What `python -m bench.<module>` prints, run in a process of its own."""
    child = subprocess.run([sys.executable, "-m", f"bench.{module}"], stdout=subprocess.PIPE, text=True, check=True)
    found: dict[str, Any] = json.loads(child.stdout)
    return found


def verdict(met: bool) -> str:
    return "met" if met else "MISSED"


def seconds(times: dict[str, float]) -> str:
    return f"{times['wall']:.2f} s ({times['processor']:.2f} s of processor)"


def synthesis_rows(found: dict[str, Any]) -> Iterable[Row]:
    for search, reach in (("exact", 3.0), ("k-coherence", 1.0)):
        times = found[f"{search}, first"]
        yield (f"ma09 2-D 64² to 256², {search}, first frame", seconds(times), f"{reach:g} s",
               verdict(times["wall"] <= reach), "60 s on a CPU, 3 to 5 s on a GeForce 8800 GTX")
        times = found[f"{search}, next"]
        yield ("    a later frame", seconds(times), f"{reach:g} s", verdict(times["wall"] <= reach), "the same")
    peak, rest = found["peak memory MB"], found["of it Python, libraries and PoCL at rest MB"]
    yield ("    peak memory", f"{peak} MB ({rest} MB at rest)", "500 MB", verdict(peak <= 500), "not said")
    times = found["times faster than the reference"]
    yield ("    times faster than NumPy and SciPy", f"{times:.1f}", "10", verdict(times >= 10),
           f"the reference: {seconds(found['reference'])}")


def search_rows(found: dict[str, Any]) -> Iterable[Row]:
    for dims, times in found.items():
        yield (f"exact search, 65,536 on 4,096, {dims}", f"{times['ours']:.3f} s, {times['ratio']:.2f} of FAISS's",
               "1.5 of FAISS's", verdict(times["ratio"] <= 1.5), f"FAISS flat: {times['FAISS']:.3f} s")


def density_rows(found: dict[str, Any]) -> Iterable[Row]:
    took, faster = found["seconds a frame"], found["times faster"]
    yield (found["what"], f"{took:.2f} s a frame", "1.5 s", verdict(took <= 1.5), "not said")
    yield ("    times faster than map_coordinates", f"{faster:.1f}", "6", verdict(faster >= 6),
           f"SciPy: {found['scipy, seconds a frame']:.2f} s")
    took, busy = found["plume"]["seconds a frame"], found["plume"]["processor seconds a frame"]
    yield (found["plume"]["what"], f"{took:.2f} s a frame ({busy:.2f} s of processor)", "0.5 s", verdict(took <= 0.5),
           "not said")


def repeat_rows(found: dict[str, Any]) -> Iterable[Row]:
    different = found["different results"]
    yield ("same bits: 10 runs, 1 and 2 threads, cold and warm cache", f"{different} in {found['runs']} runs", "1",
           verdict(different == 1), "not said")


def potential_rows(found: dict[str, Any]) -> Iterable[Row]:
    rows = found["motion and potential"]
    largest = {way: max(row["divergence"] for row in rows if row["synthesized"] == way)
               for way in ("motion", "potential")}
    yield ("2-D potential synthesis, divergence over the rms gradient", f"{largest['potential']:.1e}", "1e-4",
           verdict(largest["potential"] <= 1e-4), f"the motion synthesized: {largest['motion']:.2g}")


def lagrangian_rows(found: dict[str, Any]) -> Iterable[Row]:
    mean = {way: sum(row["change in 4 frames"] for row in found["flicker"] if row["samples"] == way) / 3
            for way in ("grid", "lagrangian")}
    yield ("Lagrangian samples, change in 4 frames of a constant flow", f"{mean['lagrangian']:.1%} of the rms",
           f"{mean['grid']:.1%}", verdict(mean["lagrangian"] <= mean["grid"]), "the reach: on the grid")


def solid_rows(found: dict[str, Any]) -> Iterable[Row]:
    for frame, times in found["256²×64"].items():
        yield (f"ma09 3-D 64² on three views to 256²×64, k-coherence, {frame} frame", seconds(times), "60 s",
               verdict(times["wall"] <= 60), "1 h on a CPU, 4 to 8 min on a GeForce 8800 GTX")
    peak, exponent = found["peak memory MB"], found["growth"]["exponent"]
    yield ("    peak memory", f"{peak} MB", "4000 MB", verdict(peak <= 4000), "not said")
    yield ("    time from 64³ to 256³, exponent in the voxels", f"{exponent:.2f}", "1.05", verdict(exponent <= 1.05),
           "not said")


def boundary_rows(found: dict[str, Any]) -> Iterable[Row]:
    rows = found["texture at the boundary"]

    def mean(observed: str, key: str) -> float:
        chosen = [row[key] for row in rows if row["boundary"] == observed]
        return sum(chosen) / len(chosen)

    worst = max(row["wall, rms"] for row in rows if row["boundary"] == "observed")
    yield ("ma09 figure 7, normal component of H at the wall", f"{worst:.2%} of the rms", "2 %", verdict(worst <= 0.02),
           f"not observed: {mean('not', 'wall, rms'):.0%}")
    energy, without = (f"{mean(w, 'forward'):.3f} / {mean(w, 'backward'):.3f}" for w in ("observed", "not"))
    yield ("    texture, forward / backward distance", energy, "-", "", f"not observed: {without}")
    left = max(row["divergence"] for row in found["projection past a ball"])
    yield ("projection past a ball, divergence over the rms gradient", f"{left:.1e}", "1e-4", verdict(left <= 1e-4),
           "not said")


def smoke_rows(found: dict[str, Any]) -> Iterable[Row]:
    march, draft = found["march"], found["draft"]
    yield (f"{found['what']}, march", seconds(march), "1.5 s", verdict(march["wall"] <= 1.5),
           f"{found['error of the march']:.1%} from many paths")
    yield (f"    draft, {found['draft, paths per pixel']} paths per pixel", seconds(draft), "15 s",
           verdict(draft["wall"] <= 15), f"{found['error of the draft']:.1%}; not denoised "
                                         f"{found['error of the draft, not denoised']:.1%}")
    if "beside Cycles" in found:
        ratio = found["beside Cycles"]["times as efficient as volpath"]
        yield ("    volpath's time over Cycles' at equal noise", f"{ratio:.2f}", "-", "", "Blender's Cycles")


def elements_rows(found: dict[str, Any]) -> Iterable[Row]:
    for (name, times), (reach, memory) in zip(found["cases"].items(), ((60, 2000), (300, None), (300, None)),
                                              strict=True):
        yield (f"ma13 {name}, to convergence", f"{seconds(times)}, {times['iterations']} iterations", f"{reach} s",
               verdict(times["wall"] <= reach), "not said")
        peak = times["peak memory MB"]
        yield ("    peak memory", f"{peak} MB", f"{memory} MB" if memory else "-",
               verdict(peak <= memory) if memory else "", "not said")
    exponent = found["growth"]["exponent"]
    yield ("    time from 500 to 8,000 elements, exponent", f"{exponent:.2f}", "1.1", verdict(exponent <= 1.1),
           "not said")
    faster = found["times faster than the reference"]
    yield ("    search, times faster than NumPy and SciPy", f"{faster['wall']:.0f} ({faster['processor']:.0f} by "
           "processor)", "20", verdict(faster["wall"] >= 20), "not said")
    basic, smooth, ours = found["jitter"].values()
    yield ("    jitter, smooth over basic (§4.2 over §4.1)", f"{smooth / basic:.2f}; with motion that counts "
           f"{ours / basic:.4f}", "0.5", verdict(ours <= 0.5 * basic), "not said")
    worst = max(max(row[key] for key in ("pair correlation", "motion spectrum", "nearest distance"))
                for row in found["exemplars in their own domains"])
    yield ("    an exemplar in its own domain, worst of three statistics", f"{worst:.1%} off", "10 %",
           verdict(worst <= 0.1), "not said")


ROWS: dict[str, Callable[[dict[str, Any]], Iterable[Row]]] = {
    "synthesis": synthesis_rows, "search": search_rows, "density": density_rows, "repeat": repeat_rows,
    "solid": solid_rows, "potential": potential_rows, "lagrangian": lagrangian_rows, "boundary": boundary_rows,
    "smoke": smoke_rows, "elements": elements_rows}
# lists of equal rows each: printed as tables of their own
TABLES = ("quality", "solid", "potential", "lagrangian", "boundary", "elements", "fidelity")
PARTS = tuple(dict.fromkeys((*ROWS, *TABLES)))


def table(header: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """Columns as wide as their widest entry; numbers to the right."""
    lines = [list(header), *(["" if cell is None else cell for cell in line] for line in rows)]
    widths = [max(len(str(line[i])) for line in lines) for i in range(len(header))]
    return "\n".join("  ".join(str(cell).ljust(width) if isinstance(cell, str) else str(cell).rjust(width)
                               for cell, width in zip(line, widths, strict=True)).rstrip() for line in lines)


def main() -> None:
    options = argparse.ArgumentParser(prog="python -m bench", description=__doc__)
    options.add_argument("parts", nargs="*", metavar="part", help=f"{', '.join(PARTS)}; all without")
    chosen = options.parse_args().parts or PARTS
    if unknown := set(chosen) - {*PARTS}:
        options.error(f"no part is called {', '.join(sorted(unknown))}")
    found: dict[str, Any] = {"machine": machine()}
    print("\n".join(f"{key}: {value}" for key, value in found["machine"].items()), flush=True)
    rows: list[Row] = []
    for part in chosen:
        print(f"... {part}", file=sys.stderr, flush=True)
        found[part] = measured(part)
        rows += ROWS[part](found[part]) if part in ROWS else []
    if rows:
        print(f"\n{table(HEADER, rows)}")
    for part in (part for part in TABLES if part in found):
        for name, lines in ((name, lines) for name, lines in found[part].items() if isinstance(lines, list)):
            print(f"\n{name}\n{table(list(lines[0]), (list(line.values()) for line in lines))}")
    written = Path("out/bench.json")
    written.parent.mkdir(exist_ok=True)
    written.write_text(json.dumps(found, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    print(f"\nwritten: {written}")


if __name__ == "__main__":
    main()
