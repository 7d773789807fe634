"""Whether a scene still gives what its reference keeps (`flowloom diff`).

First the fields and volumes by content: the sums of every frame, all values of the frame that the figure
shows. Then a small proof of that frame at the scene's seed. Content comes first because pictures forgive: one
per cent more smoke is far below what a threshold on the mean FLIP notices.

A difference that is intended becomes the new reference by `flowloom references`; look at the report before.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pipeline import diff_report, references
from pipeline.build.graph import BuildGraph
from pipeline.diff_report import Finding
from pipeline.files import images

SUM_TOLERANCE = 1e-6  # of a frame's sums, relative to the sum of its absolute values
VALUE_TOLERANCE = 1e-5  # of any value, relative to the frame's largest
HALF_TOLERANCE = 2.0**-10  # of a picture's value, likewise: another processor may round to the half float beside it
PIXEL_TOLERANCE = 1e-3  # of a pixel, relative to its reference
PIXEL_FLOOR = 1e-2  # a pixel darker than this share of the picture's mean counts as that bright
PIXEL_SHARE = 1e-3  # of the pixels may differ by more: another SIMD width changes up to 2 of 9,216


def compared_sums(name: str, new: dict[str, Any], old: dict[str, Any]) -> Finding:
    """Whether two frames, given by `references.sums`, have the same shape and the same sums."""
    if new["shape"] != old["shape"]:
        return Finding(name, f"its shape is {new['shape']}, was {old['shape']}")
    scale = max(old["absolute"], float(np.finfo(np.float64).tiny))
    worst = max(abs(new[key] - old[key]) for key in ("sum", "absolute")) / scale
    measured = f"sums {worst:.2g} apart"
    fault = "" if worst <= SUM_TOLERANCE else f"{measured}, tolerance {SUM_TOLERANCE:g}"
    return Finding(name, fault, measured)


def compared_values(name: str, new: np.ndarray, old: np.ndarray, is_light: bool = False) -> Finding:
    """Whether two fields, volumes or, if they are light, pictures have the same shape, sums and values."""
    overall = compared_sums(name, references.sums(new), references.sums(old))
    if new.shape != old.shape:
        return replace(overall, old=old, new=new, is_light=is_light)
    scale = max(float(np.abs(old).max()), float(np.finfo(np.float32).tiny))
    worst = float(np.abs(new.astype(np.float64) - old).max()) / scale
    measured = f"largest difference {worst:.2g} of the largest value"
    tolerance = HALF_TOLERANCE if is_light else VALUE_TOLERANCE
    fault = "" if worst <= tolerance else f"{measured}, tolerance {tolerance:.2g}"
    both = [part for part in (overall.fault, fault) if part]
    return Finding(name, "; ".join(both), f"{overall.measured}; {measured}", old, new, is_light)


def compared_light(name: str, new: np.ndarray, old: np.ndarray) -> Finding:
    """Whether two pictures (h, w, 3) of linear light have the same pixels, all but PIXEL_SHARE of them."""
    if new.shape != old.shape:
        fault = f"its shape is {list(new.shape)}, was {list(old.shape)}"
        return Finding(name, fault, "", old, new, is_light=True)
    floor = max(PIXEL_FLOOR * float(old.mean()), float(np.finfo(np.float32).tiny))
    relative = np.abs(new.astype(np.float64) - old) / np.maximum(np.abs(old), floor)
    differs = ~(relative <= PIXEL_TOLERANCE).all(axis=-1)  # not >: a pixel that is no number differs
    share = float(differs.mean())
    measured = f"{share:.2%} of the pixels differ by more than {PIXEL_TOLERANCE:g}"
    fault = "" if share <= PIXEL_SHARE else f"{measured}, tolerance {PIXEL_SHARE:.1%}"
    return Finding(name, fault, measured, old, new, is_light=True)


def check(graph: BuildGraph, record: dict[str, Any]) -> list[str]:
    """Compare a scene, whose graph is baked at its [quick] settings, with the `record` of its reference; one line per
    artifact that differs, none if none does. Writes the report out/quick/X/diff/index.html with its picture.
    """
    found = list(findings(graph, references.folder_of(graph.file_of_scene), record))
    page = diff_report.write(graph.name, found, graph.root / "diff")
    lines = [f"{graph.name}: {line}" for line in _first_of_each([f for f in found if f.fault])]
    if lines:
        lines.append(f"{graph.name}: look at {page}; if the change is intended, type: "
                     f"flowloom references {graph.file_of_scene}")
    return lines


def _first_of_each(faults: list[Finding]) -> Iterator[str]:
    """One line for each artifact: its first frame that differs, and how many more do."""
    artifacts: dict[str, list[Finding]] = {}
    for fault in faults:
        artifacts.setdefault(re.sub(r"\.\d{4,}\.", ".", fault.name), []).append(fault)
    for first, *more in artifacts.values():
        yield f"{first.name}: {first.fault}" + (f"; so do {len(more)} more frames" if more else "")


def findings(graph: BuildGraph, folder: Path, record: dict[str, Any]) -> Iterator[Finding]:
    """All comparisons with the reference in `folder`: content first, then the proofs."""
    left = {**record["sums"], **record["proofs"]}
    for made in references.contents(graph):
        old = left.pop(made.path, None)
        if old is None:
            yield Finding(made.path, "is new; the reference does not have it")
        elif made.path in record["files"]:
            yield compared_values(made.path, made.values(made.file), made.values(folder / made.path), made.is_light)
        else:
            yield compared_sums(made.path, references.sums(made.values(made.file)), old)
    for proof in references.proofs(graph):
        old = left.pop(proof.path, None)
        if old is None:
            yield Finding(proof.path, "is new; the reference does not have it")
            continue
        finding = compared_light(proof.path, proof.light, images.read_picture(folder / proof.path))
        since = _changes(proof.made_with, old)
        if finding.fault and since:
            finding = replace(finding, fault=f"{finding.fault} (since then {since})")
        yield finding
    for path in left:
        yield Finding(path, "is no longer made; the reference has it")


def _changes(new: dict[str, str], old: dict[str, str]) -> str:
    """Which versions are not those of the reference, "" if none."""
    names = [name for name in {**old, **new} if new.get(name) != old.get(name)]
    return ", ".join(f"{name} {old.get(name, 'none')} became {new.get(name, 'none')}" for name in names)
