"""The rows of every part, from JSON objects of the shape that the part prints."""

from typing import Any

import pytest

from bench import results, targets

TIMES = {"wall": 0.5, "processor": 0.9}
LIKE = {"std": 0.98, "grad": 0.95, "hist": 0.04, "fwd": 0.22}
MOVING = {"residual 50 %": 0.05, "residual 95 %": 0.09, "worst block": 0.5, "corr10": 0.995, "synthesised anew, %": 0.6,
          "drift of bwd": 0.01, "drift of used": 0.02, "wall ms": 20, "processor ms": 15}
TEXTURES = ("canes on circles", "straw on vortices", "brick on waves")
LOOP = {"last to first": 0.99, "std, min": 0.97, "std, max": 1.01, "grad, min": 0.9, "grad, max": 0.99,
        "hist, max": 0.05}
SECONDS = {"first frame, wall s": 0.4, "first frame, processor s": 0.3, "wall ms": 20, "processor ms": 15}
FLOWING = {"way": "ours", "nodes": 48, "low-pass": 3.1, "1 px": 0.92, "2 px": 1.01, "4 px": 0.97,
           "angle to strokes": 9.0, "deviation": 1.04, "gradient": 0.97, "edges": None,
           "edges, no mask": None, "loop": 1.05}
TRUE = {"angle": 12.0, "angle of the clip's own flow": 7.0, "spectrum": 0.2}
ENERGIES = {"data term alone": 115.2, "α-expansion": 100.4, "ICM": 98.7, "TRW-S": 95.7}
DISTANCES = {"pair correlation": 0.05, "motion spectrum": None, "nearest distance": 0.02}
FOUND: dict[str, dict[str, Any]] = {
    "synthesis": {f"{search}, {frame}": TIMES for search in ("exact", "k-coherence") for frame in ("first", "next")} | {
        "machine": {}, "reference": TIMES, "times faster than the reference": 13.1, "peak memory MB": 452,
        "of it Python, libraries and PoCL at rest MB": 165},
    "search": {"32 dimensions": {"ours": 0.09, "FAISS": 0.11, "ratio": 0.82, "same match": 1.0}},
    "density": {"what": "density window", "seconds a frame": 0.39, "times faster": 8.2, "scipy, seconds a frame": 3.2,
                "plume": {"what": "plume", "seconds a frame": 0.25, "processor seconds a frame": 0.4}},
    "repeat": {"runs": 14, "different results": 1, "digests": {}},
    "solid": {"256²×64": {"first": TIMES, "next": TIMES}, "peak memory MB": 2000,
              "growth": {"processor s": {"64³": 2.9, "128³": 17.0, "256³": 133.0}, "exponent": 0.92},
              "quality in three dimensions": [{"exemplar": "heart"}]},
    "smoke": {"what": "smoke", "march": TIMES, "draft": TIMES, "draft, paths per pixel": 2, "empty studio, once": TIMES,
              "error of the march": 0.087, "error of the draft": 0.096, "error of the draft, not denoised": 0.88,
              "beside Cycles": {"times as efficient as volpath": 1.7}},
    "quality": {"quality": [{"met": True}, {"met": True}], "helped": []},
    "boundary": {"texture at the boundary": [
        {"boundary": "observed", "wall, rms": 0.002, "forward": 0.2, "backward": 0.1},
        {"boundary": "not", "wall, rms": 0.41, "forward": 0.2, "backward": 0.1}],
        "projection past a ball": [{"divergence": 3.9e-5}]},
    "potential": {"motion and potential": [{"synthesized": "motion", "divergence": 0.12},
                                           {"synthesized": "potential", "divergence": 2.7e-7}]},
    "lagrangian": {"flicker": [{"samples": "grid", "change in 4 frames": 0.043},
                               {"samples": "lagrangian", "change in 4 frames": 0.032}]},
    "elements": {"cases": {name: TIMES | {"iterations": 9, "peak memory MB": 340} for name in ("points", "threads",
                                                                                               "sheets")},
                 "growth": {"exponent": 0.95}, "times faster than the reference": {"wall": 212.0, "processor": 190.0},
                 "jitter": {"basic": 9.3e-3, "smooth": 4.9e-3, "weighted": 4.7e-5},
                 "exemplars in their own domains": [{"exemplar": "school", **DISTANCES, "motion spectrum": 0.03}]},
    "fidelity": {"fidelity of scenes": [
        {"scene": "ma13-fig05", "variant": "pure", **DISTANCES, "motion spectrum": 0.07},
        {"scene": "ma13-fig10", "variant": "jagged", **DISTANCES}]},
    "texture": {"foreign": ["rings on a spiral"], "floor": {"residual_50": 0.04, "residual_95": 0.067},
                "frame by frame": [{"texture": name, "method": method, "frame": frame, **LIKE}
                                   for name in (*TEXTURES, "rings on a spiral") for method in ("carry", "paper")
                                   for frame in (1, 100)],
                "in motion": [{"texture": name, "method": "carry", **MOVING}
                              for name in (*TEXTURES, "rings on a spiral")] + [
                    {"texture": name, "method": "paper", **MOVING, "worst block": 1.4, "wall ms": 700}
                    for name in TEXTURES],
                "time and memory": [{"size": "512²", **SECONDS, "peak memory MB": 210},
                                    {"size": "1024²", **SECONDS, "peak memory MB": 400}],
                "exponent": {"first frame": 1.02, "later frames": 0.97},
                "beside rlic": {"ours": TIMES, "rlic": TIMES, "ratio": {"wall": 0.4, "processor": 0.3}},
                "against the reference": {"size": "256²", "ours": TIMES, "reference": TIMES,
                                          "largest difference": 0.0}},
    "loops": {"period": 120, "loops": [{"texture": name, **LOOP} for name in TEXTURES]},
    "photo": {"look": [{"target": "stream", **FLOWING},
                       {"target": "river", **FLOWING, "edges": 0.97, "edges, no mask": 0.8},
                       {"target": "river", **FLOWING, "way": "the clip itself", "edges": 0.99},
                       {"target": "stream", **FLOWING, "way": "differences alone", "low-pass": 9.0, "loop": None}],
              "truth": [{"target": "fall", "strokes": "without", **TRUE}, {"target": "fall", "strokes": "with", **TRUE},
                        {"target": "river", "strokes": "without", **TRUE, "angle": 175.0}],
              "minimizers": [{"target": "stream", "nodes": 76, **ENERGIES}],
              "times": {"size": "640 × 480", "clips": 150, "frames": 96, "assignment, s": 8.0, "integration, s": 9.0,
                        "composition, s": 7.0, "all, s": 24.0, "peak memory MB": 2100},
              "product": {"width": 640, **TIMES}, "analysis": {"clips": 30, "of": 150, **TIMES},
              "bits": {"runs": 6, "different results": 1}},
}


def test_every_part_has_its_title_and_its_rows() -> None:
    assert tuple(targets.ROWS) == results.PARTS == tuple(FOUND)


@pytest.mark.parametrize("part", results.PARTS)
def test_rows_of_good_numbers_miss_no_target(part: str) -> None:
    rows = list(targets.ROWS[part](FOUND[part]))
    assert rows
    assert all(row.what and row.measured and row.met is not False for row in rows)
    assert all((row.target is None) == (row.met is None) for row in rows)


@pytest.mark.parametrize(("part", "key", "value", "missed"), [
    ("repeat", "different results", 2, "2 different results in 14 runs"),
    ("solid", "peak memory MB", 4001, "4001 MB"),
    ("density", "times faster", 5.9, "5.9 ×"),
    ("quality", "quality", [{"met": True}, {"met": False}], "1 of 2"),
    ("lagrangian", "flicker", [{"samples": "grid", "change in 4 frames": 0.01},
                               {"samples": "lagrangian", "change in 4 frames": 0.02}], "2.0%")])
def test_a_worse_number_misses_its_target(part: str, key: str, value: Any, missed: str) -> None:
    rows = list(targets.ROWS[part](FOUND[part] | {key: value}))
    assert [row.measured for row in rows if row.verdict == "MISSED"] == [missed]


@pytest.mark.parametrize(("key", "value", "what", "measured"), [
    ("last to first", 1.06, "last to first", "worst 1.060 (brick on waves)"),
    ("std, min", 0.84, "least contrast", "worst 0.840 (brick on waves)"),
    ("grad, max", 1.12, "largest gradient", "worst 1.120 (brick on waves)"),
    ("hist, max", 0.11, "histogram error", "worst 0.110 (brick on waves)")])
def test_one_bad_loop_misses_one_target_and_is_named(key: str, value: float, what: str, measured: str) -> None:
    rows = [row | {key: value} if row["texture"] == "brick on waves" else row for row in FOUND["loops"]["loops"]]
    missed = [row for row in targets.loops(FOUND["loops"] | {"loops": rows}) if row.verdict == "MISSED"]
    assert len(missed) == 1
    assert what in missed[0].what
    assert missed[0].measured.startswith(measured)


def changed(table: str, texture: str, **numbers: float) -> dict[str, Any]:
    """What the texture part found, with other numbers of one texture of `carry`; for a frame table of frame 100."""
    rows = [row | numbers if (row["texture"], row["method"], row.get("frame", 100)) == (texture, "carry", 100) else row
            for row in FOUND["texture"][table]]
    assert rows != FOUND["texture"][table]
    return FOUND["texture"] | {table: rows}


@pytest.mark.parametrize(("table", "texture", "key", "value", "what", "measured"), [
    ("frame by frame", "brick on waves", "grad", 0.84, "figures: contrast and gradient",
     "worst 0.84 (grad, brick on waves, frame 100); 2 of 3 within"),
    ("frame by frame", "straw on vortices", "std", 1.11, "figures: contrast and gradient",
     "worst 1.11 (std, straw on vortices, frame 100); 2 of 3 within"),
    ("frame by frame", "rings on a spiral", "hist", 0.11, "foreign textures: histogram",
     "worst 0.11 (rings on a spiral, frame 100); 0 of 1 within"),
    ("frame by frame", "brick on waves", "fwd", 0.251, "brick: forward distance at frame 100", "0.251"),
    ("in motion", "canes on circles", "worst block", 0.81, "figures: worst block",
     "worst 0.81 (canes on circles); 2 of 3 within"),
    ("in motion", "rings on a spiral", "synthesised anew, %", 2.1, "foreign textures: synthesised anew",
     "worst 2.1 % (rings on a spiral); 0 of 1 within"),
    ("in motion", "straw on vortices", "drift of used", 0.041, "figures: drift of the share",
     "worst 0.041 (straw on vortices); 2 of 3 within"),
    ("in motion", "straw on vortices", "drift of bwd", float("nan"), "figures: drift of the backward",
     "worst nan (straw on vortices); 2 of 3 within"),
    ("in motion", "canes on circles", "residual 95 %", 0.101, "canes on circles: residual", "0.101"),
    ("in motion", "straw on vortices", "residual 50 %", 0.131, "straw on vortices: residual", "0.131"),
    ("in motion", "straw on vortices", "corr10", 0.77, "straw on vortices: correlation", "0.770")])
def test_one_bad_texture_misses_one_target_and_is_named(table: str, texture: str, key: str, value: float, what: str,
                                                        measured: str) -> None:
    missed = [row for row in targets.texture(changed(table, texture, **{key: value})) if row.verdict == "MISSED"]
    assert [row.measured for row in missed] == [measured]
    assert what in missed[0].what


@pytest.mark.parametrize(("table", "key", "value", "measured"), [
    ("frame by frame", "hist", 0.09, "worst 0.09 (brick on waves, frame 100); 3 of 3 within"),
    ("frame by frame", "grad", 0.86, "worst 0.86 (grad, brick on waves, frame 100); 3 of 3 within"),
    ("in motion", "synthesised anew, %", 1.9, "worst 1.9 % (brick on waves); 3 of 3 within"),
    ("in motion", "drift of bwd", 0.019, "worst 0.019 (brick on waves); 3 of 3 within")])
def test_the_worst_is_named_where_the_target_is_met_too(table: str, key: str, value: float, measured: str) -> None:
    rows = list(targets.texture(changed(table, "brick on waves", **{key: value})))
    assert [row.verdict for row in rows if row.measured == measured] == ["met"]


@pytest.mark.parametrize(("key", "value", "missed"), [
    ("time and memory", [{"size": "512²", **SECONDS, "wall ms": 33.5}, {"size": "1024²", "peak memory MB": 400}],
     "34 ms (15 ms of processor time)"),
    ("time and memory", [{"size": "512²", **SECONDS, "first frame, wall s": 0.51},
                         {"size": "1024²", "peak memory MB": 400}], "0.51 s (0.30 s of processor time)"),
    ("time and memory", [{"size": "512²", **SECONDS}, {"size": "1024²", "peak memory MB": 501}], "501 MB"),
    ("exponent", {"first frame": 1.06, "later frames": 0.97}, "1.06"),
    ("beside rlic", {"ours": TIMES, "rlic": TIMES, "ratio": {"wall": 1.1, "processor": 0.3}},
     "1.10 (0.30 by processor time)")])
def test_a_slow_texture_misses_its_target(key: str, value: Any, missed: str) -> None:
    rows = targets.texture(FOUND["texture"] | {key: value})
    assert [row.measured for row in rows if row.verdict == "MISSED"] == [missed]


def test_the_paper_s_method_is_measured_beside_ours_and_only_its_time_has_a_target() -> None:
    slow = [row | {"wall ms": 1100} if row["method"] == "paper" and row["texture"] == "brick on waves" else row
            for row in FOUND["texture"]["in motion"]]
    rows = list(targets.texture(FOUND["texture"] | {"in motion": slow}))
    assert [row.measured for row in rows if row.verdict == "MISSED"] == [
        "1.10 s (0.01 s of processor time; brick on waves)"]  # not its worst block of 1.4


def test_fidelity_names_the_worst_scene_and_sets_no_target() -> None:
    rows = list(targets.fidelity(FOUND["fidelity"]))
    assert [row.cells[2:4] for row in rows] == [("no target", "")] * 3
    assert rows[1].measured == "7.0% off (ma13-fig05 pure)"


@pytest.mark.parametrize(("key", "value", "what", "measured"), [
    ("low-pass", 5.1, "blurred by 8 pixels", "worst 5.1 (river); 1 of 2 within"),
    ("2 px", 1.17, "contrast of bands", "worst 1.17 (2 px, river); 1 of 2 within"),
    ("4 px", 0.83, "contrast of bands", "worst 0.83 (4 px, river); 1 of 2 within"),
    ("angle to strokes", 16.0, "angle of the flow", "worst 16° (river); 1 of 2 within"),
    ("deviation", 0.74, "deviation between pieces", "worst 0.74 (river); 1 of 2 within"),
    ("gradient", 1.3, "gradient on the lines", "worst 1.30 (river); 1 of 2 within"),
    ("gradient", None, "gradient on the lines", "worst nan (river); 1 of 2 within"),
    ("edges", 0.6, "correlation of gradients", "worst 0.60 (river); 0 of 1 within"),
    ("loop", 1.3, "last to first", "worst 1.30 (river); 1 of 2 within")])
def test_one_bad_picture_misses_one_target_and_is_named(key: str, value: Any, what: str, measured: str) -> None:
    rows = [row | {key: value} if (row["target"], row["way"]) == ("river", "ours") else row
            for row in FOUND["photo"]["look"]]
    missed = [row for row in targets.photo(FOUND["photo"] | {"look": rows}) if row.verdict == "MISSED"]
    assert [row.measured for row in missed] == [measured]
    assert what in missed[0].what


@pytest.mark.parametrize(("key", "changes", "missed"), [
    ("truth", {"angle": 18.0, "target": "fall"}, "worst 18° (fall); 0 of 1 within"),  # 20 without
    ("times", {"assignment, s": 15.1}, "15.1 s"),
    ("times", {"all, s": 36.2}, "36.2 s (assignment 8.0, integration 9.0, composition 7.0)"),
    ("times", {"peak memory MB": 3001}, "3001 MB"),
    ("analysis", {"wall": 121.0}, "10.1 min (30 of 150 clips, 121 s, at that rate)"),
    ("minimizers", {"TRW-S": 101.0}, "101"),
    ("bits", {"different results": 2}, "2 different results in 6 runs")])
def test_a_photo_s_truth_times_and_bits_have_targets(key: str, changes: dict[str, Any], missed: str) -> None:
    before = FOUND["photo"][key]
    after = [row | changes for row in before] if isinstance(before, list) else before | changes
    rows = targets.photo(FOUND["photo"] | {key: after})
    assert [row.measured for row in rows if row.verdict == "MISSED"] == [missed]


def test_another_way_is_shown_beside_ours_of_the_same_targets_and_sets_no_target() -> None:
    row = next(row for row in targets.photo(FOUND["photo"]) if "differences alone" in row.what)
    assert row.met is None
    assert row.measured.startswith("low-pass 9.0") and row.measured.endswith("loop nan")
    assert row.reference.startswith("ours: low-pass 3.1")
