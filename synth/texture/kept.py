"""States of a synthesis as arrays by name, so that an interrupted run goes on from a file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any, Self

import numpy as np

NUMBERS: dict[str, type[int] | type[float]] = {"int": int, "float": float}
"""The types of fields that are no arrays."""


class Kept:
    """The base of a dataclass whose fields are arrays, whole numbers and floats."""

    def arrays(self) -> dict[str, np.ndarray]:
        """Every field under its name."""
        return {part.name: np.asarray(getattr(self, part.name)) for part in fields(self)}  # type: ignore[arg-type]

    @classmethod
    def of(cls, arrays: Mapping[str, np.ndarray]) -> Self:
        """What gave these arrays. Raises KeyError if one is missing."""
        parts: dict[str, Any] = {}
        for part in fields(cls):  # type: ignore[arg-type]
            number = NUMBERS.get(str(part.type))
            parts[part.name] = arrays[part.name] if number is None else number(arrays[part.name])
        return cls(**parts)
