"""What a `flowloom diff` found, to look at: reference, now, difference and FLIP, as a page and a picture.

FLIP (Andersson et al. 2021) tells where an observer who flips between the two sees a change, from 0 to 1. It
is for the eye only: the verdict is by content and by pixels (`pipeline.diff`).
"""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.files import atomic, pictures
from render import layout, lic, tonemap

WIDTH = 320  # pixels of a panel
PAGE, PICTURE = "index.html", "diff.png"
STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; margin: 2rem auto; max-width: 90rem; color: #222 }
img { max-width: 100% } td, th { text-align: left; padding: .15rem 1rem .15rem 0; vertical-align: top }
.differs { color: #b00020; font-weight: 600 } .same { color: #1b6e3a }
"""


@dataclass(frozen=True)
class Finding:
    """The outcome of one comparison.

    fault: what differs, "" if nothing; measured: how far apart they are, either way; old, new: the arrays
    compared, where there is something to look at; is_light: whether they are linear light.
    """

    name: str
    fault: str
    measured: str = ""
    old: np.ndarray | None = None
    new: np.ndarray | None = None
    is_light: bool = False


def write(scene: str, findings: Sequence[Finding], folder: Path) -> Path:
    """Write the page and the picture of all findings into `folder`; returns the page.

    Faults come first. Each finding with something to look at is a row of panels: the reference, what the
    scene gives now, their difference (brightened by the factor in its label), FLIP.
    """
    ordered = sorted(findings, key=lambda f: not f.fault)
    rows = [_row(f, f.old, f.new) for f in ordered if f.old is not None and f.new is not None]
    if rows:
        pictures.write(folder / PICTURE, layout.figure(rows, letter=18))
    atomic.write_text(folder / PAGE, _page(scene, ordered, has_picture=bool(rows)))
    return folder / PAGE


def _row(finding: Finding, old: np.ndarray, new: np.ndarray) -> list[layout.Panel]:
    largest = max(float(np.abs(old).max()), 1e-12)
    shown_old, shown_new = (_shown(values, largest, finding.is_light) for values in (old, new))
    label = f"{finding.name}, reference"
    panels = [layout.Panel(_panel(shown_old), label), layout.Panel(_panel(shown_new), "now")]
    if old.shape == new.shape:
        difference, factor = _brightened(np.abs(new - old) / largest, finding.is_light)
        flip = pictures.flip(shown_old, shown_new)
        panels.append(layout.Panel(_panel(difference), f"difference × {factor:g}"))
        panels.append(layout.Panel(_panel(_heat(flip)), f"FLIP, mean {flip.mean():.4f}"))
    return panels


def _panel(display: np.ndarray) -> np.ndarray:
    return layout.fitted(np.ascontiguousarray(display, np.float32), WIDTH)


def _shown(values: np.ndarray, largest: float, is_light: bool) -> np.ndarray:
    """Light, a field or a density as display values (h, w, 3) in [0, 1], top row first.

    A density is grey, white at `largest`; a field is coloured by its direction, paler where it is shorter. Of
    a volume one sees the largest density along each line, and the middle slice of its vectors.
    """
    if is_light:
        return tonemap.to_display(values, "filmic")
    flat = lic.slice_of(values) if values.ndim == 4 else values
    if flat.ndim == 3 and flat.shape[2] == 2:
        return lic.colour(flat, flat.shape[1])
    grey = np.clip(_flattened(flat) / largest, 0.0, 1.0)
    return np.repeat(grey[::-1, :, None], 3, axis=2).astype(np.float32)


def _flattened(scalars: np.ndarray) -> np.ndarray:
    """(Y, X) as it is; of (Z, Y, X) the largest value along z."""
    return scalars.max(axis=0) if scalars.ndim == 3 else scalars


def _brightened(difference: np.ndarray, is_light: bool) -> tuple[np.ndarray, float]:
    """A difference as display values (h, w, 3), times the power of ten that makes it fill the range."""
    is_vector = is_light or difference.shape[-1] in (2, 3)
    flat = _flattened(difference.max(axis=-1) if is_vector else difference)
    worst = float(flat.max())
    factor = 10.0 ** np.floor(-np.log10(worst)) if worst > 1e-12 else 1.0
    grey = np.clip(flat * factor, 0.0, 1.0)
    return np.repeat((grey if is_light else grey[::-1])[..., None], 3, axis=2), factor


def _heat(flip: np.ndarray) -> np.ndarray:
    """FLIP (h, w) from 0 to 1 as black, violet, orange, yellow, white: display values (h, w, 3)."""
    stops = np.array([[0, 0, 0], [0.32, 0.07, 0.48], [0.93, 0.41, 0.15], [0.99, 0.85, 0.3], [1, 1, 1]])
    at = np.linspace(0, 1, len(stops))
    return np.stack([np.interp(flip, at, stops[:, c]) for c in range(3)], axis=-1)


def _page(scene: str, findings: Iterable[Finding], has_picture: bool) -> str:
    findings = list(findings)
    faults = sum(bool(f.fault) for f in findings)
    total = len(findings)
    verdict = f"{faults} of {total} comparisons differ" if faults else f"all {total} comparisons are the same"
    picture = f'<p><img src="{PICTURE}" alt="reference, now, difference and FLIP"></p>' if has_picture else ""
    lines = [
        f'<tr><td class="{"differs" if f.fault else "same"}">{"differs" if f.fault else "same"}</td>'
        f"<td>{html.escape(f.name)}</td><td>{html.escape(f.fault or f.measured)}</td></tr>"
        for f in findings
    ]
    return "\n".join([
        "<!doctype html>",
        f'<html lang="en"><head><meta charset="utf-8"><title>{html.escape(scene)}: diff</title>',
        f"<style>{STYLE}</style></head><body>",
        f'<h1>{html.escape(scene)}: <span class="{"differs" if faults else "same"}">{verdict}</span></h1>',
        picture,
        "<table><tr><th>verdict</th><th>what</th><th>measured</th></tr>",
        *lines,
        "</table></body></html>",
        "",
    ])
