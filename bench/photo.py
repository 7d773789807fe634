"""Photographs that flow (okabe11): look, motion and loop of targets the method was not tuned on, clips whose truth is
known, the paper's choices and minimizers beside ours, time, memory, the same bits.

`python -m bench.photo` prints one JSON object; `python -m bench.photo small` the same of a small database, small
pictures. The database is that of a scene, and kept in out/shared as those of all scenes are.
"""

from __future__ import annotations

import functools
import hashlib
import json
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from bench import fluid, subjects
from bench.machine import peak_memory
from bench.repeat import elsewhere
from bench.subjects import Subject
from bench.synthesis import timed
from pipeline import stages
from pipeline.build.graph import BuildGraph
from pipeline.files import atomic, pictures
from pipeline.photo.clips import SAMPLED, names
from pipeline.progress import Progress
from pipeline.scene import load
from synth.photo.animate import Look, Target, composed, motion, over_background
from synth.photo.assign import ANGLES, Assigned, Database, Nodes, Settings, Shown, assign
from synth.photo.clips import clip
from synth.photo.fit import fitted
from synth.photo.index import Index, exposures, index
from synth.photo.integrate import Blending, Differences, Frames, differences
from synth.photo.pieces import Cut
from synth.photo.words import codebook, descriptors

FRAMES, SEED, CUT = 96, 1, Cut()
OUT = Path("out")
MOMENTS = 8  # how manieth frames' contrast is measured
ANALYSED = 5  # how manieth clips are analysed again to time it


class Scale(NamedTuple):
    """Clips of the database and their size, of which size the held-out clips are; the width of the photograph; the
    size of the picture that is timed. Width and height."""

    clips: int
    size: tuple[int, int]
    photograph: int
    timed: tuple[int, int]


SCALES = {"full": Scale(150, (320, 240), 640, (640, 480)), "small": Scale(16, (160, 120), 320, (320, 240))}


class Variant(NamedTuple):
    """A way to assign pieces, one to compose frames, and one to blend pieces."""

    settings: Settings
    look: Look
    blending: Blending = "roots"


OURS = "ours"
ITSELF = "the clip itself"
"""The frames that the target is one of: what the measures say of a fluid without fault."""
VARIANTS = {
    OURS: Variant(Settings(), Look()),
    "ours, differences alone": Variant(Settings(), Look(carried=0)),
    "ours, histograms": Variant(Settings(), Look(matching="histograms")),
    "the paper to the letter": Variant(
        Settings(sigma=100, rho=10000, weight=0.01, minimizer="expansion", energy="printed"),
        Look(carried=0, matching="regions"), "shares"),
}
"""Ours is measured on all targets, the others on those of COMPARED. Another one is one line here."""
PHOTOGRAPH = "stream"
COMPARED = (PHOTOGRAPH, "fall", "river", "smoke")
MINIMIZED = (PHOTOGRAPH, "fall", "clouds")
MINIMIZERS = {"data": "data term alone", "expansion": "α-expansion", "modes": "ICM", "messages": "TRW-S"}
SCENE = """\
title = "The database of the bench"
frames = {frames}
seed = {seed}
[photo]
file = "assets/stream/image.jpg"
matte = "assets/stream/mask.png"
strokes = [[[490, 28], [487, 64]], [[265, 348], [325, 378]]]
width = {width}
[clips]
count = {count}
size = [{columns}, {rows}]
length = {frames}
"""


class Stock(NamedTuple):
    """A database, and of each of its clips the frames."""

    database: Database
    frames: Frames
    clips: int


def made(scale: Scale) -> BuildGraph:
    """The scene whose database is the bench's, with its frames made."""
    file = OUT / "bench" / f"okabe11-bench-{scale.clips}.toml"
    file.parent.mkdir(parents=True, exist_ok=True)
    atomic.write_text(file, SCENE.format(frames=FRAMES, seed=SEED, width=scale.photograph, count=scale.clips,
                                         columns=scale.size[0], rows=scale.size[1]))
    return stages.run("synth", load(file), OUT, Progress(quiet=True))


def stock(scale: Scale) -> Stock:
    """The database, read from where `made` keeps it."""
    graph = made(scale)
    scene = graph.variants[""]
    clips = names(scene, "clip")
    found = Database.joined([Index(**graph.read("", name, 0)) for name in names(scene, "index")],
                            graph.read("", "codebook", 0)["words"])
    return Stock(found, functools.cache(lambda number: graph.read("", clips[number], 0)["luma"]), len(clips))


class Animated(NamedTuple):
    """frames (T, Y, X) float32 grey; the wall seconds of each step."""

    of: Nodes
    assigned: Assigned
    frames: np.ndarray
    seconds: dict[str, float]


def animated(target: Target, of_clips: Stock, variant: Variant) -> Animated:
    """The whole method on one target."""
    (of, found, shown), assigning = timed(lambda: _assigned(target, of_clips, variant.settings))
    more, integrating = timed(lambda: differences(of, shown, of_clips.frames, target.matte.shape, CUT, FRAMES, SEED,
                                                  variant.blending))
    moves = motion(target, of, shown, CUT)
    frames, composing = timed(lambda: _composed(target, more, moves, variant.look))
    return Animated(of, found, frames, {"assignment": assigning["wall"], "integration": integrating["wall"],
                                        "composition": composing["wall"]})


def _composed(target: Target, more: Differences, moves: np.ndarray, look: Look) -> np.ndarray:
    shown_at = composed(target, more, moves, look, SEED)
    return np.stack([over_background(target, shown_at(frame), target.matte).mean(axis=2) for frame in range(FRAMES)])


def _assigned(target: Target, of_clips: Stock, settings: Settings) -> tuple[Nodes, Assigned, Shown]:
    """The pieces, fitted to the target as a scene's are."""
    of, found = assign(target.grey, target.fluid, of_clips.database, CUT, target.wanted, settings)
    shown = found.shown(of_clips.database)
    if settings.energy == "mended":
        shown = fitted(target.grey, of, shown, found.exposure, of_clips.frames, CUT)
    return of, found, shown


def rounded(value: float) -> float | None:
    """For a table: a number that there is not is None."""
    return None if np.isnan(value) else round(float(value), 3)


def look(name: str, way: str, subject: Subject, frames: np.ndarray) -> dict[str, Any]:
    """Look, direction, pieces and loop of frames (T, Y, X), beside their target."""
    target = subject.target
    grey, matte = target.picture.mean(axis=2), target.fluid
    lattice = fluid.lattice(frames, matte, CUT.stride)
    return {"target": name, "way": way, "low-pass": rounded(fluid.low_pass(frames, grey, matte)),
            **{f"{sigma:g} px": rounded(value) for sigma, value in zip(
                fluid.SIGMAS, fluid.contrast(frames[::MOMENTS], grey, matte), strict=True)},
            "angle to strokes": rounded(fluid.angle(fluid.mean_flow(frames), subject.orientation,
                                                    matte * fluid.visible(grey, matte))),
            "deviation": rounded(lattice.deviation), "gradient": rounded(lattice.gradient),
            "edges": None if target.frozen is None else rounded(fluid.edges(frames, grey, target.frozen)),
            "loop": rounded(fluid.loop(frames, matte))}


def truth(name: str, strokes: str, subject: Subject, frames: np.ndarray) -> dict[str, Any]:
    """Motion and temporal spectrum of frames (T, Y, X) beside those of the clip that their target is a frame of."""
    assert subject.truth is not None, "truth is of clips"
    grey, matte = subject.target.picture.mean(axis=2), subject.target.fluid
    where = subject.flows & fluid.visible(grey, matte)
    spectrum = fluid.spectrum(subject.frames, matte)
    return {"target": name, "strokes": strokes,
            "angle": rounded(fluid.angle(fluid.mean_flow(frames), subject.truth.velocity, where)),
            "angle of the clip's own flow": rounded(fluid.angle(fluid.mean_flow(subject.frames),
                                                                subject.truth.velocity, where)),
            "spectrum": rounded(fluid.spectrum_distance(fluid.spectrum(frames, matte), spectrum))}


def minimized(name: str, subject: Subject, of_clips: Stock) -> dict[str, Any]:
    """The energy that each minimizer leaves of one and the same."""
    target, found = subject.guided, {}
    for minimizer, title in MINIMIZERS.items():
        (of, assigned), took = timed(lambda by=minimizer: assign(target.grey, target.fluid, of_clips.database, CUT,
                                                                 target.wanted, Settings(minimizer=by)))
        found[title] = round(assigned.energies[1], 2)
        found[f"{title}, s"] = round(took["wall"], 1)
    return {"target": name, "nodes": len(of.corner), **{key: found[key] for key in sorted(found, key=_seconds_last)}}


def _seconds_last(key: str) -> tuple[bool, int]:
    title = key.removesuffix(", s")
    return title != key, list(MINIMIZERS.values()).index(title)


def pictures_of(scale: Scale) -> dict[str, Any]:
    """All targets: look with strokes, truth without and with them; the minimizers on some."""
    of_clips = stock(scale)
    looks, truths, energies = [], [], []
    for name in (PHOTOGRAPH, *subjects.CLIPS):
        print(f"  {name}", file=sys.stderr, flush=True)
        subject = subjects.photograph(scale.photograph) if name == PHOTOGRAPH else subjects.of_clip(
            name, FRAMES, scale.size)
        for variant in VARIANTS if name in COMPARED else (OURS,):
            found = animated(subject.guided, of_clips, VARIANTS[variant])
            looks.append(look(name, variant, subject, found.frames) | {
                "edges, no mask": None, "nodes": len(found.of.corner),
                "nodes widened": int((found.assigned.angle > ANGLES[0]).sum())})
            if subject.target.frozen is not None and variant == OURS:
                unmasked = animated(replace(subject.guided, frozen=None), of_clips, VARIANTS[OURS])
                looks[-1]["edges, no mask"] = rounded(fluid.edges(
                    unmasked.frames, subject.target.picture.mean(axis=2), subject.target.frozen))
            if subject.truth is not None and variant == OURS:
                alone = animated(subject.target, of_clips, VARIANTS[OURS])
                truths += [truth(name, strokes, subject, frames) for strokes, frames in (
                    ("without", alone.frames), ("with", found.frames))]
        if subject.truth is not None:
            looks.append(look(name, ITSELF, subject, subject.frames) | {
                "edges, no mask": None, "nodes": None, "nodes widened": None})
        if name in MINIMIZED:
            energies.append(minimized(name, subject, of_clips))
    return {"pieces": len(of_clips.database.clip), "look": looks, "truth": truths, "minimizers": energies}


def times(scale: Scale) -> dict[str, Any]:
    """Seconds and memory of a picture that is fluid all over, and of the product on the photograph, files included."""
    width, height = scale.timed
    subject = subjects.photograph(scale.photograph)
    picture = np.clip(pictures.resized(subject.target.picture, width, height), 0, 1)
    along = pictures.resized(np.pad(subject.orientation, ((0, 0), (0, 0), (0, 1))), width, height)[..., :2]
    along /= np.maximum(np.hypot(along[..., 0], along[..., 1]), 1e-6)[..., None]
    whole = Subject(Target(picture, np.ones((height, width), np.float32)), along)
    of_clips = stock(scale)
    for number in range(of_clips.clips):
        of_clips.frames(number)
    found = animated(whole.guided, of_clips, VARIANTS[OURS])
    return {"size": f"{width} × {height}", "frames": FRAMES, "clips": of_clips.clips, "nodes": len(found.of.corner),
            **{f"{step}, s": round(took, 2) for step, took in found.seconds.items()},
            "all, s": round(sum(found.seconds.values()), 2), "peak memory MB": round(peak_memory())}


def product(scale: Scale) -> dict[str, Any]:
    """Seconds of `flowloom synth` on the photograph, its database made before: files read, written and read back."""
    graph = made(scale)
    shutil.rmtree(graph.root)
    _, took = timed(lambda: made(scale))
    return {"width": scale.photograph, **{key: round(value, 1) for key, value in took.items()}}


def analysis(scale: Scale) -> dict[str, Any]:
    """Seconds to analyse one in ANALYSED of the clips anew: their words and their pieces, in memory."""
    of_clips = stock(scale)
    clips = [of_clips.frames(number) for number in range(0, of_clips.clips, ANALYSED)]

    def analysed() -> None:
        found = np.concatenate([descriptors(picture, CUT.step).reshape(-1, 128)[::SAMPLED]
                                for frames in clips for picture in exposures(frames)])
        words = codebook(found)
        for frames in clips:
            index(frames, words, CUT)

    _, took = timed(analysed)
    return {"clips": len(clips), "of": of_clips.clips, **{key: round(value, 1) for key, value in took.items()},
            "peak memory MB": round(peak_memory())}


def digest() -> str:
    """SHA-256 of three clips, their codebook and index, an assignment by each minimizer, and its frames."""
    found = hashlib.sha256()
    clips = [clip(family, 5, 16, (128, 96)) for family in ("fall", "white-water", "river")]
    words = codebook(np.concatenate([descriptors(picture, CUT.step).reshape(-1, 128)
                                     for one in clips for picture in exposures(one.luma)]))
    indices = [index(one.luma, words, CUT, one.velocity) for one in clips]
    database = Database.joined(indices, words)
    target = subjects.photograph(128).guided
    parts = [words, *(array for one in (*clips, *indices) for array in vars(one).values() if array is not None)]
    for minimizer in MINIMIZERS:
        ours = VARIANTS[OURS]._replace(settings=Settings(minimizer=minimizer))
        of = animated(target, Stock(database, lambda number: clips[number].luma, len(clips)), ours)
        parts += [of.assigned.piece, of.frames]
    for part in parts:
        found.update(np.ascontiguousarray(part).tobytes())
    return found.hexdigest()


def bits(scale: Scale) -> dict[str, Any]:
    """How many results there are of equal runs: again, at 1 and 2 threads, with a cold and a warm kernel cache."""
    found = [digest() for _ in range(2)]
    for threads in (1, 2):
        with tempfile.TemporaryDirectory() as cache:
            found += [elsewhere(threads, cache, "bench.photo") for _ in range(2)]
    return {"runs": len(found), "different results": len(set(found))}


PROCESSES: dict[str, Callable[[Scale], dict[str, Any]]] = {
    "pictures": pictures_of, "times": times, "product": product, "analysis": analysis, "bits": bits}
"""Each in a process of its own, so that its memory is its own."""


def child(which: str, scale: str) -> dict[str, Any]:
    """What one of PROCESSES prints."""
    printed = subprocess.run([sys.executable, "-m", "bench.photo", scale, which], stdout=subprocess.PIPE, text=True,
                             check=True)
    found: dict[str, Any] = json.loads(printed.stdout)
    return found


def main() -> None:
    match sys.argv[1:]:
        case ["digest"]:
            print(digest())
        case [scale, which]:
            print(json.dumps(PROCESSES[which](SCALES[scale])))
        case [] | [_]:
            scale = (sys.argv[1:] or ["full"])[0]
            made(SCALES[scale])
            found = {which: child(which, scale) for which in PROCESSES}
            of = SCALES[scale]
            print(json.dumps({"database": {"clips": of.clips, "size": f"{of.size[0]} × {of.size[1]}", "frames": FRAMES},
                              **found.pop("pictures"), **found}, indent=1, ensure_ascii=False))


if __name__ == "__main__":
    main()
