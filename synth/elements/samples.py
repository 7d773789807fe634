"""Elements and their samples (ma13 §3.1): positions over time, topology, appearance."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

TOPOLOGIES = ("none", "thread", "sheet")
"""How the samples of an element are connected (§3.2): a single one, a line, a grid."""


@dataclass(frozen=True)
class Elements:
    """E elements of S samples each, over T frames.

    positions  (T, E, S, D) float32, D = 2 or 3: p(s), world units
    grid       of the S samples of an element: () one sample, (S,) along a thread, (rows, columns) of a sheet,
               row by row
    rate       frames per second
    size       (E,) float32: radius of a particle or thread, length of a fish, thickness of a sheet, world units
    kind       (E,) int32: the shape or appearance of an element
    colour     (E, 3) float32, sRGB in 0..1
    coarse     (T, E, S, D) float32 or None: C, where each sample would be without details (§5)
    box        (2, D) float32 or None: lower and upper corner of the unit that the elements fill, if it repeats
               toroidally; an element may leave it, its copies enter on the other side
    Raises ValueError for shapes that do not fit, or values that are not finite.
    """

    positions: np.ndarray
    grid: tuple[int, ...] = ()
    rate: float = 24.0
    size: np.ndarray = field(default=None)  # type: ignore[arg-type]
    kind: np.ndarray = field(default=None)  # type: ignore[arg-type]
    colour: np.ndarray = field(default=None)  # type: ignore[arg-type]
    coarse: np.ndarray | None = None
    box: np.ndarray | None = None

    def __post_init__(self) -> None:
        if self.positions.ndim != 4 or self.positions.shape[3] not in (2, 3) or 0 in self.positions.shape:
            raise ValueError(f"positions are (frames, elements, samples, 2 or 3), not {self.positions.shape}")
        count, samples = self.positions.shape[1:3]
        if len(self.grid) > 2 or int(np.prod(self.grid)) != samples:
            raise ValueError(f"a grid {self.grid} does not hold {samples} samples")
        given = {"size": np.ones(count), "kind": np.zeros(count), "colour": np.full((count, 3), 0.8)}
        types = {"positions": np.float32, "size": np.float32, "kind": np.int32, "colour": np.float32,
                 "coarse": np.float32}
        for name, dtype in types.items():
            value = getattr(self, name)
            value = given.get(name) if value is None else value
            if value is None:
                continue
            value = np.ascontiguousarray(value, dtype)
            expected = self.positions.shape if name in ("positions", "coarse") else np.shape(given[name])
            if value.shape != expected:
                raise ValueError(f"{name} of {count} elements is {expected}, not {value.shape}")
            bad = np.argwhere(~np.isfinite(value))
            if len(bad):
                where = (f"frame {bad[0][0] + 1}, element {bad[0][1] + 1}" if value.ndim == 4
                         else f"element {bad[0][0] + 1}")
                raise ValueError(f"{name}: {where} is not finite")
            object.__setattr__(self, name, value)
        if self.box is not None:
            box = np.ascontiguousarray(self.box, np.float32)
            if box.shape != (2, self.dimensions) or not (np.isfinite(box).all() and (box[0] < box[1]).all()):
                raise ValueError(f"the box is a lower and an upper corner of {self.dimensions} numbers, not {box}")
            object.__setattr__(self, "box", box)

    @property
    def topology(self) -> str:
        """One of TOPOLOGIES."""
        return TOPOLOGIES[len(self.grid)]

    @property
    def frames(self) -> int:
        return int(self.positions.shape[0])

    @property
    def count(self) -> int:
        """How many elements."""
        return int(self.positions.shape[1])

    @property
    def dimensions(self) -> int:
        return int(self.positions.shape[3])

    @property
    def period(self) -> np.ndarray | None:
        """(D,) float32: the box's extents, world units; None where the elements do not repeat."""
        return None if self.box is None else self.box[1] - self.box[0]
