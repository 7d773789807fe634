"""Schools (ma13 figures 9 and 11): smooth tracks, no fish in another's place, none swimming backwards."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from synth.elements import school
from synth.elements.samples import Elements

TRACKS = Path(__file__).parents[3] / "scenes" / "assets" / "fish-school" / "ground_truth.csv"
FLANKS = 0.13  # thickness of a fish over its length
SCHOOLS: dict[str, Callable[..., tuple[Elements, float]]] = {
    "homogeneous": school.homogeneous, "crossing": school.crossing, "mixed": school.mixed}


@pytest.fixture(scope="module", params=SCHOOLS)
def made_school(request: pytest.FixtureRequest) -> tuple[str, Elements, float]:
    return request.param, *SCHOOLS[request.param]()


def motion(elements: Elements, order: int) -> np.ndarray:
    """The tracks' derivative of this order (T, E, D), world units and seconds."""
    return np.diff(elements.positions[:, :, 0].astype(np.float64), order, axis=0) * elements.rate**order


def distances(elements: Elements) -> np.ndarray:
    """(T, E, E) between fish, on the torus; infinite from itself."""
    points = elements.positions[:, :, 0].astype(np.float64)
    apart = points[:, :, None] - points[:, None]
    if elements.period is not None:
        apart -= elements.period * np.rint(apart / elements.period)
    distance = np.linalg.norm(apart, axis=-1)
    distance[:, np.arange(elements.count), np.arange(elements.count)] = np.inf
    return distance


def test_a_school_is_of_fish_in_a_box(made_school: tuple[str, Elements, float]) -> None:
    name, elements, speed = made_school
    assert elements.topology == "none" and elements.frames == 60 and 20 <= elements.count <= 60
    assert elements.box is not None and elements.period is not None and (elements.box[0] == 0).all() and speed > 0
    first = elements.positions[0, :, 0]
    assert (first >= 0).all() and (first <= elements.period).all()
    assert np.bincount(elements.kind).tolist() == ([41, 3] if name == "mixed" else [elements.count])


def test_no_fish_swims_backwards(made_school: tuple[str, Elements, float]) -> None:
    _, elements, speed = made_school
    assert (motion(elements, 1)[..., 0] + speed).min() > 0.35 * speed


@pytest.mark.parametrize("made", SCHOOLS.values(), ids=SCHOOLS)
@pytest.mark.parametrize("seed", [3, 4])
def test_nor_in_the_slowest_school(made: Callable[..., tuple[Elements, float]], seed: int) -> None:
    elements, speed = made(speed=2.5 if made is school.crossing else 1.5, seed=seed, frames=40)
    assert (motion(elements, 1)[..., 0] + speed).min() > 0


def test_tracks_are_smooth(made_school: tuple[str, Elements, float]) -> None:
    name, elements, _ = made_school
    hardest = 28 if name == "crossing" else 3  # spacings per s²: a dart is a dart
    acceleration = np.linalg.norm(motion(elements, 2), axis=-1)
    assert acceleration.max() < hardest
    # jitter would turn round in every frame: what is left of it over two frames
    change = np.linalg.norm(motion(elements, 3), axis=-1) / elements.rate
    assert change.max() < 0.4 * acceleration.max()


def test_fish_keep_their_distance(made_school: tuple[str, Elements, float]) -> None:
    name, elements, _ = made_school
    distance = distances(elements)
    thickness = FLANKS * (elements.size[:, None] + elements.size[None]) / 2
    assert (distance > 1.5 * thickness).all()
    small = distance[:, elements.kind == 0].min(-1)
    assert 0.9 < np.median(small) < 1.3, "spacing 1 is the distance of a small fish from its nearest"
    assert small.min() > (0.4 if name == "crossing" else 0.75)


def test_the_frame_swims_with_the_school(made_school: tuple[str, Elements, float]) -> None:
    _, elements, _ = made_school
    drift = (elements.positions[-1] - elements.positions[0]).mean((0, 1))
    assert np.abs(drift).max() < 1e-5


def test_a_homogeneous_school_is_as_dense_everywhere() -> None:
    counts = np.zeros(8)
    for seed in range(4):
        elements, _ = school.homogeneous(frames=2, seed=seed)
        half = np.floor(elements.positions[0, :, 0] / elements.period * 2).astype(int) % 2
        counts += np.bincount(half @ [4, 2, 1], minlength=8)
    assert abs(counts / counts.mean() - 1).max() < 0.5


def test_some_fish_cross_to_the_other_group_and_the_rest_stay() -> None:
    elements, _ = school.crossing()
    z, depth = elements.positions[:, :, 0, 2], elements.period[2]  # type: ignore[index]
    side = np.floor(z[[0, -1]] / depth * 2)
    assert (side[0] != side[1]).sum() == 8
    fast = np.abs(motion(elements, 1)[..., 2]).max(0) > 3
    assert (fast == (side[0] != side[1])).all(), "who crosses does so rapidly, and nobody else is rapid"
    assert (np.bincount(side[0].astype(int)) == np.bincount(side[1].astype(int))).all()
    between = np.abs(z / depth * 2 % 1 - 0.5) > 0.45  # near the border of two groups' halves
    assert between.any() and between.mean() < 0.06, "the gap between the groups is there"


def test_small_fish_give_way_to_large_ones() -> None:
    elements, _ = school.mixed()
    large = elements.kind == 1
    assert elements.size[large].min() > 2 * elements.size[~large].max()
    assert distances(elements)[:, large].min() > 1.3


@pytest.mark.parametrize("made", SCHOOLS.values(), ids=SCHOOLS)
def test_a_seed_gives_the_same_bits_and_a_spacing_scales_them(made: Callable[..., tuple[Elements, float]]) -> None:
    one, speed = made(frames=32, seed=7)
    assert one.positions.tobytes() == made(frames=32, seed=7)[0].positions.tobytes()
    assert one.positions.tobytes() != made(frames=32, seed=8)[0].positions.tobytes()
    twice, faster = made(frames=32, seed=7, spacing=2.0)
    assert twice.positions == pytest.approx(2 * one.positions, abs=1e-5) and faster == 2 * speed
    assert twice.size == pytest.approx(2 * one.size)


def circling(frames: int = 80, rate: float = 24.0) -> tuple[np.ndarray, np.ndarray]:
    """Three fish on a circle of 300 pixels, as a tracker sees them, in whole pixels, y down; where they are in the
    frame that goes round with them, ahead and left."""
    own = np.array([[30.0, 0.0], [-15.0, 26.0], [-15.0, -26.0]])
    angle = 0.9 * np.arange(frames)[:, None] / rate
    heading = angle + np.pi / 2
    x = 300 * np.cos(angle) + own[:, 0] * np.cos(heading) - own[:, 1] * np.sin(heading)
    y = 300 * np.sin(angle) + own[:, 0] * np.sin(heading) + own[:, 1] * np.cos(heading)
    return np.rint(np.stack([400 + x, 400 - y], -1)), own


def test_fish_that_keep_station_rest_in_the_frame_that_turns_with_them() -> None:
    tracks, own = circling()
    elements, speed = school.tracked(tracks, 24.0, spacing=2.0)
    scale = 2.0 / np.linalg.norm(own[1] - own[0])
    found = elements.positions[8:-8, :, 0]  # the heading of the ends is that of one side
    assert found == pytest.approx(np.broadcast_to(own * scale, found.shape), abs=0.06)
    assert speed == pytest.approx(300 * 0.9 * scale, rel=0.02)


def test_the_filmed_fish_make_an_exemplar() -> None:
    rows = np.loadtxt(TRACKS, delimiter=",")
    assert (rows[:, 0] == np.arange(301)).all()
    elements, speed = school.tracked(rows[52:112, 1:].reshape(60, 5, 2), 24.0)
    assert (elements.count, elements.dimensions, elements.frames) == (5, 2, 60)
    assert np.median(distances(elements).min(-1)) == pytest.approx(1, abs=1e-3)
    assert np.abs(elements.positions.mean((1, 2))).max() < 1e-5
    assert (np.diff(elements.positions[:48, :, 0, 0], axis=0) * 24 + speed).min() > 0, "48 frames without a turn back"
    raw = np.diff(rows[52:112, 1:], 2, axis=0).std()
    smooth = np.diff(school.tracked(rows[52:112, 1:].reshape(60, 5, 2), 24.0)[0].positions, 2, axis=0).std()
    scale = np.median(np.linalg.norm(np.diff(rows[52:112, 1:5].reshape(60, 2, 2), axis=1), axis=-1))
    assert smooth < raw / scale * 2, "the tracker's steps are no rougher than they were"


BAD_TRACKS = np.where(np.arange(60).reshape(10, 3, 2) == 31, np.nan, 1.0)


@pytest.mark.parametrize(("made", "told"), [
    (lambda: school.homogeneous(5), "8 fish or more"),
    (lambda: school.homogeneous(frames=1), "2 frames or more"),
    (lambda: school.homogeneous(spacing=-1), "spacing = -1 is not above 0"),
    (lambda: school.homogeneous(rate=np.inf), "rate = inf"),
    (lambda: school.homogeneous(speed=0.5), "backwards"),
    (lambda: school.crossing(speed=2), "below 2.5 fish may swim backwards"),
    (lambda: school.crossing(20, groups=4), "do not make 4 groups"),
    (lambda: school.crossing(crossers=30), "crossers = 30"),
    (lambda: school.crossing(frames=20), "does not fit into 20 frames"),
    (lambda: school.mixed(large=0), "large = 0"),
    (lambda: school.mixed(size=9), "size = 9"),
    (lambda: school.tracked(np.ones((20, 1, 2)), 24), "two fish or more"),
    (lambda: school.tracked(np.ones((20, 2, 2)), 24, smoothing=8), "odd number"),
    (lambda: school.tracked(np.ones((7, 2, 2)), 24), "shorter than the 9"),
    (lambda: school.tracked(np.ones((20, 2, 2)), 24), "at rest"),
    (lambda: school.tracked(np.ones((20, 2, 2)), 0), "above 0"),
    (lambda: school.tracked(BAD_TRACKS, 24), "frame 6, element 1 is not finite"),
    (lambda: school.tracked(np.arange(20.0)[:, None, None] * np.ones((1, 2, 2)), 24), "all in one place"),
])
def test_what_makes_no_school_is_said(made: Callable[[], object], told: str) -> None:
    with pytest.raises(ValueError, match=told):
        made()
