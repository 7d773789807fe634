"""Figures as papers print them: panels in rows on white, thin borders, a label below each, insets, a legend.

Text is set in Droid Serif (Apache 2.0), which the OpenImageIO package contains; Greek letters, which it
lacks, in Droid Sans Mono. Labels may hold `*asterisks*` for italics, as a paper sets its symbols.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy import sparse

from render import tonemap

BORDER = 0.45  # display grey of a panel's border
INK = 0.10  # display grey of text
LEGIBLE = 12  # smallest size of text, pixels
LATIN = "àâäçéèêëïîôöùûüÀÄÇÉÈÖÜß×÷±²³°·–—‘’“”…"  # what labels need of Droid Serif beyond ASCII


@dataclass(frozen=True)
class Panel:
    """One picture of a figure.

    picture  (h, w, 3) uint8 sRGB or float display values, top row first
    label    set below it; "" for none
    inset    a smaller picture for the lower left corner
    legend   a disc (s, s, 4) for the lower right corner (`lic.wheel`)
    border   whether it has a thin border
    """

    picture: np.ndarray
    label: str = ""
    inset: np.ndarray | None = None
    legend: np.ndarray | None = None
    border: bool = True


def display(picture: np.ndarray) -> np.ndarray:
    """A panel's picture (h, w, 3) as a new array of float32 display values in [0, 1]."""
    if picture.ndim != 3 or picture.shape[2] != 3:
        raise ValueError(f"expected a picture (h, w, 3), got {picture.shape}")
    return picture.astype(np.float32) / (255.0 if picture.dtype == np.uint8 else 1.0)


def fitted(picture: np.ndarray, width: int) -> np.ndarray:
    """`picture` (h, w, 3) resampled to `width` pixels: enlarged by repeating pixels, reduced by averaging areas.

    Averages are of linear light, so thin bright lines keep their brightness.
    """
    shown = display(picture)
    h, w = shown.shape[:2]
    if w == width:
        return shown
    height = max(1, round(h * width / w))
    if width > w:
        rows, columns = np.arange(height) * h // height, np.arange(width) * w // width
        return np.ascontiguousarray(shown[rows][:, columns])
    narrower = _averaged_rows(_averaged_rows(tonemap.from_srgb(shown), height).swapaxes(0, 1), width).swapaxes(0, 1)
    return tonemap.to_srgb(narrower).astype(np.float32)


def _averaged_rows(values: np.ndarray, count: int) -> np.ndarray:
    """`values` (n, ...) as `count` rows, each the exact mean of the rows and fractions of rows it covers."""
    n = len(values)
    edges = np.arange(count + 1) * (n / count)
    covered = edges[:-1].astype(int)[:, None] + np.arange(int(np.ceil(n / count)) + 1)
    share = np.minimum(edges[1:, None], covered + 1) - np.maximum(edges[:-1, None], covered)
    row = np.broadcast_to(np.arange(count)[:, None], covered.shape)
    inside = (share > 0) & (covered < n)
    weights = sparse.csr_matrix(((share[inside] * (count / n)).astype(np.float32), (row[inside], covered[inside])),
                                (count, n))
    averages = weights @ values.reshape(n, -1)
    return np.asarray(averages.reshape(count, *values.shape[1:]))


@functools.cache
def _font(name: str) -> str:
    import OpenImageIO

    path = Path(OpenImageIO.__file__).parent / "share" / "fonts" / "OpenImageIO" / f"{name}.ttf"
    if not path.is_file():
        raise ValueError(f"font file is missing: {path}; run make setup")
    return str(path)


def _line_height(size: int) -> int:
    return round(1.4 * size)


@functools.lru_cache(maxsize=256)  # the same in every frame
def lettering(text: str, size: int) -> np.ndarray:
    """One line of text as coverage (h, w) float32 in [0, 1], `size` pixels per em, as wide as the text.

    All lines of one size have the same height and the same baseline.
    """
    drawn = [np.zeros((_line_height(size), 0), np.float32)]
    for number, piece in enumerate(text.replace("′", "'").split("*")):  # a slanted ' is a prime
        italic = number % 2 == 1
        for latin, run in itertools.groupby(piece, lambda c: c.isascii() or c in LATIN):
            words = "".join(run)
            if latin:
                drawn.append(_drawn(words, size, "DroidSerif-Italic" if italic else "DroidSerif"))
            else:
                drawn.append(_leaning(_drawn(words, size, "DroidSansMono"), size))
    return np.concatenate(drawn, axis=1)


def _drawn(text: str, size: int, font: str) -> np.ndarray:
    """Coverage (line height, advance) of `text` in one font."""
    import OpenImageIO as oiio

    def advance(words: str) -> int:
        return int(oiio.ImageBufAlgo.text_size(words, size, _font(font)).xend)

    # OpenImageIO's box ends with the last ink: a bar after the text gives the advance, spaces included
    wide = max(1, advance(text + "|") - advance("|"))
    page = oiio.ImageBuf(oiio.ImageSpec(wide + size, _line_height(size), 1, "float"))
    oiio.ImageBufAlgo.zero(page)
    if not oiio.ImageBufAlgo.render_text(page, 0, round(1.05 * size), text, size, _font(font), (1.0,)):
        raise ValueError(f"cannot draw the text {text!r}: {page.geterror()}")
    return np.asarray(page.get_pixels(oiio.FLOAT))[:, :wide, 0]


def _leaning(upright: np.ndarray, size: int) -> np.ndarray:
    """Greek letters slanted about the baseline, as symbols are: the sans font has no italics."""
    columns = np.arange(upright.shape[1])
    shifts = 0.2 * (np.arange(len(upright)) - round(0.8 * size))
    return np.stack([np.interp(columns + s, columns, line, left=0.0, right=0.0)
                     for s, line in zip(shifts, upright, strict=True)]).astype(np.float32)


def figure(rows: Sequence[Sequence[Panel]], *, letter: int | None = None, gap: int = 20,
           margin: int = 28) -> np.ndarray:
    """Panels in rows as one picture (h, w, 3) uint8 sRGB on white.

    letter       size of the labels, pixels; None: a twentieth of the widest panel, or less where a label would
                 be wider than its panel
    gap, margin  between panels and around the figure, pixels
    Panels keep their pixels. Those of a row are aligned at the bottom; rows with the same number of panels
    share their columns.
    """
    if not rows or not all(rows):
        raise ValueError("a figure needs at least one panel in each row")
    panels = [panel for row in rows for panel in row]
    widest = max(panel.picture.shape[1] for panel in panels)
    size = letter or _fitting([(panel.label, panel.picture.shape[1]) for panel in panels], round(widest / 20))
    strips = []
    for row in rows:
        alike = [other for other in rows if len(other) == len(row)]
        columns = [max(panel.picture.shape[1] for panel in column) for column in zip(*alike, strict=True)]
        strips.append(_row([_finished(panel) for panel in row], [panel.label for panel in row], columns, size, gap))
    width = max(strip.shape[1] for strip in strips)
    padded = [_centred(strip, width) for strip in strips]
    spaced = [padded[0]]
    for strip in padded[1:]:
        spaced += [np.ones((gap, width, 3), np.float32), strip]
    page = np.pad(np.concatenate(spaced), ((margin, margin), (margin, margin), (0, 0)), constant_values=1.0)
    return np.rint(page * 255.0).astype(np.uint8)


def _fitting(labels: list[tuple[str, int]], size: int) -> int:
    """The largest size up to `size`, but not below LEGIBLE, at which no label is wider than its panel."""
    while size > LEGIBLE and any(lettering(label, size).shape[1] > width for label, width in labels):
        size -= 1
    return max(size, LEGIBLE)


def _centred(strip: np.ndarray, width: int) -> np.ndarray:
    left = (width - strip.shape[1]) // 2
    right = width - strip.shape[1] - left
    return np.pad(strip, ((0, 0), (left, right), (0, 0)), constant_values=1.0)


def _finished(panel: Panel) -> np.ndarray:
    """A panel's picture with its inset, legend and border."""
    picture = display(_eight_bit(panel.picture))
    h, w = picture.shape[:2]
    margin = max(4, round(0.025 * min(h, w)))
    if panel.inset is not None:
        inset = _bordered(np.pad(display(panel.inset), ((3, 3), (3, 3), (0, 0)), constant_values=1.0))
        ih, iw = inset.shape[:2]
        if ih + 2 * margin > h or iw + 2 * margin > w:
            raise ValueError(f"an inset of {iw} x {ih} does not fit into a panel of {w} x {h}")
        picture[h - margin - ih:h - margin, margin:margin + iw] = inset
    if panel.legend is not None:
        s = len(panel.legend)
        corner = picture[h - margin - s:h - margin, w - margin - s:w - margin]
        cover = panel.legend[..., 3:]
        corner[:] = corner * (1.0 - cover) + panel.legend[..., :3] * cover
    return _bordered(picture) if panel.border else picture


def _eight_bit(picture: np.ndarray) -> np.ndarray:
    """uint8 as it is; floats dithered, here and not at the end, so that uint8 pictures keep their values."""
    return picture if picture.dtype == np.uint8 else tonemap.eight_bit(picture)


def _bordered(picture: np.ndarray) -> np.ndarray:
    picture[[0, -1]] = BORDER
    picture[:, [0, -1]] = BORDER
    return picture


def _row(pictures: list[np.ndarray], labels: list[str], widths: list[int], letter: int,
         gap: int) -> np.ndarray:
    """One row of finished panels above their labels, each centred in its column, (h, w, 3) display values."""
    height = max(len(picture) for picture in pictures)
    below = _line_height(letter) + round(0.45 * letter) if any(labels) else 0
    columns = []
    for picture, label, width in zip(pictures, labels, widths, strict=False):
        text = lettering(label, letter)
        wide = max(width, text.shape[1])
        column = np.ones((height + below, wide, 3), np.float32)
        left = (wide - picture.shape[1]) // 2
        column[height - len(picture):height, left:left + picture.shape[1]] = picture
        if label:
            left = (wide - text.shape[1]) // 2
            top = height + below - len(text)
            column[top:, left:left + text.shape[1]] -= (1.0 - INK) * np.minimum(text, 1.0)[..., None]
        columns += [column, np.ones((height + below, gap, 3), np.float32)]
    return np.concatenate(columns[:-1], axis=1)
