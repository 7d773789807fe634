"""What synth makes of a scene of motion fields: O, H that goes on where it was stopped, and where its axes face."""

import re
import subprocess
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tiny

from pipeline.build import source_digest
from pipeline.build.artifact import Artifact
from pipeline.build.graph import computed
from pipeline.files import volumes
from pipeline.flow import coarse_artifact
from pipeline.motion import fields
from pipeline.motion.method import artifacts
from pipeline.motion.scene import Scene
from pipeline.tables import PROJECT_SCENES
from synth.field import Field
from synth.motion.coarse import upsample
from synth.motion.density import naive
from synth.motion.exemplar import exemplar
from synth.motion.local_axes import interpolated_directions, outward


def scene(**tables: Any) -> Scene:
    """The tiny scene with these tables, four frames of it."""
    return Scene.model_validate({**tomllib.loads(tiny.SMOKE), "frames": 4, **tables},
                                context={"folder": PROJECT_SCENES})


def artifact(scene: Scene, name: str) -> Artifact:
    """The artifact of this name."""
    return next(one for one in artifacts(scene) if one.name == name)


def made(scene: Scene, name: str, inputs: Any, frames: Sequence[int]) -> dict[int, Any]:
    """What an artifact makes of its inputs, which sees only what it declares."""
    return dict(computed(artifact(scene, name), scene, inputs, frames))


def stocked(scene: Scene, folder: Path, frames: int = 4) -> tiny.Memory:
    """The exemplar and L of some frames."""
    inputs = tiny.Memory(folder, exemplar=Field.centred(exemplar("circle", 8), 2))
    for frame, L in made(scene, "L", inputs, range(1, frames + 1)).items():
        inputs.files["L", frame] = L
    return inputs


WAYS = {"motion": {}, "potential": {"synthesize": "potential"}, "lagrangian": {"samples": "lagrangian"}}
DETAIL: dict[str, Any] = {"size": [16, 16], "iterations": 1, "neighborhoods": [5]}


@pytest.mark.parametrize("way", WAYS)
def test_detail_goes_on_from_its_state_with_the_same_bits_and_without_it_from_the_start(
        tmp_path: Path, way: str) -> None:
    one = scene(detail={**DETAIL, **WAYS[way]})
    inputs = stocked(one, tmp_path)
    every = made(one, "H", inputs, [1, 2, 3, 4])
    assert (tmp_path / "state.npz").is_file()
    kept = inputs.checkpoint.load(before=4)
    assert kept and kept[0] == 3
    inputs.asked.clear()
    assert made(one, "H", inputs, [4]) == {4: every[4]}
    assert [frame for name, frame in inputs.asked if name == "L"] == [4]
    (tmp_path / "state.npz").write_bytes((tmp_path / "state.npz").read_bytes()[:-50])
    assert inputs.checkpoint.load(before=4) is None
    assert made(one, "H", inputs, [4]) == {4: every[4]}


def test_each_way_of_synthesis_is_another(tmp_path: Path) -> None:
    found = {}
    for way, keys in WAYS.items():
        (tmp_path / way).mkdir()
        one = scene(detail={**DETAIL, **keys})
        found[way] = made(one, "H", stocked(one, tmp_path / way, 1), [1])[1]
        assert found[way].shape == (16, 16)
        code = source_digest.sources([artifact(one, "H").make]).values()
        assert f"synth/motion/{'detail' if way == 'motion' else way}.py" in code
    assert found["motion"] != found["potential"] != found["lagrangian"] != found["motion"]


# -- in space -----------------------------------------------------------------------------------------------------


SPACE: dict[str, Any] = {
    "coarse": {"kind": "curl-noise", "size": [8, 10, 6]},
    "detail": {"size": [16, 20, 12], "iterations": 1, "neighborhoods": [5], "levels": 1},
    "density": {"sources": [{"centre": [0.0, 0.4, 0.1], "radius": 0.2}]}, "render": {"kind": "volume"}}
TOP = {"plane": "top", "exemplar": {"kind": "square", "size": 8}}


def test_files_of_fields_in_space_say_what_they_hold_and_read_back(tmp_path: Path) -> None:
    one = scene(**SPACE)
    L = stocked(one, tmp_path, 1).files["L", 1]
    for name, said in (("L", {"unit": "world units per second", "fps": "30"}),
                       ("H", {"unit": "the exemplar's longest vector", "axes": "local frame"})):
        kept = artifact(one, name)
        file = tmp_path / kept.file(1)
        kept.format.save(file, L)
        assert file.name == f"{name}.0001.vdb"
        assert volumes.read(file) == {"vel": L}
        assert kept.format.read(file) == L
        assert volumes.metadata(file) == said


def test_the_local_axes_face_the_camera_the_smoke_or_where_the_user_says(tmp_path: Path) -> None:
    def synthesized(one: Scene) -> list[str]:
        return [a.name for a in artifacts(one) if a.stage == "synth"]

    one = scene(**SPACE)
    inputs = stocked(one, tmp_path)
    assert synthesized(one) == ["exemplar", "L", "H"]
    assert (fields.towards(one, inputs, 1) == [0, 0, 1]).all()

    out = scene(**SPACE | {"detail": SPACE["detail"] | {"facing": "density"}})
    assert synthesized(out) == ["exemplar", "L", "O", "H"]
    smoke = made(out, "O", inputs, [2, 3])
    L = [inputs.files["L", frame].per_frame(out.fps).values for frame in (1, 2, 3)]
    expected = list(naive(L, fields.sources(out)))
    assert sorted(smoke) == [2, 3]
    np.testing.assert_array_equal(smoke[3].values, expected[2])
    inputs.files["O", 3] = smoke[3]
    np.testing.assert_array_equal(fields.towards(out, inputs, 3), upsample(outward(expected[2]), (12, 20, 16)))

    placed = [{"at": [0.0, 0.5, 0.0], "vector": [0.0, 0.0, 2.0]}, {"at": [0.2, 0.9, 0.1], "vector": [1.0, 0.0, 0.0]}]
    hand = scene(**SPACE | {"detail": SPACE["detail"] | {"facing": "directions", "directions": placed}})
    # the centre of 16 × 20 × 12 cells; and 4 cells to the right, 8 up, 2 to the front of it
    np.testing.assert_allclose(fields.towards(hand, inputs, 1), interpolated_directions(
        np.array([[7.5, 9.5, 5.5], [11.5, 17.5, 7.5]]), np.array([[0, 0, 2.0], [1, 0, 0]]), (12, 20, 16)), atol=1e-5)


@pytest.mark.parametrize("views", [[], [TOP, {"plane": "side", "weight": 2.0}]])
def test_detail_in_space_goes_on_from_its_state_with_the_same_bits(tmp_path: Path, views: list[dict[str, Any]]) -> None:
    one = scene(**SPACE, views=views)
    inputs = stocked(one, tmp_path, 3)
    inputs.files |= {"exemplar-top": Field.centred(exemplar("square", 8), 2),
                     "exemplar-side": inputs.files["exemplar"]}
    every = made(one, "H", inputs, [1, 2, 3])
    assert every[1].values.shape == (12, 20, 16, 3)
    assert not np.array_equal(every[1].values, every[3].values)
    inputs.asked.clear()
    assert made(one, "H", inputs, [3]) == {3: every[3]}
    assert [frame for name, frame in inputs.asked if name == "L"] == [3]
    (tmp_path / "state.npz").unlink()
    assert made(one, "H", inputs, [3]) == {3: every[3]}


def test_the_memory_of_a_detail_in_space_grows_with_its_cells() -> None:
    small, large = (fields.detail_memory(scene(**SPACE | {"detail": SPACE["detail"] | {"size": size}}))
                    for size in ([128, 160, 96], [256, 320, 192]))
    assert small[1] == large[1] == "detail.size" and large[0] > 6 * small[0] > 0


def test_another_program_opens_what_is_written_the_right_way_up(tmp_path: Path) -> None:
    """OpenVDB's own tool agrees where a marked vector lies: third column, fourth row, first layer of 6 × 5 × 4."""
    values = np.zeros((4, 5, 6, 3), np.float32)
    values[0, 3, 2] = (1.0, -2.0, 3.0)
    coarse_artifact(scene(**SPACE)).format.save(tmp_path / "L.vdb", Field.centred(values, 3))
    told = subprocess.run(["vdb_print", "-l", "-m", tmp_path / "L.vdb"], capture_output=True, text=True,
                          check=True).stdout
    assert "Name: vel" in told and "Type: Tree_vec3s" in told
    assert "Bounding box of active voxels: [2, 3, 0] -> [2, 3, 0]" in told
    assert re.search(r"Max value: \[1, -2, 3\]", told)
    assert "unit: world units per second" in told
    matrix = [[float(n) for n in row.split(",")] for row in re.findall(r"\[([^\[\]]+)\] ?\n", told)][-4:]
    scale = [[0.2, 0, 0, 0], [0, 0.2, 0, 0], [0, 0, 0.2, 0]]
    np.testing.assert_allclose(matrix, [*scale, [-0.5, 0.1, -0.3, 1]], atol=1e-6)
