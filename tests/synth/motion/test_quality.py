"""The measures of quality: full marks for the exemplar itself, and each kind of failure is seen by its number."""

import numpy as np
import pytest

from synth.motion.exemplar import exemplar
from synth.motion.local_axes import axes_2d
from synth.motion.neighborhood import exemplar_patches
from synth.motion.quality import RADIUS, measure, measure_view, motif, oriented, whole_motifs
from synth.motion.views import View

CLOSED = ["circle", "square", "heart"]


def along(angle, shape):
    return np.broadcast_to(np.float32([np.cos(angle), np.sin(angle)]), (*shape, 2)).copy()


def tiled(kind="heart", size=16, times=3):
    I = exemplar(kind, size)
    H = np.tile(I, (times, times, 1))
    return H, along(0, H.shape[:2]), I


def turned(field):
    """A field whose content is turned by 90 degrees counter-clockwise; values stay in local coordinates."""
    return np.ascontiguousarray(np.rot90(field, -1))  # rows go up, so a positive turn is rot90's negative


def measured_by_loops(H, exemplar_):
    """forward, backward and used of `measure` for a frame along x, as FACTS words them."""
    inset = int(np.ceil(RADIUS * np.sqrt(2)))
    ours = exemplar_patches(exemplar_, RADIUS).astype(np.float64)
    theirs = np.stack([H[y - RADIUS:y + RADIUS + 1, x - RADIUS:x + RADIUS + 1].ravel()
                       for y in range(inset, H.shape[0] - inset) for x in range(inset, H.shape[1] - inset)])
    distance = np.sqrt(((theirs[:, None] - ours) ** 2).mean(-1)) / np.sqrt((exemplar_**2).mean())
    visible = np.sqrt((ours**2).mean(1)) > 0.05 * np.sqrt((exemplar_**2).mean())
    used = np.isin(np.arange(len(ours)), distance.argmin(1))
    return distance.min(1).mean(), distance.min(0).mean(), used[visible].mean()


@pytest.mark.parametrize("kind", ["circle", "square", "heart", "stripes", "sinusoid"])
def test_the_exemplar_itself_has_full_marks(kind):
    H, frame, I = tiled(kind)
    quality = measure(H, frame, I)
    assert quality.forward < 2e-3 and quality.backward < 2e-3  # float32 cancellation in |q - e|²
    assert quality.used == 1
    assert quality.rms == pytest.approx(1, abs=1e-6)
    assert quality.gradient == pytest.approx(1, abs=0.03)  # the last row and column have no neighbour


def test_the_numbers_are_those_of_plain_loops():
    rng = np.random.default_rng(0)
    I = rng.normal(size=(6, 7, 2)).astype(np.float32)
    H = rng.normal(size=(18, 17, 2)).astype(np.float32)
    quality = measure(H, along(0, (18, 17)), I)
    forward, backward, used = measured_by_loops(H, I)
    assert quality.forward == pytest.approx(forward, rel=1e-4)
    assert quality.backward == pytest.approx(backward, rel=1e-4)
    assert quality.used == pytest.approx(used)


def test_a_turned_copy_in_a_turned_frame_is_as_good():
    H, _, I = tiled(times=4)
    assert measure(turned(H), along(np.pi / 2, H.shape[:2]), I).forward < 2e-3
    assert measure(turned(H), along(0, H.shape[:2]), I).forward > 0.1


def test_emptiness_is_seen():
    H, frame, I = tiled()
    quality = measure(np.zeros_like(H), frame, I)
    assert quality.rms == quality.gradient == 0
    assert quality.used < 0.1 and quality.backward > 0.5


def test_blur_is_seen():
    H, frame, I = tiled(times=4)
    blurred = sum(np.roll(H, s, (0, 1)) for s in ((0, 0), (2, 0), (0, 2), (2, 2), (-2, 0), (0, -2))) / 6
    quality, sharp = measure(blurred, frame, I), measure(H, frame, I)
    assert quality.gradient < 0.8 < sharp.gradient
    assert quality.forward > 0.1 > sharp.forward


def test_repeating_one_half_is_seen():
    H, frame, I = tiled(times=4)
    one = H.copy()
    one[:, :] = np.concatenate([H[:, :8]] * 8, axis=1)
    assert measure(one, frame, I).used < 0.9 * measure(H, frame, I).used


def test_neighbourhoods_alike_along_a_stripe_count_as_one():
    """Stripes shifted along themselves are the same stripes: all of them are used, wherever the ties fall."""
    H, frame, I = tiled("stripes")
    assert measure(np.roll(H, 5, axis=1), frame, I).used == 1


def test_a_field_too_small_for_a_neighbourhood_is_refused():
    with pytest.raises(ValueError, match="12 x 40 cells holds no neighbourhood"):
        measure(np.zeros((40, 12, 2), np.float32), along(0, (40, 12)), exemplar("heart", 16))


@pytest.mark.parametrize("kind", CLOSED)
def test_the_motif_is_the_exemplar_without_its_empty_rim(kind):
    I = exemplar(kind, 32)
    template = motif(I)
    assert template.shape[0] <= 32 and template.shape[1] <= 32
    assert (template**2).sum() > 0.99 * (I**2).sum()
    np.testing.assert_array_equal(motif(np.pad(I, ((5, 2), (0, 9), (0, 0)))), template)


def test_stripes_are_no_closed_motif():
    with pytest.raises(ValueError, match="not closed"):
        motif(exemplar("stripes", 32))


@pytest.mark.parametrize("kind", CLOSED)
def test_every_motif_of_a_tiling_is_whole(kind):
    H, frame, I = tiled(kind, 32, 3)
    whole, total = whole_motifs(H, frame, I)
    assert whole == total == 9
    cut = H[16:-16, 16:-16]  # only the one in the middle is not cut
    assert whole_motifs(np.ascontiguousarray(cut), frame[16:-16, 16:-16], I) == (1, 1)


@pytest.mark.parametrize("angle", [0.4, 1.3, -2.0])
@pytest.mark.parametrize("kind", CLOSED)
def test_turned_motifs_are_whole_in_their_own_frame_only(kind, angle):
    I = exemplar(kind, 32)
    H = np.zeros((64, 64, 2), np.float32)
    y, x = np.mgrid[:64, :64] - 31.5
    at = np.stack([(np.cos(angle) * x + np.sin(angle) * y), np.cos(angle) * y - np.sin(angle) * x], -1)
    centre = np.array([[15.5, 15.5]])
    inside = (np.abs(at) < 15).all(-1)
    whole = oriented(I, at[inside] + centre, np.broadcast_to([1.0, 0.0], (int(inside.sum()), 2)), (1, 1))
    H[inside] = whole[:, 0, 0]
    assert whole_motifs(H, along(angle, (64, 64)), I) == (1, 1)
    if kind == "heart" and abs(angle) > 1:  # the others look much alike in a wrong frame
        assert whole_motifs(H, along(0, (64, 64)), I) == (0, 1)


@pytest.mark.parametrize("kind", CLOSED)
def test_half_a_motif_is_broken(kind):
    I = exemplar(kind, 32)
    H = np.pad(I, ((16, 16), (16, 16), (0, 0)))
    H[:, 32:] = 0
    assert whole_motifs(H, along(0, H.shape[:2]), I) == (0, 1)


def test_two_grown_together_count_as_two():
    I = exemplar("heart", 32)
    template = motif(I)
    width = template.shape[1]
    H = np.zeros((64, 3 * width, 2), np.float32)
    for first in (width // 2, width // 2 + width - 1):
        place = H[16:16 + template.shape[0], first:first + width]
        place[...] = np.where(np.abs(template) > np.abs(place), template, place)
    whole, total = whole_motifs(H, along(0, H.shape[:2]), I)
    assert (whole, total) == (2, 2)


def test_dust_and_emptiness_are_no_motifs():
    I = exemplar("circle", 32)
    H = np.zeros((64, 64, 2), np.float32)
    assert whole_motifs(H, along(0, (64, 64)), I) == (0, 0)
    H[20:22, 20:22] = 1
    assert whole_motifs(H, along(0, (64, 64)), I) == (0, 0)


def test_oriented_windows_read_along_the_frame():
    y, x = np.mgrid[:9, :11].astype(np.float32)
    H = np.stack([x, y], -1)
    at = np.array([[5.0, 4.0]])
    window = oriented(H, at, np.array([[0.0, 1.0]]), (3, 5))[0]
    # one step along the window's x axis is one up in the field; one along its y axis is one to the left
    np.testing.assert_allclose(window[:, :, 1], np.broadcast_to(4 + np.arange(-2, 3), (3, 5)))
    np.testing.assert_allclose(window[:, :, 0], np.broadcast_to(5 - np.arange(-1, 2)[:, None], (3, 5)))


def test_local_axes_of_a_flow_are_what_measure_expects():
    H, _, I = tiled()
    L = along(0, H.shape[:2])
    assert measure(H, axes_2d(L), I).forward < 2e-3


def test_a_view_of_its_own_extrusion_is_perfect():
    I = exemplar("heart", 16)
    view = View(I, (0, 0, 1), (0, 1, 0))  # from the side: its right is z
    H = np.zeros((32, 48, 20, 3), np.float32)
    tiles = np.tile(I, (3, 2, 1))  # rows along y, columns along z
    H[..., 2], H[..., 1] = (tiles[:, :, None, c].swapaxes(0, 1) for c in (0, 1))
    frame = np.broadcast_to(np.eye(3, dtype=np.float32), (*H.shape[:3], 3, 3))
    found = measure_view(H, frame, view)
    assert found.forward < 1e-3 and found.rms == pytest.approx(1) and found.gradient == pytest.approx(1, rel=0.05)
    assert found.backward < 0.5 and found.used > 0.2  # only every second cell holds a neighbourhood
    blurred = measure_view(0.5 * H, frame, view)
    assert blurred.rms == pytest.approx(0.5) and blurred.gradient == pytest.approx(0.5 * found.gradient)
    assert blurred.forward > 0.1


def test_a_field_too_small_for_a_view_is_refused():
    frame = np.broadcast_to(np.eye(3, dtype=np.float32), (12, 20, 20, 3, 3))
    with pytest.raises(ValueError, match="holds no neighbourhood"):
        measure_view(np.zeros((12, 20, 20, 3), np.float32), frame, View(exemplar("heart", 16)))
