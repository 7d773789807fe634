"""The exemplars: of every kind of file and of a procedure, in their unit, named after the views that show them."""

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tiny

from pipeline.build import keys
from pipeline.build.artifact import Artifact
from pipeline.build.graph import computed
from pipeline.errors import BadInput
from pipeline.files import images, pictures, video, volumes
from pipeline.motion.exemplars import exemplar_artifacts
from pipeline.motion.scene import Scene
from pipeline.tables import PROJECT_SCENES
from synth.field import Field
from synth.motion.exemplar import exemplar

SPACE: dict[str, Any] = {"coarse": {"kind": "curl-noise", "size": [8, 10, 6]}, "detail": {"size": [16, 20, 12]},
                         "render": {"kind": "volume"}}


def scene(folder: Path = PROJECT_SCENES, **tables: Any) -> Scene:
    """The tiny scene with these tables."""
    return Scene.model_validate({**tomllib.loads(tiny.SMOKE), **tables}, context={"folder": folder})


def drawn(folder: Path, kind: str) -> dict[str, Any]:
    """An [exemplar] table of a kind that reads a file, and the file."""
    rng = np.random.default_rng(1)
    x = np.arange(32)
    wave = np.stack([np.sin(x * 0.4)[None] * np.ones((32, 1)), np.cos(x * 0.4)[:, None] * np.ones((1, 32))], -1)
    match kind:
        case "bitmap":
            pictures.write(folder / "a.png", rng.random((32, 32)))
        case "drawing":
            paper = np.ones((64, 64))
            paper[30:34, 8:56] = 0
            pictures.write(folder / "a.png", paper)
        case "svg":
            (folder / "a.svg").write_text(
                '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 10 10"><path d="M1 5 L9 5"/></svg>')
            return {"kind": "drawing", "file": "a.svg", "size": 16}
        case "exr":
            images.write_field(folder / "a.exr", Field.centred(wave, 2))
            return {"kind": "field", "file": "a.exr", "size": 16}
        case "vdb":
            values = np.zeros((3, 32, 32, 3), np.float32)
            values[..., :2] = wave
            volumes.write(folder / "a.vdb", {"vel": Field.centred(values, 3)})
            return {"kind": "field", "file": "a.vdb", "size": 16}
        case "clip":
            blob = np.exp(-((x[:, None] - 16.0) ** 2 + (x - 10.0) ** 2) / 30)
            frames = [np.repeat(np.roll(blob, 2 * i, 1)[..., None], 3, 2) for i in range(4)]
            video.write(folder / "a.mp4", frames, 30)
            return {"kind": "clip", "file": "a.mp4", "size": 16}
    return {"kind": kind, "file": "a.png", "size": 16}


def made(scene: Scene, folder: Path, artifact: Artifact | None = None) -> Field:
    """An exemplar of the scene, the first if none is named."""
    (frame, field), = computed(artifact or exemplar_artifacts(scene)[0], scene, tiny.Memory(folder), [0])
    assert frame == 0
    return field


@pytest.mark.parametrize("kind", ["bitmap", "drawing", "svg", "exr", "vdb", "clip"])
def test_every_kind_of_file_makes_an_exemplar_in_its_unit(tmp_path: Path, kind: str) -> None:
    field = made(scene(tmp_path, exemplar=drawn(tmp_path, kind)), tmp_path)
    assert field.values.shape == (16, 16, 2)
    assert np.linalg.norm(field.values, axis=-1).max() == pytest.approx(1.0, abs=1e-6)


def test_a_horizontal_stroke_is_a_flow_to_the_right(tmp_path: Path) -> None:
    for kind in ("drawing", "svg"):
        field = made(scene(tmp_path, exemplar=drawn(tmp_path, kind)), tmp_path)
        assert field.values[7:9, 4:12, 0].min() > 0.5


@pytest.mark.parametrize("kind", ["circle", "square", "heart", "stripes", "sinusoid"])
def test_a_procedure_is_what_the_method_makes(tmp_path: Path, kind: str) -> None:
    field = made(scene(exemplar={"kind": kind, "size": 8}), tmp_path)
    np.testing.assert_array_equal(field.values, exemplar(kind, 8))


@pytest.mark.parametrize(("kind", "has_picture"), [("bitmap", True), ("drawing", True), ("svg", False), ("exr", False)])
def test_the_picture_that_an_exemplar_is_made_of(tmp_path: Path, kind: str, has_picture: bool) -> None:
    picture = scene(tmp_path, exemplar=drawn(tmp_path, kind)).exemplar.picture("exemplar")
    assert (picture is not None) == has_picture
    assert picture is None or np.array_equal(picture, pictures.read_foreign(tmp_path / "a.png", "exemplar.file"))


def test_a_drawing_that_is_no_text_is_refused_by_its_key(tmp_path: Path) -> None:
    (tmp_path / "a.svg").write_bytes(b"<svg>\xe9</svg>")
    latin = scene(tmp_path, exemplar={"kind": "drawing", "file": "a.svg", "size": 16})
    with pytest.raises(BadInput, match=r"a\.svg: exemplar\.file: is not an SVG document in UTF-8"):
        made(latin, tmp_path)


TOP = {"plane": "top", "exemplar": {"kind": "square", "size": 8}}


def test_the_exemplars_of_the_views_are_named_after_them(tmp_path: Path) -> None:
    def names(*views: dict[str, Any]) -> list[str]:
        return [a.file(0) for a in exemplar_artifacts(scene(**SPACE, views=list(views)))]

    side, stripes = {"plane": "side"}, {"kind": "stripes", "size": 8}
    assert names() == ["exemplar.exr"]
    assert names(TOP, side) == ["exemplar-top.exr", "exemplar-side.exr"]
    assert names(TOP, side, {"plane": "front"}) == ["exemplar-top.exr", "exemplar-side.exr"]
    assert names(TOP, TOP | {"plane": "side"}) == ["exemplar.exr"]
    oblique = {"right": [1.0, 1.0, 0.0], "up": [0.0, 0.0, 1.0], "exemplar": stripes}
    assert names(TOP, oblique, side | {"exemplar": stripes}) == ["exemplar-top.exr", "exemplar-2.exr"]
    assert names(TOP, TOP | {"exemplar": stripes}, side) == ["exemplar-1.exr", "exemplar-2.exr", "exemplar-side.exr"]
    seen = scene(**SPACE, views=[TOP, side])
    for artifact, kind in zip(exemplar_artifacts(seen), ("square", "circle"), strict=True):
        np.testing.assert_array_equal(made(seen, tmp_path, artifact).values, exemplar(kind, 8))


def test_a_vdb_is_a_solid_exemplar_in_space_and_a_slice_in_the_plane(tmp_path: Path) -> None:
    values = np.random.default_rng(3).standard_normal((16, 20, 16, 3)).astype(np.float32)
    volumes.write(tmp_path / "a.vdb", {"vel": Field(values, 0.25, (-3.0, -1.0, -2.0))})
    table = {"kind": "field", "file": "a.vdb", "size": 8}
    solid = scene(tmp_path, **SPACE | {"exemplar": table})
    artifact, = exemplar_artifacts(solid)
    field = made(solid, tmp_path)
    assert (artifact.file(0), field.values.shape, len(solid.seen)) == ("exemplar.vdb", (8, 8, 8, 3), 1)
    artifact.format.save(tmp_path / "exemplar.vdb", field)
    assert artifact.format.read(tmp_path / "exemplar.vdb") == field
    means = values[:, 2:-2].reshape(8, 2, 8, 2, 8, 2, 3).mean((1, 3, 5))
    np.testing.assert_allclose(field.values * np.linalg.norm(means, axis=-1).max(), means, atol=1e-5)
    flat = scene(tmp_path, exemplar=table)
    assert made(flat, tmp_path).values.shape == (8, 8, 2)
    assert keys.declared(exemplar_artifacts(flat)[0], flat) != keys.declared(artifact, solid)
