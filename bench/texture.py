"""Moving textures (wang05): how like their sample frames stay, how they move, time, memory, and rlic beside them.

`python -m bench.texture` prints one JSON object. Each run is a process of its own, `python -m bench.texture run NAME`
for a texture and `... size N` for a picture of N² pixels, so that its memory is its own.

Textures are 512² from samples of 128². The figures' samples and flows are those the method was made with; nobody has
looked at the foreign ones while doing so. Times are of a frame and its picture, with a warm kernel cache.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy import ndimage

from bench.machine import peak_memory
from bench.synthesis import median, timed
from pipeline.files import pictures
from render import lic, tonemap
from synth.motion.coarse import coarse, upsample
from synth.texture import carry, flow, measures, paper, patches, procedural
from synth.texture.sample import Sample, luminance, sample, turned

SAMPLE, SIZE = 128, 512
MOMENTS = (1, 10, 30, 100, 300)  # frames of which every number is taken
STEPS = 10  # of the correlation
SIZES = (256, 512, 1024, 2048)
REFERENCED = 256  # edge of the picture that the reference draws
SETTLING, TIMED, TURNS = 10, 9, 15  # frames before times are taken; frames and turns that are timed
TAPS = 41
PHOTOGRAPHS = Path(__file__).parents[1] / "scenes/assets"
METHODS: dict[str, Any] = {"carry": carry, "paper": paper}


# Flows, pixels per frame: x and y run from -1 to 1.


def places(n: int) -> tuple[np.ndarray, np.ndarray]:
    """x, y of the pixels of a picture: (n, n) each."""
    y, x = (np.mgrid[:n, :n] + 0.5) * (2 / n) - 1
    return x, y


def circles(n: int) -> np.ndarray:
    """Equal angular velocity (figure 10), 0.3 to 2.2 pixels."""
    x, y = places(n)
    return flow.limited(2.2 * np.stack([-y, x], -1), 0.3, 2.2)


def vortices(n: int) -> np.ndarray:
    """Vortices of both senses with saddles between them, of one speed."""
    x, y = places(n)
    along, across = 2.6 * x + 0.5, 3.1 * y - 0.4
    slant = 0.35 * np.cos(1.7 * x - 2.3 * y + 1)
    u = 3.1 * np.sin(along) * np.cos(across) - 2.3 * slant
    v = -2.6 * np.cos(along) * np.sin(across) - 1.7 * slant
    return flow.normalized(np.stack([u, v], -1), 1.5)


def wavy(n: int) -> np.ndarray:
    """Lines from left to right that swing up and down twice, of one speed."""
    x, _ = places(n)
    return flow.normalized(np.stack([np.ones_like(x), 0.6 * np.cos(2 * np.pi * x)], -1), 1.5)


def saddle(n: int) -> np.ndarray:
    """In from above and below, out to both sides, of one speed."""
    x, y = places(n)
    return flow.normalized(np.stack([x, -y], -1), 1.5)


def noise(n: int) -> np.ndarray:
    """Turbulence without divergence, 0.3 to 2.2 pixels."""
    v = upsample(next(coarse("curl-noise", (64, 64), 1, seed=5, length=0.7, octaves=2)), (n, n), "cubic")
    return flow.limited(v * np.float32(1.2 / np.hypot(v[..., 0], v[..., 1]).mean()), 0.3, 2.2)


def spiral(n: int) -> np.ndarray:
    """A spiral into a sink and one out of a source, of one speed: what is synthesised anew never ends."""
    x, y = places(n)
    total = np.zeros((n, n, 2))
    for (cx, cy), inwards in (((-0.4, -0.2), 1), ((0.45, 0.3), -1)):
        dx, dy = x - cx, y - cy
        near = np.exp(-(dx * dx + dy * dy) / 0.5)
        total += np.stack([-dy - 0.5 * inwards * dx, dx - 0.5 * inwards * dy], -1) * near[..., None]
    return flow.normalized(total, 1.5)


# Foreign samples, (SAMPLE, SAMPLE, 3) float32 in linear light; all but the rings run along +y.


def _drawn(tone: Callable[[np.ndarray, np.ndarray], np.ndarray], dark: tuple[float, ...],
           bright: tuple[float, ...]) -> np.ndarray:
    """A tone 0..1 of x and y in pixels, between two colours; means of 4 by 4."""
    y, x = (np.mgrid[:4 * SAMPLE, :4 * SAMPLE] + 0.5) / 4
    means = lic.averaged(np.clip(tone(x, y), 0, 1), 4)[..., None]
    return (np.array(dark) + means * (np.array(bright) - np.array(dark))).astype(np.float32)


def _random(seed: int, *shape: int) -> np.ndarray:
    return np.random.Generator(np.random.Philox(key=seed)).random(shape)


def beads() -> np.ndarray:
    """Dots on lines: balls of two sizes on threads."""
    shift, small = _random(11, 16), _random(12, 16, 40)

    def tone(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        line = (x // 12).astype(int)
        row, v = np.divmod(y + 9 * shift[line], 9)
        radius = np.where(small[line, row.astype(int)] < 0.3, 2.4, 3.9)
        away = np.hypot(x % 12 - 6, v - 4.5) / radius
        thread = 0.35 * (np.abs(x % 12 - 6) < 0.7)
        return np.where(away < 1, 1 - 0.7 * away**2, thread)

    return _drawn(tone, (0.03, 0.02, 0.05), (0.85, 0.75, 0.55))


def zigzag() -> np.ndarray:
    """Bands that turn left and right every 8 pixels."""
    light = _random(13, 32)

    def tone(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        at = x + 5 * np.abs((y / 8) % 2 - 1)
        band = (at // 10).astype(int)
        return (0.45 + 0.5 * light[band]) * np.clip(3 - np.abs(at % 10 - 5), 0, 1)

    return _drawn(tone, (0.02, 0.03, 0.10), (0.9, 0.55, 0.25))


def rings() -> np.ndarray:
    """Wood cut across: rings of uneven width, with rays; it has no main direction."""
    width = np.cumsum(2.5 + 6 * _random(14, 60))
    wobble = ndimage.gaussian_filter(_random(15, 4 * SAMPLE, 4 * SAMPLE) - 0.5, 40)

    def tone(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        r = np.hypot(x - 50, y - 70) + 2.5 * wobble / wobble.std()
        ring = np.searchsorted(width, r)
        within = (r - np.concatenate([[0], width])[ring]) / np.diff(width, prepend=0, append=width[-1] + 9)[ring]
        rays = 0.08 * np.sin(70 * np.arctan2(y - 70, x - 50))
        return 0.95 - 0.75 * np.clip(within, 0, 1) ** 3 + rays

    return _drawn(tone, (0.10, 0.04, 0.015), (0.66, 0.44, 0.22))


def woven() -> np.ndarray:
    """Plain weave: threads of 8 pixels, over and under; both ways are alike but for their colour."""
    warp, weft = _random(16, 2, 16)

    def tone(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        i, j = (x // 8).astype(int), (y // 8).astype(int)
        u, v = x % 8 / 4 - 1, y % 8 / 4 - 1
        over = (i + j) % 2 == 0
        across, along = np.where(over, u, v), np.where(over, v, u)
        own = np.where(over, 0.65 + 0.3 * warp[i], 0.35 + 0.2 * weft[j])
        return own * np.sqrt(np.clip(1 - across**2, 0, 1)) * (1 - 0.45 * along**2)

    return _drawn(tone, (0.02, 0.02, 0.02), (0.55, 0.60, 0.80))


def arrows() -> np.ndarray:
    """Arrows that point to +y, in shifted columns: heads and tails."""
    shift, light = _random(17, 16), _random(18, 16, 16)

    def tone(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        column = (x // 14).astype(int)
        row, v = np.divmod(y + 22 * shift[column], 22)
        off = np.abs(x % 14 - 7)
        head = (v > 11) & (off < 5.5 * (20 - v) / 9)
        shaft = (v > 2) & (v <= 11) & (off < 1.6)
        return (0.55 + 0.45 * light[column, row.astype(int)]) * (head | shaft)

    return _drawn(tone, (0.04, 0.05, 0.06), (0.9, 0.3, 0.15))


def strokes() -> np.ndarray:
    """Noise drawn out along y, of three widths."""
    white = _random(19, 3, 4 * SAMPLE, 4 * SAMPLE) - 0.5
    soft = [ndimage.gaussian_filter(w, (4 * 3 * s, 4 * 0.5 * s)) for w, s in zip(white, (1, 2, 4), strict=True)]
    picture = sum(w / w.std() for w in soft)
    return _drawn(lambda x, y: 0.5 + 0.22 * picture, (0.02, 0.05, 0.03), (0.7, 0.85, 0.5))


def brick() -> np.ndarray:
    """The photograph of a brick wall."""
    return _photograph("brick")


def gravel() -> np.ndarray:
    """The photograph of gravel, which has no direction."""
    return _photograph("gravel")


def _photograph(name: str) -> np.ndarray:
    read = pictures.read(PHOTOGRAPHS / f"{name}.png")
    small = np.clip(pictures.resized(read, SAMPLE, SAMPLE), 0, 1)
    return tonemap.from_srgb(small)[::-1].astype(np.float32)


class Texture(NamedTuple):
    """A run: colour of the sample and its direction (None: by Tamura); the flow; the method; how many frames, and each
    how manieth of them is compared with the one before."""

    sample: Callable[[], np.ndarray]
    direction: float | None
    flow: Callable[[int], np.ndarray]
    method: str
    frames: int
    every: int

    def read(self) -> Sample:
        return sample(np.ascontiguousarray(self.sample()), direction=self.direction)


FIGURES: dict[str, tuple[Callable[[], np.ndarray], float | None, Callable[[int], np.ndarray], int]] = {
    "canes on circles": (procedural.canes, procedural.DIRECTION, circles, 300),
    "straw on vortices": (procedural.straw, procedural.DIRECTION, vortices, 300),
    "brick on waves": (brick, None, wavy, 300),
    "scales on a saddle": (procedural.scales, procedural.DIRECTION, saddle, 100),
    "gravel on circles": (gravel, None, circles, 100),
    "brick on circles": (brick, None, circles, 100)}
"""Sample, its direction, flow, and frames by `carry`; by `paper` there are BY_PAPER."""
BY_PAPER = 100
FOREIGN = {"beads": beads, "zigzag": zigzag, "rings": rings, "woven": woven, "arrows": arrows, "strokes": strokes}
STRANGE = {"noise": noise, "a spiral": spiral}
TEXTURES = {
    **{f"{name}, carry": Texture(*parts[:3], "carry", parts[3], 1 if parts[3] == 300 else 2)
       for name, parts in FIGURES.items()},
    **{f"{name}, paper": Texture(*parts[:3], "paper", BY_PAPER, 4) for name, parts in FIGURES.items()},
    **{f"{name} on {where}, carry": Texture(made, None if made is rings else procedural.DIRECTION, v, "carry", 100, 4)
       for name, made in FOREIGN.items() for where, v in STRANGE.items()}}


def rounded(value: float) -> float:
    return round(float(value), 3)


def run(name: str) -> dict[str, Any]:
    """All numbers of one texture: of the frames at MOMENTS, of its motion, and what a frame takes."""
    texture, of = TEXTURES[name], name.rsplit(", ", 1)[0]
    given = texture.read()
    reference, v = measures.Reference(given), texture.flow(SIZE)
    theta, method = flow.angles(v), METHODS[texture.method]
    method.Synthesis(given, (128, 128), method.Settings(), 1).frame(circles(128), None)  # builds the kernels
    synthesis = method.Synthesis(given, (SIZE, SIZE), method.Settings(), 1)
    frames, moments, pairs, took, anew, correlated = [], {}, [], [], [], []
    state, earlier, then = None, None, None
    for number in range(1, texture.frames + 1):
        (state, picture), times = timed(lambda before=state: shown(synthesis, v, before))
        frame = luminance(picture, given.white)
        if number > 1:
            took.append(times)
            anew.append(synthesis.renewed(state) if texture.method == "carry" else state.resynthesized)
        if earlier is not None and number % texture.every == 0:
            pairs.append(measures.of_pair(earlier, frame, v, reference))
        if number in MOMENTS:
            moments[number] = measures.of_frame(frame, theta, reference)
        if number % 30 == STEPS:
            then = frame
        if number % 30 == 2 * STEPS:
            correlated.append(measures.correlation(then, frame, [v] * STEPS))
        earlier = frame
    for number, numbers in moments.items():
        degrees = {key: np.rad2deg(numbers.pop(key)) for key in ("dir_50", "dir_90") if key in numbers}
        frames.append({"texture": of, "method": texture.method, "frame": number,
                       **{key: rounded(value) for key, value in numbers.items()},
                       **{f"{key}, °": round(float(degrees[key]), 1) if degrees else None
                          for key in ("dir_50", "dir_90")}})
    last = max(moments)
    motion = {"texture": of, "method": texture.method, "frames": texture.frames,
              "residual 50 %": rounded(np.median([p["residual_50"] for p in pairs])),
              "residual 95 %": rounded(np.median([p["residual_95"] for p in pairs])),
              "worst block": rounded(max(p["worst"] for p in pairs)), "corr10": rounded(np.median(correlated)),
              "synthesised anew, %": round(100 * float(np.mean(anew)), 2),
              "most in a frame, %": round(100 * max(anew), 2),
              **{f"drift of {key}": rounded(value) for key, value in
                 measures.drift(moments[1], moments[last]).items()},
              "wall ms": round(1000 * median(took)["wall"]), "processor ms": round(1000 * median(took)["processor"]),
              "peak memory MB": round(peak_memory())}
    return {"frames": frames, "motion": motion}


def shown(synthesis: Any, v: np.ndarray, state: Any) -> tuple[Any, np.ndarray]:
    """The next state and its picture."""
    after = synthesis.frame(v, state)
    return after, synthesis.picture(after)


def floor() -> dict[str, float]:
    """The residual of canes that turn as one: what reading between pixels costs, no method has less."""
    whole = luminance(procedural.canes(SIZE))
    reference, side = measures.Reference(TEXTURES["canes on circles, carry"].read()), 352
    x, y = places(side)
    step = 2 * 2.2 / SIZE  # radians per frame
    v = (step * side / 2 * np.stack([-y, x], -1)).astype(np.float32)
    found = measures.of_pair(turned(whole, 0.3, side), turned(whole, 0.3 + step, side), v, reference)
    return {key: rounded(value) for key, value in found.items()}


def size(n: int) -> dict[str, Any]:
    """Straw on vortices at n² pixels: the first frame, all its preparation included, later ones, and peak memory."""
    straw = procedural.straw(SAMPLE)

    def begun(n: int, v: np.ndarray) -> tuple[Any, Any]:
        synthesis = carry.Synthesis(sample(straw, direction=procedural.DIRECTION), (n, n), carry.Settings(), 1)
        return synthesis, shown(synthesis, v, None)[0]

    v = vortices(n)
    small, state = begun(128, vortices(128))  # builds the kernels
    shown(small, vortices(128), state)
    (synthesis, state), first = timed(lambda: begun(n, v))
    took = []
    for number in range(SETTLING + TIMED):
        (state, _), times = timed(lambda before=state: shown(synthesis, v, before))
        if number >= SETTLING:
            took.append(times)
    return {"size": f"{n}²", "patches": len(state.id), "first frame, wall s": round(first["wall"], 2),
            "first frame, processor s": round(first["processor"], 2), "wall ms": round(1000 * median(took)["wall"], 1),
            "processor ms": round(1000 * median(took)["processor"], 1), "peak memory MB": round(peak_memory())}


def exponent(rows: list[dict[str, Any]], key: str) -> float:
    """Of a time in the number of pixels."""
    pixels = [int(row["size"].removesuffix("²")) ** 2 for row in rows]
    return round(float(np.polyfit(np.log(pixels), np.log([row[key] for row in rows]), 1)[0]), 2)


def beside_rlic() -> dict[str, Any]:
    """A frame of ours and a convolution of noise along the same flow, in turns: medians, and those of their ratios."""
    given, v = TEXTURES["straw on vortices, carry"].read(), vortices(SIZE)
    synthesis = carry.Synthesis(given, (SIZE, SIZE), carry.Settings(), 1)
    grain = _random(21, SIZE, SIZE).astype(np.float32)
    lic.convolved(grain, v, TAPS, 1)
    state, _ = shown(synthesis, v, None)
    for _ in range(SETTLING):
        state, _ = shown(synthesis, v, state)
    ours, theirs = [], []
    for _ in range(TURNS):
        (state, _), times = timed(lambda before=state: shown(synthesis, v, before))
        ours.append(times)
        theirs.append(timed(lambda: lic.convolved(grain, v, TAPS, 1))[1])
    ratio = {key: round(float(np.median([a[key] / b[key] for a, b in zip(ours, theirs, strict=True)])), 2)
             for key in ("wall", "processor")}
    return {"ours": median(ours), "rlic": median(theirs), "ratio": ratio}


def against_reference() -> dict[str, Any]:
    """The kernel that draws beside its specification in NumPy."""
    n, v = REFERENCED, vortices(REFERENCED)
    synthesis = carry.Synthesis(TEXTURES["straw on vortices, carry"].read(), (n, n), carry.Settings(), 1)
    state = synthesis.frame(v, None)
    table, lists = synthesis._tables(state)
    painter = synthesis.painter
    painter.draw(table, lists, state.blend, None)
    ours = [timed(lambda: painter.draw(table, lists, state.blend, None)) for _ in range(TURNS)]
    specified, theirs = timed(lambda: patches.draw_reference(painter, table, state.blend, None))
    return {"size": f"{n}²", "ours": {key: round(float(np.median([t[key] for _, t in ours])), 4) for key in theirs},
            "reference": {key: round(value, 3) for key, value in theirs.items()},
            "largest difference": float(f"{np.abs(ours[0][0] - specified).max():.1e}")}


ALONE: dict[str, Callable[[], dict[str, Any]]] = {
    "floor": floor, "beside rlic": beside_rlic, "against the reference": against_reference}


def child(*what: str) -> dict[str, Any]:
    """What `python -m bench.texture` prints with these arguments, in a process of its own."""
    printed = subprocess.run([sys.executable, "-m", "bench.texture", *what], stdout=subprocess.PIPE, text=True,
                             check=True)
    found: dict[str, Any] = json.loads(printed.stdout)
    return found


def main() -> None:
    match sys.argv[1:]:
        case ["run", name]:
            print(json.dumps(ALONE[name]() if name in ALONE else run(name)))
        case ["size", n]:
            print(json.dumps(size(int(n))))
        case _:
            print(json.dumps(everything(), indent=1, ensure_ascii=False))


def everything() -> dict[str, Any]:
    """All runs, one after the other."""
    found: dict[str, Any] = {name: child("run", name) for name in ALONE}
    found["time and memory"] = [child("size", f"{n}") for n in SIZES]
    found["exponent"] = {name: exponent(found["time and memory"], key) for name, key in (
        ("first frame", "first frame, processor s"), ("later frames", "processor ms"))}
    found["foreign"] = [f"{name} on {where}" for name in FOREIGN for where in STRANGE]
    found["in motion"], found["frame by frame"] = [], []
    for name in TEXTURES:
        print(f"  {name}", file=sys.stderr, flush=True)
        of = child("run", name)
        found["in motion"].append(of["motion"])
        found["frame by frame"] += of["frames"]
    return found


if __name__ == "__main__":
    main()
