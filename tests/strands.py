"""A small sample, small patches, and flows and a mask for them: what tests of moving textures begin with."""

import numpy as np

from synth.texture.carry import Settings
from synth.texture.procedural import DIRECTION, canes
from synth.texture.sample import sample

SHAPE = (93, 110)
SMALL = Settings(radius=(6, 9), growth=4)


def strands(size=48, colour=canes):
    return sample(colour(size, seed=1), direction=DIRECTION)


def uniform(x, y, shape=SHAPE):
    return np.broadcast_to(np.float32([x, y]), (*shape, 2)).copy()


def vortex(shape=SHAPE, speed=1.2):
    """Round the middle, all at one speed, with a drift towards it so that patches pile up."""
    y, x = np.mgrid[:shape[0], :shape[1]]
    dx, dy = x - shape[1] / 2 + 0.3, y - shape[0] / 2 + 0.2
    away = np.hypot(dx, dy) + 1e-6
    return (speed * np.stack([-dy - 0.1 * dx, dx - 0.1 * dy], axis=-1) / away[..., None]).astype(np.float32)


def wall(shape=SHAPE):
    """Two rooms and a wall of three pixels that goes through from border to border."""
    open_ = np.ones(shape, bool)
    open_[:, 50:53] = False
    return open_
