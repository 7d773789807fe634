"""The samples, the flows and the sums of the texture part."""

import numpy as np
import pytest

from bench import texture
from synth.texture.sample import sample


@pytest.mark.parametrize("name", [*texture.FOREIGN, "brick", "gravel"])
def test_every_sample_is_one_and_the_same_each_time(name: str) -> None:
    made = {**texture.FOREIGN, "brick": texture.brick, "gravel": texture.gravel}[name]
    picture = made()
    assert picture.shape == (texture.SAMPLE, texture.SAMPLE, 3)
    assert picture.dtype == np.float32
    sample(picture)  # raises for one that is no texture
    assert np.array_equal(picture, made())


@pytest.mark.parametrize("name", ["arrows", "strokes"])
def test_what_runs_along_y_is_seen_to(name: str) -> None:
    assert np.rad2deg(sample(texture.FOREIGN[name]()).direction) == pytest.approx(90, abs=1)


@pytest.mark.parametrize("name", ["rings", "woven"])
def test_what_has_no_main_direction_is_seen_to_have_none(name: str) -> None:
    assert not sample(texture.FOREIGN[name]()).has_direction


@pytest.mark.parametrize(("made", "least", "most"), [
    (texture.circles, 0.3, 2.2), (texture.noise, 0.3, 2.2), (texture.vortices, 1.5, 1.5), (texture.wavy, 1.5, 1.5),
    (texture.saddle, 1.5, 1.5), (texture.spiral, 1.5, 1.5)])
def test_flows_keep_to_their_speeds_and_turn_alike_at_every_size(made, least: float, most: float) -> None:
    speed = np.linalg.norm(made(64), axis=-1)
    assert least - 1e-5 <= speed.min() <= speed.max() <= most + 1e-5
    # the mean of four pixels of twice the size points the same way
    fine = made(128).reshape(64, 2, 64, 2, 2).mean(axis=(1, 3))
    turned = fine[..., 0] * made(64)[..., 1] - fine[..., 1] * made(64)[..., 0]
    assert np.abs(np.median(turned)) < 0.02


def test_vortices_are_free_of_divergence_before_their_speed_is_made_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(texture.flow, "normalized", lambda v, speed: v)
    v = texture.vortices(128)
    divergence = np.gradient(v[..., 0], axis=1) + np.gradient(v[..., 1], axis=0)
    assert np.abs(divergence[1:-1, 1:-1]).max() < 1e-3 * np.abs(np.gradient(v[..., 0], axis=0)).max()


def test_every_figure_is_run_by_both_methods_and_foreign_samples_by_ours() -> None:
    assert len(texture.TEXTURES) == 2 * len(texture.FIGURES) + len(texture.FOREIGN) * len(texture.STRANGE)
    assert [t.frames for name, t in texture.TEXTURES.items() if name.endswith("paper")] == [100] * 6
    assert sum(t.frames == 300 and t.every == 1 for t in texture.TEXTURES.values()) == 3


@pytest.mark.parametrize("power", [1.0, 1.5])
def test_the_exponent_of_a_power_law_is_its_power(power: float) -> None:
    rows = [{"size": f"{n}²", "ms": 1e-4 * float(n * n) ** power} for n in texture.SIZES]
    assert texture.exponent(rows, "ms") == power
