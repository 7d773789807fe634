"""The rows of every part, from JSON objects of the shape that the part prints."""

from typing import Any

import pytest

from bench import results, targets

TIMES = {"wall": 0.5, "processor": 0.9}
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


def test_fidelity_names_the_worst_scene_and_sets_no_target() -> None:
    rows = list(targets.fidelity(FOUND["fidelity"]))
    assert [row.cells[2:4] for row in rows] == [("no target", "")] * 3
    assert rows[1].measured == "7.0% off (ma13-fig05 pure)"
