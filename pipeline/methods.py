"""The methods there are: the one list. A new method is a folder beside `motion/` and its line here."""

from __future__ import annotations

from pipeline.build.method import Method
from pipeline.elements.method import METHOD as ELEMENTS
from pipeline.motion.method import METHOD as MOTION
from pipeline.photo.method import METHOD as PHOTO
from pipeline.texture.method import METHOD as TEXTURE

METHODS: tuple[Method, ...] = (MOTION, ELEMENTS, TEXTURE, PHOTO)
"""The first is that of a scene that has no method's table."""
