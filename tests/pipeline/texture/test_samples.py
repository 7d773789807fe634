"""Samples: what each kind gives, and what is no texture."""

from pathlib import Path

import numpy as np
import pytest
from tiny import TEXTURE, Memory, changed, made, scene

from pipeline.errors import BadInput
from pipeline.files import pictures
from pipeline.texture.samples import make_sample, sample_artifact
from render import tonemap
from synth.texture import procedural

PICTURE = changed(TEXTURE, 'kind = "canes"', 'kind = "picture"\nfile = "a.png"')


def sample(folder: Path, text: str = TEXTURE) -> np.ndarray:
    one = scene(folder, text)
    return next(make_sample(one, Memory(folder), [0]))[1]


@pytest.mark.parametrize("kind", ["canes", "straw", "scales"])
def test_a_procedure_gives_its_picture_top_row_first(tmp_path: Path, kind: str) -> None:
    found = sample(tmp_path, changed(TEXTURE, '"canes"', f'"{kind}"'))
    np.testing.assert_array_equal(found, getattr(procedural, kind)(32)[::-1])


def test_of_a_picture_the_central_square_is_taken_as_linear_light(tmp_path: Path) -> None:
    drawn = np.random.default_rng(1).random((40, 60, 3)).astype(np.float32)
    pictures.write(tmp_path / "a.png", drawn)
    found = sample(tmp_path, changed(PICTURE, "size = 32", "size = 40"))
    assert found.shape == (40, 40, 3)
    np.testing.assert_allclose(tonemap.to_srgb(found), np.rint(drawn[:, 10:50] * 255) / 255, atol=4e-3)


@pytest.mark.parametrize(("value", "told"), [(0.5, "sample: "), (0.0, "sample: ")])
def test_one_colour_is_no_texture_and_nothing_is_written(tmp_path: Path, value: float, told: str) -> None:
    pictures.write(tmp_path / "a.png", np.full((32, 32, 3), value, np.float32))
    with pytest.raises(BadInput, match=told):
        made(tmp_path, PICTURE)
    assert not (tmp_path / "out").exists()


def test_it_depends_on_its_table_alone(tmp_path: Path) -> None:
    assert sample_artifact(scene(tmp_path, TEXTURE)).reads == ("sample",)
