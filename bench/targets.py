"""What each part is measured against: rows of the measured number, its target, and the paper's or a peer's number.

One function a part, from the JSON object that `python -m bench.<part>` prints to its rows. A row without a target says
so; a target that is not met says MISSED.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from statistics import mean
from typing import Any, NamedTuple

NOT_REPORTED = "not reported"


class Row(NamedTuple):
    """One measured number. `target` None: no target is set, and `met` is None too."""

    what: str
    measured: str
    target: str | None
    met: bool | None
    reference: str  # the paper's number, or the peer's

    @property
    def verdict(self) -> str:
        return "" if self.met is None else verdict(self.met)

    @property
    def cells(self) -> tuple[str, str, str, str, str]:
        """As printed, in the order of `HEADER`."""
        return self.what, self.measured, self.target or "no target", self.verdict, self.reference


HEADER = ("what", "measured", "target", "", "paper or peer")


def verdict(met: bool) -> str:
    return "met" if met else "MISSED"


def at_most(what: str, measured: str, value: float, limit: float, unit: str = "",
            reference: str = NOT_REPORTED) -> Row:
    """A row whose value should not exceed a limit; both in `unit`."""
    return Row(what, measured, f"≤ {limit:g} {unit}".rstrip(), value <= limit, reference)


def at_least(what: str, measured: str, value: float, limit: float, unit: str = "",
             reference: str = NOT_REPORTED) -> Row:
    return Row(what, measured, f"≥ {limit:g} {unit}".rstrip(), value >= limit, reference)


def without_target(what: str, measured: str, reference: str = NOT_REPORTED) -> Row:
    return Row(what, measured, None, None, reference)


def seconds(times: dict[str, float]) -> str:
    return f"{times['wall']:.2f} s ({times['processor']:.2f} s of processor time)"


def synthesis(found: dict[str, Any]) -> Iterable[Row]:
    for search, limit in (("exact", 3.0), ("k-coherence", 1.0)):
        for frame, label in (("first", "first frame"), ("next", "a later frame")):
            times = found[f"{search}, {frame}"]
            yield at_most(f"ma09 2-D, 64² to 256², {search} search: {label}", seconds(times), times["wall"], limit, "s",
                          "60 s on a CPU, 3 to 5 s on a GeForce 8800 GTX")
    peak, rest = found["peak memory MB"], found["of it Python, libraries and PoCL at rest MB"]
    yield at_most("peak memory", f"{peak} MB ({rest} MB of it before any work)", peak, 500, "MB")
    times = found["times faster than the reference"]
    yield at_least("speed-up over NumPy and SciPy", f"{times:.1f} ×", times, 10, "×",
                   f"NumPy and SciPy: {seconds(found['reference'])}")


def search(found: dict[str, Any]) -> Iterable[Row]:
    for dims, times in found.items():
        yield at_most(f"exact search, 65,536 queries on 4,096 points, {dims}",
                      f"{times['ours']:.3f} s, {times['ratio']:.2f} of FAISS's time", times["ratio"], 1.5,
                      "of FAISS's time", f"FAISS flat index: {times['FAISS']:.3f} s")


def density(found: dict[str, Any]) -> Iterable[Row]:
    took, faster = found["seconds a frame"], found["times faster"]
    yield at_most(found["what"], f"{took:.2f} s a frame", took, 1.5, "s")
    yield at_least("speed-up over SciPy's map_coordinates", f"{faster:.1f} ×", faster, 6, "×",
                   f"SciPy: {found['scipy, seconds a frame']:.2f} s a frame")
    took, busy = found["plume"]["seconds a frame"], found["plume"]["processor seconds a frame"]
    yield at_most(found["plume"]["what"], f"{took:.2f} s a frame ({busy:.2f} s of processor time)", took, 0.5, "s")


def repeat(found: dict[str, Any]) -> Iterable[Row]:
    different, runs = found["different results"], found["runs"]
    yield at_most("same bits: 10 runs, 1 and 2 threads, cold and warm kernel cache",
                  f"{different} different result{'s' if different > 1 else ''} in {runs} runs", different, 1)


def solid(found: dict[str, Any]) -> Iterable[Row]:
    for frame, label in (("first", "first frame"), ("next", "a later frame")):
        times = found["256²×64"][frame]
        yield at_most(f"ma09 3-D, 64² on three views to 256²×64, k-coherence: {label}", seconds(times), times["wall"],
                      60, "s", "1 h on a CPU, 4 to 8 min on a GeForce 8800 GTX")
    peak, growth = found["peak memory MB"], found["growth"]
    yield at_most("peak memory", f"{peak} MB", peak, 4000, "MB")
    (first, least), *_, (last, most) = growth["processor s"].items()
    yield at_most(f"exponent of the time in the number of voxels, {first} to {last}",
                  f"{growth['exponent']:.2f} ({least:g} to {most:g} s of processor time)", growth["exponent"], 1.05)


def smoke(found: dict[str, Any]) -> Iterable[Row]:
    march, draft, error = found["march"], found["draft"], "{:.1%} from a path trace of many samples"
    yield at_most(f"{found['what']}, ray marched", seconds(march), march["wall"], 1.5, "s",
                  f"error: {error.format(found['error of the march'])}")
    yield at_most(f"path-traced draft of {found['draft, paths per pixel']} paths per pixel, denoised", seconds(draft),
                  draft["wall"], 15, "s", f"error: {error.format(found['error of the draft'])}; "
                                          f"{found['error of the draft, not denoised']:.1%} without denoising")
    yield without_target("the studio without smoke, once per process", seconds(found["empty studio, once"]), "")
    if "beside Cycles" in found:
        ratio = found["beside Cycles"]["times as efficient as volpath"]
        yield without_target("volpath's time over Cycles' at equal noise", f"{ratio:.2f}", "Blender's Cycles: 1")


def quality(found: dict[str, Any]) -> Iterable[Row]:
    met, every = sum(row["met"] for row in found["quality"]), len(found["quality"])
    yield at_least("first frames with 85 to 115 % of the exemplar's rms, 45 % of its neighbourhoods used and 9 in 10 "
                   "motifs whole", f"{met} of {every}", met, every)


def boundary(found: dict[str, Any]) -> Iterable[Row]:
    rows = found["texture at the boundary"]

    def average(observed: str, key: str) -> float:
        return mean(row[key] for row in rows if row["boundary"] == observed)

    worst = max(row["wall, rms"] for row in rows if row["boundary"] == "observed")
    yield at_most("ma09 figure 7: normal component of H at the wall, over its rms", f"{worst:.2%}", 100 * worst, 2, "%",
                  f"boundary not observed: {average('not', 'wall, rms'):.0%}")
    energy, without = (f"{average(o, 'forward'):.3f}, {average(o, 'backward'):.3f}" for o in ("observed", "not"))
    yield without_target("its texture: forward, backward distance", energy, f"boundary not observed: {without}")
    left = max(row["divergence"] for row in found["projection past a ball"])
    yield at_most("divergence after projection past a ball, over the rms gradient", f"{left:.1e}", left, 1e-4)


def potential(found: dict[str, Any]) -> Iterable[Row]:
    rows = found["motion and potential"]
    largest = {kind: max(row["divergence"] for row in rows if row["synthesized"] == kind)
               for kind in ("motion", "potential")}
    yield at_most("potential synthesized in 2-D: rms divergence over the rms gradient", f"{largest['potential']:.1e}",
                  largest["potential"], 1e-4, reference=f"the motion synthesized: {largest['motion']:.2g}")


def lagrangian(found: dict[str, Any]) -> Iterable[Row]:
    change = {samples: mean(row["change in 4 frames"] for row in found["flicker"] if row["samples"] == samples)
              for samples in ("grid", "lagrangian")}
    yield Row("moving samples: change of the detail in 4 frames of a steady flow, over its rms",
              f"{change['lagrangian']:.1%}", "≤ that on a grid", change["lagrangian"] <= change["grid"],
              f"on a grid: {change['grid']:.1%}")


def elements(found: dict[str, Any]) -> Iterable[Row]:
    for (name, times), (limit, memory) in zip(found["cases"].items(), ((60, 2000), (300, None), (300, None)),
                                              strict=True):
        yield at_most(f"ma13, {name}, to convergence", f"{seconds(times)}, {times['iterations']} iterations",
                      times["wall"], limit, "s")
        peak, what = times["peak memory MB"], f"{name}: peak memory"
        yield at_most(what, f"{peak} MB", peak, memory, "MB") if memory else without_target(what, f"{peak} MB")
    exponent = found["growth"]["exponent"]
    yield at_most("exponent of an iteration's time in the number of elements, 500 to 8,000", f"{exponent:.2f}",
                  exponent, 1.1)
    faster = found["times faster than the reference"]
    yield at_least("exhaustive search, speed-up over NumPy and SciPy",
                   f"{faster['wall']:.0f} × ({faster['processor']:.0f} × by processor time)", faster["wall"], 20, "×")
    basic, smooth, weighted = found["jitter"].values()
    yield at_most("squared jitter over that of the basic synthesis (§4.1), with motion weighted",
                  f"{weighted / basic:.4f}", weighted / basic, 0.5,
                  reference=f"as the paper says (§4.2): {smooth / basic:.2f}")
    worst, where = max((row[key], f"{row['exemplar']}, {key}") for row in found["exemplars in their own domains"]
                       for key in ("pair correlation", "motion spectrum", "nearest distance"))
    yield at_most("an exemplar in its own domain, worst of three statistics", f"{worst:.1%} off ({where})", 100 * worst,
                  10, "%")


def fidelity(found: dict[str, Any]) -> Iterable[Row]:
    rows = found["fidelity of scenes"]
    for key in ("pair correlation", "motion spectrum", "nearest distance"):
        worst, where = max((row[key], f"{row['scene']} {row['variant']}") for row in rows if row[key] is not None)
        yield without_target(f"{key}, worst of all scenes", f"{worst:.1%} off ({where})", "the exemplar's own")


def texture(found: dict[str, Any]) -> Iterable[Row]:
    foreign = set(found["foreign"])
    for name, ours in (("figures", lambda row: row["texture"] not in foreign),
                       ("foreign textures", lambda row: row["texture"] in foreign)):
        motion, frames = ([row for row in found[table] if row["method"] == "carry" and ours(row)]
                          for table in ("in motion", "frame by frame"))
        yield from _look(f"wang05, {name}", frames, motion)
    carried, by_paper = ({row["texture"]: row for row in found["in motion"] if row["method"] == method}
                         for method in ("carry", "paper"))
    turn = found["floor"]
    for name, median, most, reference in (
            ("canes on circles", 0.06, 0.10, f"{turn['residual_50']:.3f}, {turn['residual_95']:.3f} of canes that turn "
                                             "as one"),
            ("straw on vortices", 0.13, 0.30, "")):
        for key, limit in (("residual 50 %", median), ("residual 95 %", most)):
            by = f"the paper's method: {by_paper[name][key]:.3f}"
            yield at_most(f"{name}: residual against the flow, {key.removeprefix('residual ')} of blocks",
                          f"{carried[name][key]:.3f}", carried[name][key], limit,
                          reference="; ".join(filter(None, (by, reference))))
    for name, least in (("canes on circles", 0.99), ("straw on vortices", 0.78)):
        yield at_least(f"{name}: correlation over 10 frames", f"{carried[name]['corr10']:.3f}", carried[name]["corr10"],
                       least, reference=f"the paper's method: {by_paper[name]['corr10']:.3f}")
    fwd = {row["method"]: row["fwd"] for row in found["frame by frame"]
           if row["texture"] == "brick on waves" and row["frame"] == 100}
    yield at_most("brick: forward distance at frame 100", f"{fwd['carry']:.3f}", fwd["carry"], 0.25,
                  reference=f"the paper's method: {fwd['paper']:.3f}")
    yield from _texture_times(found, by_paper)


def loops(found: dict[str, Any]) -> Iterable[Row]:
    rows = found["loops"]

    def worst(what: str, key: str, low: float, high: float, target: str) -> Row:
        row = max(rows, key=lambda row: max(low - row[key], row[key] - high))
        good = sum(low <= row[key] <= high for row in rows)
        return Row(f"wang05, loops of {found['period']} frames: {what}",
                   f"worst {row[key]:.3f} ({row['texture']}); {good} of {len(rows)} within", target,
                   low <= row[key] <= high, NOT_REPORTED)

    yield worst("last to first over the median of frame differences", "last to first", 0, 1.05, "≤ 1.05")
    for key, name in (("std", "contrast"), ("grad", "gradient")):
        yield worst(f"least {name} over the sample's", f"{key}, min", 0.85, 1.10, "0.85 to 1.10")
        yield worst(f"largest {name} over the sample's", f"{key}, max", 0.85, 1.10, "0.85 to 1.10")
    yield worst("histogram error", "hist, max", 0, 0.10, "≤ 0.10")


def _look(whose: str, frames: list[dict[str, Any]], motion: list[dict[str, Any]]) -> Iterable[Row]:
    """What is asked of all textures alike: the worst of them against its target, and how many meet it."""
    for rows, what, keys, low, high, unit, shown in (
            (frames, "contrast and gradient over the sample's", ("std", "grad"), 0.85, 1.10, "", "{:.2f}"),
            (frames, "histogram error", ("hist",), None, 0.10, "", "{:.2f}"),
            (motion, "synthesised anew in a frame", ("synthesised anew, %",), None, 2, " %", "{:.2g}"),
            (motion, "worst block", ("worst block",), None, 0.8, "", "{:.2f}"),
            (motion, "drift of the backward distance", ("drift of bwd",), None, 0.02, "", "{:.3f}"),
            (motion, "drift of the share that is used", ("drift of used",), None, 0.04, "", "{:.3f}")):
        yield _worst(f"{whose}: {what}", rows, "texture", keys, low, high, unit, shown.format)


def _worst(what: str, rows: list[dict[str, Any]], subject: str, keys: tuple[str, ...], low: float | None, high: float,
           unit: str, shown: Callable[[float], str], reference: str = NOT_REPORTED) -> Row:
    """The row that is furthest from where it should be, named by its `subject`, and how many subjects are there. What
    is no number is furthest of all."""
    least = -math.inf if low is None else low
    values = [(math.nan if row[key] is None else row[key], key, row) for row in rows for key in keys]
    value, key, row = max(values, key=lambda v: (math.isnan(v[0]), max(least - v[0], v[0] - high)))
    names = {r[subject] for r in rows}
    good = len(names - {r[subject] for v, _, r in values if not least <= v <= high})
    where = f"{row[subject]}, frame {row['frame']}" if "frame" in row else row[subject]
    of = f"{key}, {where}" if len(keys) > 1 else where
    target = f"≤ {shown(high)}{unit}" if low is None else f"{shown(low)} to {shown(high)}{unit}"
    return Row(what, f"worst {shown(value)}{unit} ({of}); {good} of {len(names)} within", target,
               least <= value <= high, reference)


def _texture_times(found: dict[str, Any], by_paper: dict[str, dict[str, Any]]) -> Iterable[Row]:
    sizes = {row["size"]: row for row in found["time and memory"]}
    row, peer, small = sizes["512²"], found["beside rlic"], found["against the reference"]
    yield at_most("512² from 128², a frame",
                  f"{row['wall ms']:.0f} ms ({row['processor ms']:.0f} ms of processor time)", row["wall ms"], 33, "ms",
                  "the paper: 120 s")
    first = {"wall": row["first frame, wall s"], "processor": row["first frame, processor s"]}
    yield at_most("512² from 128², first frame", seconds(first), first["wall"], 0.5, "s", "the paper: 120 s")
    name, slowest = max(by_paper.items(), key=lambda entry: entry[1]["wall ms"])
    yield at_most("512² from 128², a frame by the paper's method", f"{slowest['wall ms'] / 1000:.2f} s "
                  f"({slowest['processor ms'] / 1000:.2f} s of processor time; {name})", slowest["wall ms"] / 1000, 1,
                  "s", "the paper: 120 s")
    for what, value in found["exponent"].items():
        yield at_most(f"exponent of the processor time in the number of pixels, 256² to 2048², {what}", f"{value:.2f}",
                      value, 1.05)
    ratio = peer["ratio"]
    yield at_most("512², a frame over rlic's of 41 taps", f"{ratio['wall']:.2f} ({ratio['processor']:.2f} by processor "
                  "time)", ratio["wall"], 1, reference=f"rlic: {seconds(peer['rlic'])}")
    peak = sizes["1024²"]["peak memory MB"]
    yield at_most("peak memory at 1024²", f"{peak} MB", peak, 500, "MB")
    yield without_target(f"drawing at {small['size']}, speed-up over NumPy",
                         f"{small['reference']['wall'] / small['ours']['wall']:.0f} ×",
                         f"NumPy: {seconds(small['reference'])}; largest difference {small['largest difference']:g}")


TELLING = ("fall", "fall over ledges", "fire", "smoke")
"""Targets that tell which way they move: water falls, flames and smoke rise. A still river may flow either way."""


def photo(found: dict[str, Any]) -> Iterable[Row]:
    yield from _photo_look(found["look"])
    yield from _photo_masks(found["look"])
    yield from _photo_ways(found["look"])
    for strokes, limit in (("without", 20), ("with", 15)):
        rows = [row for row in found["truth"]
                if row["strokes"] == strokes and (strokes == "with" or row["target"] in TELLING)]
        what = f"a frame of a clip that the database has not, {strokes} strokes"
        own = _average(rows, "angle of the clip's own flow")
        yield _worst(f"{what}: angle to its true velocity", rows, "target", ("angle",), None, limit, "°",
                     "{:.0f}".format, f"optical flow of the clips themselves: {own:.0f}° on average")
        yield _worst(f"{what}: distance of log power spectra", rows, "target", ("spectrum",), None, 0.3, "",
                     "{:.2f}".format)
    for row in found["minimizers"]:
        others = ", ".join(f"{name} {row[name]:g}" for name in ("α-expansion", "ICM", "data term alone"))
        yield Row(f"{row['target']}, {row['nodes']} nodes: energy by TRW-S", f"{row['TRW-S']:g}",
                  "≤ that by α-expansion", row["TRW-S"] <= row["α-expansion"], others)
    yield from _photo_times(found)
    different, runs = found["bits"]["different results"], found["bits"]["runs"]
    yield at_most("same bits from clips to frames: again, 1 and 2 threads, cold and warm kernel cache",
                  f"{different} different result{'s' if different > 1 else ''} in {runs} runs", different, 1)


def _photo_look(rows: list[dict[str, Any]]) -> Iterable[Row]:
    """The look, the direction, the pieces and the loop of all targets."""
    for what, keys, low, high, unit, shown in (
            ("mean frame and target, blurred by 8 pixels, of 255", ("low-pass",), None, 5, "", "{:.1f}"),
            ("contrast of bands over the target's", ("1 px", "2 px", "4 px"), 0.85, 1.15, "", "{:.2f}"),
            ("angle of the flow seen in the frames to the strokes", ("angle to strokes",), None, 15, "°", "{:.0f}"),
            ("deviation between pieces over that at their centres", ("deviation",), 0.9, 1.1, "", "{:.2f}"),
            ("gradient on the lines of pieces over that elsewhere", ("gradient",), 0.9, 1.1, "", "{:.2f}"),
            ("correlation of gradients where the picture stands still", ("edges",), 0.9, 1, "", "{:.2f}"),
            ("last to first over the median of frame differences", ("loop",), None, 1.2, "", "{:.2f}")):
        ours, theirs = ([row for row in rows if row["way"] == way and (keys != ("edges",) or row["edges"] is not None)]
                        for way in ("ours", "the clip itself"))
        values = [row[key] for row in theirs for key in keys if row[key] is not None]
        yield _worst(f"okabe11: {what}", ours, "target", keys, low, high, unit, shown.format,
                     f"clips themselves: {shown.format(min(values))} to {shown.format(max(values))}{unit}")


def _photo_masks(rows: list[dict[str, Any]]) -> Iterable[Row]:
    """What stands still in pictures whose freeze mask the user did not draw."""
    unmasked = [row for row in rows if row["edges, no mask"] is not None]
    least = min(unmasked, key=lambda row: row["edges, no mask"])
    yield without_target("okabe11: the same correlation where no freeze mask is given",
                         f"worst {least['edges, no mask']:.2f} ({least['target']}), mean of {len(unmasked)} targets "
                         f"{_average(unmasked, 'edges, no mask'):.2f}")


def _photo_ways(rows: list[dict[str, Any]]) -> Iterable[Row]:
    """The numbers of other ways beside ours, averages over the targets that both are measured on."""
    keys = (("low-pass", "low-pass {:.1f}"), ("1 px", "contrast {:.2f}"), ("2 px", "{:.2f}"), ("4 px", "{:.2f}"),
            ("angle to strokes", "angle {:.0f}°"), ("deviation", "deviation {:.2f}"), ("gradient", "gradient {:.2f}"),
            ("loop", "loop {:.2f}"))
    for way in dict.fromkeys(row["way"] for row in rows if row["way"] != "ours"):
        targets = [row["target"] for row in rows if row["way"] == way]
        theirs, ours = (", ".join(shown.format(_average(
            [row for row in rows if row["way"] == one and row["target"] in targets], key)) for key, shown in keys)
            for one in (way, "ours"))
        yield without_target(f"okabe11: {way}, mean of {len(targets)} targets", theirs, f"ours: {ours}")


def _average(rows: list[dict[str, Any]], key: str) -> float:
    """Of the numbers there are; nan if there are none."""
    values = [row[key] for row in rows if row[key] is not None]
    return mean(values) if values else math.nan


def _photo_times(found: dict[str, Any]) -> Iterable[Row]:
    times, files, analysed = found["times"], found["product"], found["analysis"]
    whole = times["all, s"]
    what = f"{times['size']}, fluid all over, {times['clips']} clips, {times['frames']} frames"
    yield at_most(f"{what}: assignment, integration and composition",
                  f"{whole:.1f} s (assignment {times['assignment, s']:.1f}, integration "
                  f"{times['integration, s']:.1f}, composition {times['composition, s']:.1f})", whole, 36, "s",
                  "the paper: 1 hour")
    yield at_most("of it the assignment", f"{times['assignment, s']:.1f} s", times["assignment, s"], 15, "s")
    yield at_most("peak memory", f"{times['peak memory MB']} MB", times["peak memory MB"], 3000, "MB")
    yield without_target(f"flowloom synth on the stream, {files['width']} pixels wide, with its files", seconds(files))
    minutes = analysed["wall"] / analysed["clips"] * 150 / 60
    yield at_most("analysis of 150 clips of the database's size",
                  f"{minutes:.1f} min ({analysed['clips']} of {analysed['of']} clips, {analysed['wall']:.0f} s, at "
                  "that rate)", minutes, 10, "min")


ROWS: dict[str, Callable[[dict[str, Any]], Iterable[Row]]] = {
    "synthesis": synthesis, "search": search, "density": density, "repeat": repeat, "solid": solid, "smoke": smoke,
    "quality": quality, "boundary": boundary, "potential": potential, "lagrangian": lagrangian, "elements": elements,
    "fidelity": fidelity, "texture": texture, "loops": loops, "photo": photo}
