"""Carried coordinates on a surface: what must stay as it is, what must cover it, and what must come out again."""

import hashlib
import io

import meshes
import numpy as np
import processes
import pytest

from synth.texture.atlas import atlas
from synth.texture.carry import Settings
from synth.texture.mesh import Mesh, length, mesh, refined
from synth.texture.procedural import DIRECTION, canes
from synth.texture.sample import sample
from synth.texture.shapes import tangent
from synth.texture.surface import PATCHES, State, Synthesis

SAMPLE = sample(canes(40, seed=1), direction=DIRECTION)
SMALL = Settings(radius=(6, 8), growth=4)
SHAPE = (120, 150)
SQUARE, TUBE, BALL = meshes.square(8, 12), meshes.cylinder(1, 2, 24, 8), meshes.sphere(3)
SCALES = {len(SQUARE.faces): 0.14, len(TUBE.faces): 0.05, len(BALL.faces): 0.05}


def synthesis(of: Mesh, settings: Settings = SMALL, seed: int = 4) -> Synthesis:
    return Synthesis(SAMPLE, of, settings, seed, SCALES[len(of.faces)])


def frames(of: Mesh, v: np.ndarray, count: int, state: State | None = None) -> list[State]:
    maker, states = synthesis(of), []
    for _ in range(count):
        state = maker.frame(v, state)
        states.append(state)
    return states


def picture(of: Mesh, v: np.ndarray, state: State) -> np.ndarray:
    return synthesis(of).picture(state, v, atlas(of, SHAPE).texels(), SHAPE)


def uniform(of: Mesh, x: float, y: float) -> np.ndarray:
    return np.broadcast_to([x, y, 0.0], of.vertices.shape)


def rest_on(of: Mesh) -> np.ndarray:
    return 0 * of.vertices


@pytest.mark.parametrize("of", [SQUARE, BALL], ids=["square", "sphere"])
def test_no_field_gives_identical_frames(of: Mesh) -> None:
    first, *_, last = frames(of, rest_on(of), 6)
    for name in PATCHES:
        if name != "age":
            np.testing.assert_array_equal(getattr(first, name), getattr(last, name), err_msg=name)
    np.testing.assert_array_equal(picture(of, rest_on(of), first), picture(of, rest_on(of), last))


@pytest.mark.parametrize(("of", "speed"), [(SQUARE, 0.1), (TUBE, 0.05), (BALL, 0.05)], ids=["square", "tube", "sphere"])
def test_every_texel_is_covered_in_every_frame(of: Mesh, speed: float) -> None:
    v = uniform(of, speed, speed / 3) if of is SQUARE else meshes.turning(of, speed) + np.array([0, speed / 2, 0])
    texels = atlas(of, SHAPE).texels()
    for state in frames(of, v, 12):
        shown = picture(of, v, state)
        assert (shown.reshape(-1, 3)[texels.number].sum(axis=1) > 0).all()
        beside = np.setdiff1d(np.arange(shown.shape[0] * shown.shape[1]), texels.number)
        assert not shown.reshape(-1, 3)[beside].any()
    assert len(state.id) > 10
    assert (state.born > len(state.id)) == (of is not BALL)  # over a border some came, some went


def test_sharp_edges_and_a_thin_plate_are_covered_too() -> None:
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    faces = np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6],
                      [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]])
    for thickness in (1.0, 0.03):
        plate = mesh(corners * [1, 1, thickness], faces)
        of, _ = refined(plate, np.zeros((8, 0)), 0.2)
        v = tangent(of, np.broadcast_to([0.02, 0.01, 0.005], of.vertices.shape))
        maker, state, made = Synthesis(SAMPLE, of, SMALL, 4, 0.02), None, atlas(of, (250, 250))
        for _ in range(6):
            state = maker.frame(v, state)
        shown = maker.picture(state, v, made.texels(), made.shape).reshape(-1, 3)[made.texels().number]
        assert (shown.sum(axis=1) > 0).all()
        # as many as in the plane, about one for 1.6 squares of the radius; more where the rim is narrower than they are
        assert len(state.id) < (1.0 if thickness == 1 else 3.0) * of.areas.sum() / 0.02**2 / 8**2


def test_on_a_plane_patches_move_as_the_field_does() -> None:
    v = uniform(SQUARE, 0.1, 0.03)
    before, after = frames(SQUARE, v, 2)
    both = np.intersect1d(before.id, after.id)
    assert len(both) > 10
    old, new = np.isin(before.id, both), np.isin(after.id, both)
    moved = SQUARE.at(SQUARE.vertices, after.face, after.place)[new] - SQUARE.at(
        SQUARE.vertices, before.face, before.place)[old]
    np.testing.assert_allclose(moved, np.broadcast_to([0.1, 0.03, 0], moved.shape), atol=1e-9)
    np.testing.assert_array_equal(after.anchor[new], before.anchor[old])


def test_the_texture_moves_with_the_patches() -> None:
    """A shift by a whole cell: a triangle shows what the one a cell to the left has shown, but near the border."""
    v = uniform(SQUARE, 0.25, 0.0)
    first, *_, last = frames(SQUARE, v, 5)
    leg = atlas(SQUARE, SHAPE)
    one, other = picture(SQUARE, v, first), picture(SQUARE, v, last)
    size = int(np.abs(leg.leg).min())
    differences = []
    for row in range(8):
        for column in range(2, 10):
            before, after = row * 12 + column, row * 12 + column + 1
            shown = []
            for face, of_frame in ((before, one), (after, other)):
                corner, turn = leg.corner[face], int(np.sign(leg.leg[face]))
                cells = [(corner[1] + turn * j - (turn < 0), corner[0] + turn * i - (turn < 0))
                         for j in range(size) for i in range(size - j)]
                shown.append(np.array([of_frame[cell] for cell in cells]))
            differences.append(np.abs(shown[0] - shown[1]).mean())
    assert np.median(differences) < 1e-4
    assert one.std() > 0.02


def test_after_a_full_turn_round_a_tube_patches_are_where_they_were() -> None:
    v = meshes.turning(TUBE, 2 * np.pi / 40)
    maker, state = synthesis(TUBE), None
    first = state = maker.frame(v, state)
    for _ in range(40):
        state = maker.frame(v, state)
    both = np.intersect1d(first.id, state.id)
    assert len(both) > 0.9 * len(first.id)
    one, other = (TUBE.at(TUBE.vertices, s.face[np.isin(s.id, both)], s.place[np.isin(s.id, both)])
                  for s in (first, state))
    # the corners of 24 segments are as fast as a circle, their middles slower: the chord is shorter too
    assert length(one - other).max() < 0.1
    np.testing.assert_allclose(one[:, 1], other[:, 1], atol=1e-9)


def test_axes_turn_and_bend_with_the_field() -> None:
    of = meshes.square(8, 12)
    v = np.cross([0, 0, 1.0], of.vertices - [6, 4, 0])
    maker = synthesis(of)
    face = np.array([12 * 4 + 10])
    lie = maker._turned(face, np.full((1, 3), 1 / 3), maker._ground(v))
    where = of.at(of.vertices, face, np.full((1, 3), 1 / 3))[0] - [6, 4, 0]
    away = length(where)
    # linear in a triangle
    np.testing.assert_allclose(lie.axis[0], np.array([-where[1], where[0], 0]) / away, atol=0.01)
    np.testing.assert_allclose(lie.bend[0], [SCALES[len(of.faces)] / away, 0], rtol=0.1, atol=2e-3)
    assert lie.radius[0] == np.float32(8)


def test_patches_are_small_where_the_surface_is_curved() -> None:
    wide = Synthesis(SAMPLE, BALL, Settings(radius=(6, 12)), 1, 1 / 16)
    radius = wide._ground(meshes.turning(BALL)).radius
    assert 6 <= np.median(radius) <= 8.5  # half the sphere's, 16 pixels


def test_where_the_field_rests_patches_rest_and_keep_the_direction_round_them() -> None:
    v = np.array(uniform(SQUARE, 0.0, 0.1))
    still = np.hypot(*(SQUARE.vertices[:, :2] - [6, 4]).T) < 2.5
    v[still] = 0
    maker = synthesis(SQUARE)
    one = maker.frame(v, None)
    two = maker.frame(v, one)
    ground = maker._ground(v)
    np.testing.assert_allclose(ground.facing, np.broadcast_to([0, 1.0, 0], v.shape), atol=1e-12)
    resting = still[SQUARE.faces[one.face]].all(axis=1)
    assert resting.any()
    same = np.isin(one.id, two.id)
    np.testing.assert_array_equal(two.place[np.isin(two.id, one.id)][resting[same]], one.place[same][resting[same]])


def test_another_seed_gives_another_picture() -> None:
    v = uniform(SQUARE, 0.1, 0.0)
    assert not np.array_equal(synthesis(SQUARE, seed=1).frame(v, None).face, synthesis(SQUARE, seed=2).frame(
        v, None).face)


def test_a_state_goes_through_a_file_and_on_with_the_same_bits() -> None:
    v = meshes.turning(BALL, 0.05)
    whole = frames(BALL, v, 5)
    file = io.BytesIO()
    np.savez(file, **whole[2].arrays())
    file.seek(0)
    with np.load(file) as kept:
        resumed = frames(BALL, v, 2, State.of(dict(kept)))
    for one, other in zip(resumed, whole[3:], strict=True):
        for name, values in one.arrays().items():
            np.testing.assert_array_equal(values, other.arrays()[name], err_msg=name)


def test_use_of_the_sample_is_that_of_the_living() -> None:
    state = frames(SQUARE, uniform(SQUARE, 0.2, 0.0), 10)[-1]
    maker = synthesis(SQUARE)
    np.testing.assert_array_equal(state.usage, maker.anchors.used(np.zeros_like(state.usage), state.anchor, 1))


@pytest.mark.parametrize("v", [np.zeros((5, 3)), np.full(SQUARE.vertices.shape, np.nan)])
def test_a_field_of_another_mesh_is_refused(v: np.ndarray) -> None:
    with pytest.raises(ValueError, match="a finite vector at each of 117 vertices"):
        synthesis(SQUARE).frame(v, None)


def test_a_sample_without_room_is_refused() -> None:
    alpha = np.zeros((40, 40))
    alpha[:, 20:22] = 1
    tiny = sample(canes(40, seed=1), alpha, direction=DIRECTION)
    with pytest.raises(ValueError, match="has no room for a patch"):
        Synthesis(tiny, SQUARE, SMALL, 1, 0.1)


def digest() -> str:
    v = meshes.turning(BALL, 0.05) + np.array([0, 0.02, 0])
    state = frames(BALL, v, 4)[-1]
    summed = hashlib.sha256(picture(BALL, v, state).tobytes())
    for values in state.arrays().values():
        summed.update(values.tobytes())
    return summed.hexdigest()


def test_the_same_bits_at_any_number_of_threads(tmp_path: object) -> None:
    assert len(processes.digests(__file__, tmp_path)) == 1
