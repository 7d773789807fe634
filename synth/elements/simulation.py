"""Exemplars by physical simulation (ma13 figures 10b and 13a), with MuJoCo: the only file that imports it.

    noodles  a bundle of soft rods, held at one end, shaken and in wind
    sheets   sheets of paper that flutter in turbulent air
    lifted   the coarse motion of one noodle that is lifted from a plate (figure 10a)

The models are generated here, in metres, kilograms and seconds, METRES to a world unit. Every run is sequential and
depends on its seed alone: the same seed gives the same bits.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from synth.elements.bundle import section, straight
from synth.elements.samples import Elements

METRES = 0.01  # of a world unit
GRAVITY = 9.81
STEPS = 16  # simulation steps per frame at 24 frames per second
LINKS = 20  # capsules of a noodle
NOODLE = {"density": 1000.0, "stiffness": 0.013, "damping": 1.5e-4, "armature": 1e-6}  # SI; of a joint of 4 cm links
CURL = 0.30  # angle, radians, between adjacent links of a noodle at rest
DRAG = 0.006  # kg/s of a link in air
SKIN = 1.2  # a simulated noodle's radius over the one rendered: contacts are soft
PAPER_SPACING = 0.04  # metres from one sample of a sheet to the next
PAPER = {"density": 0.08, "carried": 0.14, "young": 2e9, "thickness": 1e-4, "damping": 0.02}  # SI; to the square
# metre; the air carried along with a sheet weighs more than the sheet
AIR, PLATE, ALONG = 1.2, 2.0, 0.3  # density; drag of a plate across the wind, and of one along it
BORNE = 0.7  # share of a sheet's weight that an updraught carries: it stays among its gusts
GUST = 1.2  # m/s, rms
BUNDLE = {"density": 300.0, "bends": 2.2, "damping": 0.06}  # kg/m³; how far, in its radii, its stiffness carries its
# weight; seconds in which a bend dies away
SETTLE = 1.5  # seconds before the first frame
SHAKE = np.array([0.055, 0.055, 0.09])  # rms of the acceleration of the hand that holds noodles, of gravity


def _steps(rate: float, pace: float = 1.0) -> tuple[int, float]:
    """Steps in a frame, and the time step in seconds: that of STEPS at 24 frames per second, or a little less."""
    count = max(1, int(np.ceil(STEPS * 24 * pace / rate)))
    return count, pace / (rate * count)


@contextmanager
def _watched(what: str) -> Iterator[Any]:
    """MuJoCo, with its warnings, that a simulation diverged, raised as ValueError; by default they go to a file."""
    import mujoco

    told: list[str] = []
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(told.append)
    try:
        yield mujoco
    finally:
        mujoco.set_mju_user_warning(before)
    if told:
        raise ValueError(f"the simulation of {what} came apart; ask for gentler motion ({told[0].strip()})")


def _waves(rng: np.random.Generator, shape: tuple[int, ...], slowest: float, fastest: float
           ) -> Callable[[float], np.ndarray]:
    """Smooth noise of rms 1 in time (seconds), arrays of a shape: three sines of slowest to fastest hertz each."""
    pace = 2 * np.pi * rng.uniform(slowest, fastest, (3, *shape))
    phase = rng.uniform(0, 2 * np.pi, (3, *shape))
    return lambda time: np.sqrt(2 / 3) * np.sin(pace * time + phase).sum(0)


def noodles(count: int = 14, frames: int = 60, *, samples: int = 40, length: float = 80.0, spacing: float = 1.0,
            radius: float = 0.38, shake: float = 1.0, curl: float = 1.0, rate: float = 24.0,
            seed: int = 0) -> Elements:
    """A bundle of noodles that hangs along +z from sample 0, where it is shaken, in wind (ma13 figure 10b).

    length, spacing, radius  world units; a noodle of 80 is 0.8 m long and swings as slowly
    shake                    strength of hand and wind; 1: the hand by SHAKE
    curl                     curliness of the noodles at rest; 1: by CURL
    Noodles are chains of capsules with elastic joints, which touch one another without friction. Positions are
    relative to the hand: shaking enters as its acceleration, and samples 0 rest.
    `coarse`: straight threads on the bundle's section, spaced as the samples are on average.
    Raises ValueError for other than 2 to 31 noodles, fewer than 4 samples, or noodles that touch at rest.
    """
    if not 2 <= count <= 31:
        raise ValueError(f"a simulated bundle has 2 to 31 noodles, not {count}")
    _check(frames, rate, samples)
    if not 0 < 2 * radius * SKIN < spacing or not length > LINKS * radius:
        raise ValueError(f"noodles of radius {radius:g} and length {length:g} do not lie {spacing:g} apart")
    if not (0 <= shake <= 4 and 0 <= curl <= 3):
        raise ValueError(f"shake = {shake} is not between 0 and 4, or curl = {curl} not between 0 and 3")
    rng = np.random.Generator(np.random.Philox(key=seed))
    places = section(count, spacing)
    with _watched("noodles") as mujoco:
        model = _chains(mujoco, places * METRES, length * METRES, radius * SKIN * METRES, rate)
        model.qpos_spring[:] = _curls(rng, count, curl * CURL)
        nodes = _swaying(mujoco, model, count, frames, rate, shake, rng) / METRES
    curve = CubicSpline(np.arange(LINKS + 1), nodes, axis=2)(np.linspace(0, LINKS, samples))
    reach = (curve[:, :, -1, 2] - curve[:, :, 0, 2]).mean()
    coarse = np.broadcast_to(straight(places, samples, reach), curve.shape)
    return Elements(curve.astype(np.float32), (samples,), rate, size=np.full(count, radius), coarse=coarse,
                    colour=_dough(rng, count))


def _swaying(mujoco: Any, model: Any, count: int, frames: int, rate: float, shake: float,
             rng: np.random.Generator) -> np.ndarray:
    """Ends of the links (frames, E, LINKS + 1, 3) of chains that are shaken in wind, metres."""
    data = mujoco.MjData(model)
    held, gust, own = (_waves(rng, shape, 0.3, fastest) for shape, fastest in (
        ((3,), 1.1), ((2, 3), 0.7), ((count, 3), 1.3)))
    far = np.linspace(0, 1, LINKS)[None, :, None]
    steps, step = _steps(rate)
    before = int(np.ceil(SETTLE / step))
    nodes = np.empty((frames, count, LINKS + 1, 3))
    last = np.zeros(0)
    for k in range(before + (frames - 1) * steps + 1):
        time = (k - before) * step
        mujoco.mj_kinematics(model, data)
        if k >= before and (k - before) % steps == 0:
            nodes[(k - before) // steps] = _nodes(model, data, count)
        begun = shake * min(1.0, k / before)
        model.opt.gravity[:] = np.array([0, 0, GRAVITY]) - GRAVITY * begun * SHAKE * held(time)
        first, second = gust(time)
        air = begun * (0.15 * (first + (second - first) * far) + 0.22 * own(time)[:, None] * np.sqrt(far))
        here = data.xipos[1:].copy()
        velocity = (here - last) / step if k else np.zeros_like(here)
        last = here
        data.xfrc_applied[1:, :3] = DRAG * (air.reshape(-1, 3) - velocity)
        mujoco.mj_step(model, data)
    return nodes


def _check(frames: int, rate: float, samples: int) -> None:
    if frames < 2 or not (np.isfinite(rate) and rate > 0):
        raise ValueError(f"a simulation has 2 frames or more at a rate above 0, not {frames} at {rate}")
    if samples < 4:
        raise ValueError(f"a thread has 4 samples or more, not {samples}")


def _dough(rng: np.random.Generator, count: int) -> np.ndarray:
    """Colours (E, 3) of noodles, sRGB."""
    return np.clip(np.array([0.93, 0.80, 0.54]) * np.exp(rng.normal(0, 0.04, (count, 1))), 0, 1)


def _chains(mujoco: Any, places: np.ndarray, length: float, radius: float, rate: float) -> Any:
    """MuJoCo's model of chains of LINKS capsules at places (E, 2), along z; metres.

    Capsules of different chains collide, for which each chain has a bit of its own; those of one chain do not.
    """
    link, every = length / LINKS, (1 << len(places)) - 1
    step = _steps(rate)[1]
    longer = link / 0.04  # a joint of a longer link stands for more of the rod
    bodies = []
    for i, (x, y) in enumerate(places.tolist()):
        geom = (f'<joint/><geom fromto="0 0 0 0 0 {link}" size="{radius}" contype="{1 << i}" '
                f'conaffinity="{every & ~(1 << i)}"/>')
        bodies.append(f'<body pos="{x} {y} 0">{geom}' + f'<body pos="0 0 {link}">{geom}' * (LINKS - 1)
                      + "</body>" * LINKS)
    return mujoco.MjModel.from_xml_string(f"""
        <mujoco>
          <option timestep="{step}" integrator="implicitfast" solver="CG" iterations="60" tolerance="1e-8"/>
          <default>
            <geom type="capsule" condim="1" solref="{2.2 * step} 1" solimp="0.95 0.99 {0.2 * radius}"
                  density="{NOODLE['density']}"/>
            <joint type="ball" stiffness="{NOODLE['stiffness'] / longer}" damping="{NOODLE['damping'] / longer}"
                   armature="{NOODLE['armature']}"/>
          </default>
          <worldbody>{"".join(bodies)}</worldbody>
        </mujoco>""")


def _curls(rng: np.random.Generator, count: int, angle: float) -> np.ndarray:
    """Quaternions (E × LINKS × 4,) of the links at rest relative to the ones before: two waves along the noodle about
    each axis across it."""
    link = np.arange(LINKS)
    wave, phase = rng.uniform(4.5, 8, (2, 2, count, 1)), rng.uniform(0, 2 * np.pi, (2, 2, count, 1))
    angles = angle * np.sin(2 * np.pi * link / wave + phase).sum(0) / np.sqrt(2)
    vectors = np.stack([angles[0], angles[1], np.zeros_like(angles[0])], -1)
    whole = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.concatenate([np.cos(whole / 2), np.sin(whole / 2) * vectors / np.maximum(whole, 1e-12)], -1).ravel()


def _nodes(model: Any, data: Any, count: int) -> np.ndarray:
    """Both ends of all links of the chains now, (E, LINKS + 1, 3), metres."""
    first = model.nbody - count * LINKS
    begin = data.xpos[first:].reshape(count, LINKS, 3)
    middle = data.geom_xpos[-count * LINKS:].reshape(count, LINKS, 3)[:, -1:]
    return np.concatenate([begin, 2 * middle - begin[:, -1:]], 1)


def sheets(count: int = 8, frames: int = 60, *, side: int = 7, spacing: float = 1.0, thickness: float = 0.02,
           wind: float = 1.2, stiffness: float = 1.0, pace: float = 0.5, rate: float = 24.0,
           seed: int = 0) -> Elements:
    """Sheets of paper that flutter in turbulent air (ma13 figure 13a).

    side       samples in a row and in a column of a sheet, 3 to 15 (§6.3: 7 × 7)
    spacing    of the samples, world units: a sheet of 7 × 7 is 24 cm wide; thickness, world units
    wind       its strength; 1: an rms of GUST
    stiffness  of the sheet in bending; 1: printing paper
    pace       simulated seconds per second shown, from 0.1 to 1: below 1 is slow motion
    Each sheet falls by itself, under the pressure of the relative wind on its triangles. Its rigid motion, the fall
    and the tumbling, belongs to the coarse motion and is removed: in each frame it is rotated and moved to fit best to
    a flat sheet, rows along +y, columns along +x, beside the other sheets. `coarse`: those flat sheets. Raises
    ValueError for numbers out of these ranges.
    """
    if not 1 <= count <= 100 or not 3 <= side <= 15:
        raise ValueError(f"1 to 100 sheets of 3 × 3 to 15 × 15 samples are simulated, not {count} of {side} × {side}")
    _check(frames, rate, side * side)
    if not (spacing > 0 and thickness > 0 and 0 <= wind <= 3 and 0.1 <= stiffness <= 50
            and 0.1 <= pace <= 1):
        raise ValueError("sheets need a spacing and a thickness above 0, wind up to 3, stiffness from 0.1 to 50 and a "
                         f"pace from 0.1 to 1, not {spacing}, {thickness}, {wind}, {stiffness} and {pace}")
    rng = np.random.Generator(np.random.Philox(key=seed))
    steps, step = _steps(rate, pace)
    flat = _flat(side) * spacing
    columns = int(np.ceil(np.sqrt(count)))
    coarse = np.empty((frames, count, side * side, 3))
    positions = np.empty_like(coarse)
    with _watched("sheets") as mujoco:
        model = _paper(mujoco, side, stiffness, step)
        for sheet in range(count):
            place = np.array([sheet % columns, sheet // columns, 0]) * spacing * (side + 1.0)
            coarse[:, sheet] = flat + place
            for frame, points in enumerate(_fluttering(mujoco, model, side, frames, steps, wind, rng)):
                positions[frame, sheet] = _fitted(points * (spacing / PAPER_SPACING), flat) + place
    colour = np.clip(0.93 * np.exp(rng.normal(0, 0.03, (count, 1))) * [1.0, 0.99, 0.96], 0, 1)
    return Elements(positions.astype(np.float32), (side, side), rate, size=np.full(count, thickness), colour=colour,
                    coarse=coarse)


def _paper(mujoco: Any, side: int, stiffness: float, step: float) -> Any:
    """MuJoCo's model of a sheet of side × side points, metres."""
    mass = (PAPER["density"] + PAPER["carried"]) * (PAPER_SPACING * (side - 1)) ** 2
    weight = GRAVITY * (1 - BORNE) * PAPER["density"] / (PAPER["density"] + PAPER["carried"])
    points = _flat(side) * PAPER_SPACING
    return mujoco.MjModel.from_xml_string(f"""
        <mujoco>
          <option timestep="{step}" gravity="0 0 {-weight}" integrator="discrete" solver="Newton" iterations="60"
                  tolerance="1e-8"/>
          <worldbody>
            <flexcomp name="sheet" type="direct" dim="2" radius="0.0005" mass="{mass}"
                      point="{' '.join(map(str, points.ravel().tolist()))}"
                      element="{' '.join(map(str, _triangles(side).ravel().tolist()))}">
              <contact contype="0" conaffinity="0" selfcollide="none"/>
              <edge equality="true" solref="{2.2 * step} 1" solimp="0.99 0.999 0.001"/>
              <elasticity young="{PAPER['young'] * stiffness}" poisson="0.2" thickness="{PAPER['thickness']}"
                          elastic2d="bend" damping="{PAPER['damping']}"/>
            </flexcomp>
          </worldbody>
        </mujoco>""")


def _flat(side: int) -> np.ndarray:
    """Points (side², 3) of a flat sheet, at unit spacing, centred on 0, row by row."""
    along = np.arange(side) - (side - 1) / 2
    x, y = np.meshgrid(along, along)
    return np.stack([x, y, np.zeros_like(x)], -1).reshape(-1, 3)


def _triangles(side: int) -> np.ndarray:
    """Triangles (M, 3) of a sheet; diagonals alternate: otherwise it would bend more easily about one of them."""
    row, column = (index.ravel() for index in np.meshgrid(*[np.arange(side - 1)] * 2, indexing="ij"))
    corner = row * side + column
    quad = np.stack([corner, corner + 1, corner + side + 1, corner + side], 1)
    one, other = quad[:, [0, 1, 2, 0, 2, 3]], quad[:, [1, 2, 3, 1, 3, 0]]
    return np.where(((row + column) % 2 == 0)[:, None], one, other).reshape(-1, 3)


def _fluttering(mujoco: Any, model: Any, side: int, frames: int, steps: int, wind: float,
                rng: np.random.Generator) -> np.ndarray:
    """Points (frames, S, 3) of a sheet in the air, row by row, metres."""
    data = mujoco.MjData(model)
    triangles = _triangles(side)
    air = _turbulence(rng)
    mujoco.mj_forward(model, data)
    points = data.flexvert_xpos.copy()
    step = model.opt.timestep
    before = int(np.ceil(SETTLE / step))
    recorded = np.empty((frames, len(points), 3))
    for k in range(before + (frames - 1) * steps + 1):
        if k >= before and (k - before) % steps == 0:
            recorded[(k - before) // steps] = points
        time = (k - before) * step
        velocity = data.qvel.reshape(-1, 3)
        corners = points[triangles]
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2  # as long as the area
        area = np.linalg.norm(normal, axis=1, keepdims=True)
        middle = corners.mean(1)
        blown = wind * min(1.0, 2 * k / before) * air(middle, time) - velocity[triangles].mean(1)
        through = (blown * normal).sum(1, keepdims=True) / area
        pressed = 0.5 * AIR * (PLATE * np.abs(through) * through * normal
                               + ALONG * np.linalg.norm(blown, axis=1, keepdims=True) * blown * area)
        force = np.zeros_like(points)
        np.add.at(force, triangles, pressed[:, None] / 3)
        data.qfrc_applied[:] = force.ravel()
        mujoco.mj_step(model, data)
        points = data.flexvert_xpos.copy()
    return recorded


def _turbulence(rng: np.random.Generator) -> Callable[[np.ndarray, float], np.ndarray]:
    """Velocities (P, 3), m/s, at places (P, 3) and a time: transverse waves, from gusts as large as several
    sheets to eddies of half a sheet, the smaller the slower; an rms of GUST."""
    size = np.geomspace(1.2, 0.16, 12)
    direction = rng.normal(size=(12, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    across = np.cross(direction, rng.normal(size=(12, 3)))
    across *= size[:, None] ** (1 / 3) / np.linalg.norm(across, axis=1, keepdims=True)
    across *= GUST / np.sqrt((across**2).sum() / 2)
    pace, phase = 2 * np.pi * rng.uniform(0.4, 1.0, 12) * size ** (-1 / 3), rng.uniform(0, 2 * np.pi, 12)
    return lambda place, time: np.sin(place @ (2 * np.pi * direction / size[:, None]).T - pace * time + phase) @ across


def _fitted(points: np.ndarray, flat: np.ndarray) -> np.ndarray:
    """Points (S, 3) rotated and moved, without scaling, to fit best to those of a flat sheet [Kabsch 1976]."""
    offset = points - points.mean(0)
    left, _, right = np.linalg.svd(offset.T @ flat)
    mirror = np.array([1, 1, np.sign(np.linalg.det(left @ right))])
    return offset @ (left * mirror) @ right


def lifted(frames: int = 60, *, samples: int = 40, length: float = 100.0, thick: float = 8.0, height: float = 0.8,
           lasts: float = 0.65, rate: float = 24.0, seed: int = 0) -> np.ndarray:
    """The coarse motion of noodles (ma13 §6.2, figure 10a): one curve (frames, samples, 3) float32, world units.

    A bundle lies on a plate at y = 0, y up, bent to an arc about x = z = 0. It is lifted at sample 0 and swings as it
    hangs, its other end on the plate until it is lifted too high.
    thick   radius of the bundle, world units: the height of its middle above the plate; its stiffness depends on it
    height  to which sample 0 is lifted, in lengths, 0 to 1.5; lasts: the share of the clip that the lift lasts
    `bundle.duplicated` gives all noodles its motion. Raises ValueError for numbers out of these ranges, or a bundle
    that is less than ten times as long as its radius.
    """
    _check(frames, rate, samples)
    if not (thick > 0 and length >= 10 * thick):
        raise ValueError(f"a bundle of radius {thick:g} is to be 10 times as long, not {length:g}")
    if not (0 <= height <= 1.5 and 0.1 <= lasts <= 1):
        raise ValueError(f"height = {height} is not between 0 and 1.5, or lasts = {lasts} not between 0.1 and 1")
    rng = np.random.Generator(np.random.Philox(key=seed))
    bend = rng.choice([-1.0, 1.0]) * rng.uniform(3.0, 3.6)  # radians from one end to the other
    with _watched("a noodle") as mujoco:
        nodes = _hoisted(mujoco, frames, rate, length * METRES, thick * METRES, bend, height, lasts,
                         _waves(rng, (2,), 0.25, 0.8)) / METRES
    curve = CubicSpline(np.arange(LINKS + 1), nodes, axis=1)(np.linspace(0, LINKS, samples))
    return np.stack([curve[..., 0], curve[..., 2], -curve[..., 1]], -1).astype(np.float32)


def _hoisted(mujoco: Any, frames: int, rate: float, length: float, thick: float, bend: float, height: float,
             lasts: float, unsteady: Callable[[float], np.ndarray]) -> np.ndarray:
    """Ends of the links (frames, LINKS + 1, 3), metres, z up, of a chain whose first end a hand takes up."""
    steps, step = _steps(rate)
    model = _lying(mujoco, length, thick, bend, step)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    before = int(np.ceil(SETTLE / step))
    taken = data.mocap_pos[0].copy()
    over = np.array([*0.35 * taken[:2], max(thick, height * length)])  # nearer to the middle of the plate
    end = lasts * (frames - 1) / rate
    nodes = np.empty((frames, LINKS + 1, 3))
    for k in range(before + (frames - 1) * steps + 1):
        mujoco.mj_kinematics(model, data)
        if k >= before and (k - before) % steps == 0:
            nodes[(k - before) // steps] = _nodes(model, data, 1)[0]
        s = np.clip((k - before) * step / end, 0, 1)
        s = s**3 * (10 + s * (6 * s - 15))
        data.mocap_pos[0] = taken + s * (over - taken)
        data.mocap_pos[0, :2] += 0.03 * length * s * unsteady((k - before) * step)
        mujoco.mj_step(model, data)
    return nodes


def _lying(mujoco: Any, length: float, thick: float, bend: float, step: float) -> Any:
    """MuJoCo's model of one thick chain that lies in an arc on a plate, and of the hand that holds its first end."""
    link, angle = length / LINKS, bend / LINKS
    radius = length / bend
    geom = f'<geom fromto="0 0 0 {link} 0 0" size="{thick}"/>'
    following = f'<body pos="{link} 0 0" euler="0 0 {angle}"><joint type="ball"/>{geom}'
    heavy = np.pi * thick**2 * BUNDLE["density"]
    stiffness = heavy * GRAVITY * (BUNDLE["bends"] * thick) ** 3 / link
    return mujoco.MjModel.from_xml_string(f"""
        <mujoco>
          <compiler angle="radian"/>
          <option timestep="{step}" integrator="implicitfast" solver="CG" iterations="60" tolerance="1e-8"
                  gravity="0 0 {-GRAVITY}"/>
          <default>
            <geom type="capsule" contype="1" conaffinity="2" friction="0.25" density="{BUNDLE['density']}"
                  solref="{4 * step} 1"/>
            <joint stiffness="{stiffness}" damping="{BUNDLE['damping'] * stiffness}"
                   armature="{0.05 * heavy * link * link**2}"/>
          </default>
          <worldbody>
            <geom type="plane" size="0 0 1" contype="2" conaffinity="1"/>
            <body name="hand" mocap="true" pos="0 {-radius} {thick}"/>
            <body name="first" pos="0 {-radius} {thick}" euler="0 0 {angle / 2}"><freejoint/>{geom}
              {following * (LINKS - 1)}{"</body>" * (LINKS - 1)}
            </body>
          </worldbody>
          <equality><connect body1="first" body2="hand" anchor="0 0 0" solref="{4 * step} 1"/></equality>
        </mujoco>""")
