"""render.smoke: pictures whose light is known in advance, and invalid densities."""

import numpy as np
import pytest
from scipy import ndimage

from render import backend, smoke, studio

CAMERA = studio.Camera(position=(0.0, 0.0, 8.0), target=(0.0, 0.0, 0.0), fov=4.0)


@pytest.mark.parametrize("colour", smoke.INKS)
def test_ink_is_beer_lambert(colour: str) -> None:
    """Against blank paper of the same grain: transmittance exp(-density * absorbance), exactly."""
    paper = smoke.ink(np.zeros((8, 8)), 16, colour)
    thin, thick = (smoke.ink(np.full((8, 8), d), 16, colour) / paper for d in (0.25, 0.5))
    assert thin[3, 5] == pytest.approx(np.exp(-0.25 * np.array(smoke.INKS[colour])), rel=1e-5)
    assert thick == pytest.approx(thin**2, rel=1e-5)


def test_blank_paper_is_nearly_white_and_has_grain() -> None:
    paper = smoke.ink(np.zeros((32, 32)), 128)
    assert paper.min() > 0.9 and paper.max() < 1.0
    assert paper[..., 0].std() > 0.003


def test_no_smoke_shows_the_backdrop_alone() -> None:
    assert np.allclose(smoke.lit(np.zeros((16, 24)), 48)[::-1], smoke._backdrop(32, 48))


@pytest.mark.parametrize("sigma", [2.0, 13.0, 37.0])
def test_a_wide_blur_of_averages_is_a_gaussian(sigma: float) -> None:
    rng = np.random.Generator(np.random.Philox(key=4))
    values = np.pad(rng.random((61, 90), dtype=np.float32), 100)
    blurred = smoke._blurred(values, sigma)
    assert blurred.shape == values.shape
    np.testing.assert_allclose(blurred, ndimage.gaussian_filter(values, sigma, truncate=2.5),
                               atol=0.01 * blurred.max())


@pytest.mark.parametrize("draw", [smoke.lit, smoke.ink])
def test_row_zero_is_the_bottom_and_bits_repeat(draw: object) -> None:
    assert callable(draw)
    density = np.zeros((32, 24), np.float32)
    density[2:6, 4:9] = 1.0  # low and to the left
    empty, first = draw(np.zeros_like(density), 48), draw(density, 48)
    assert first.shape == (64, 48, 3)
    change = np.abs(first - empty).sum(axis=2)
    row, column = np.unravel_index(change.argmax(), change.shape)
    assert row > 48 and column < 24
    assert np.array_equal(first, draw(density, 48))


def test_lit_smoke_is_brighter_towards_the_key_and_cooler_towards_the_rim() -> None:
    y, x = np.mgrid[0:64, 0:64]
    disc = (np.hypot(x - 31.5, y - 31.5) < 18).astype(np.float32)
    picture = smoke.lit(disc, 128)
    key_side, rim_side = picture[50:56, 38:44].mean(axis=(0, 1)), picture[72:78, 86:92].mean(axis=(0, 1))
    assert key_side.sum() > 1.3 * rim_side.sum()
    assert rim_side[2] / rim_side[0] > 1.15 * key_side[2] / key_side[0]


def test_lit_shows_detail_inside_opaque_smoke() -> None:
    """Ripples of 10 % in dense smoke, which opacity alone would hide, are seen."""
    x = np.arange(128)
    density = np.zeros((128, 128), np.float32)
    density[16:112, 16:112] = (0.9 + 0.1 * np.sin(x * 0.9))[16:112]
    picture = smoke.lit(density, 256)[96:160, 80:176, 1]
    assert picture.std(axis=1).mean() / picture.mean() > 0.05


@pytest.mark.parametrize("bad", [
    np.zeros((4, 4, 4)), np.zeros((1, 4)),
    np.full((4, 4), np.nan), np.full((4, 4), np.inf), np.full((4, 4), -1.0),
])
def test_an_invalid_density_is_refused(bad: np.ndarray) -> None:
    for draw in (smoke.lit, smoke.ink):
        with pytest.raises(ValueError, match="density"):
            draw(bad, 32)


def test_an_unknown_ink_is_refused() -> None:
    with pytest.raises(ValueError, match=r"unknown ink 'pink': one of indigo"):
        smoke.ink(np.zeros((4, 4)), 8, "pink")


# volumes


def alone(density: np.ndarray, voxel: float, origin: tuple[float, float, float], extinction: float,
          spp: int, albedo: float = 0.5) -> np.ndarray:
    """`density` in nothing but a constant light of 1 from all over, 16 x 16 pixels."""
    mi = backend.mitsuba("scalar_rgb")
    scene = {"sky": {"type": "constant"}, "smoke": smoke.medium(mi, density, voxel, origin, extinction, (albedo,) * 3)}
    return smoke._photographed(mi, scene, smoke.VolumeSettings(width=16, height=16, spp=spp, camera=CAMERA))


def centred(shape: tuple[int, int, int], voxel: float) -> tuple[float, float, float]:
    z, y, x = shape
    return (-0.5 * (x - 1) * voxel, -0.5 * (y - 1) * voxel, -0.5 * (z - 1) * voxel)


def test_white_furnace() -> None:
    """Smoke that absorbs nothing, in a light of 1 from everywhere, cannot be seen."""
    density = np.random.Generator(np.random.Philox(key=3)).random((5, 7, 6), dtype=np.float32)
    picture = alone(density, 0.1, centred(density.shape, 0.1), extinction=4.0, spp=512, albedo=1.0)
    assert picture.mean() == pytest.approx(1.0, abs=3e-3)  # the noise of 256 x 512 paths
    assert picture == pytest.approx(1.0, abs=0.12)  # that of 512 paths, five deviations


def test_beer_lambert_through_a_slab() -> None:
    """Black smoke 0.5 thick with an extinction of 3 lets exp(-1.5) of the light through."""
    density = np.full((5, 12, 12), 0.75, np.float32)
    picture = alone(density, 0.1, centred(density.shape, 0.1), extinction=4.0, spp=256, albedo=0.0)
    inside = picture[4:12, 4:12]
    noise = np.sqrt(np.exp(-1.5) * (1 - np.exp(-1.5)) / (256 * 64))
    assert inside.mean() == pytest.approx(np.exp(-1.5), abs=4 * noise)


def test_the_volume_stands_where_its_grid_says() -> None:
    """An asymmetric grid with a negative origin: one black cell at (-0.2, +0.1), a view 0.56 wide."""
    density = np.zeros((3, 6, 4), np.float32)
    density[1, 4, 1] = 1.0
    picture = alone(density, 0.05, (-0.25, -0.1, -0.05), extinction=400.0, spp=64, albedo=0.0)[..., 0]
    weight = 1.0 - picture
    rows, columns = np.mgrid[0:16, 0:16]
    at = np.array([(weight * columns).sum(), (weight * rows).sum()]) / weight.sum()
    pixel = 16 / (2 * 8.0 * np.tan(np.radians(2.0)))
    assert at == pytest.approx([7.5 - 0.2 * pixel, 7.5 - 0.1 * pixel], abs=0.3)


def test_the_studio_repeats_bit_for_bit_in_parts_and_with_a_bowl(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two runs give the same bits, and so does each pass of a render that is split."""
    density = np.random.Generator(np.random.Philox(key=4)).random((4, 8, 5), dtype=np.float32)
    settings = smoke.VolumeSettings(width=20, height=24, spp=2, bowl=(0.2, 0.1))
    first = smoke.volume(density, 0.1, (-0.2, 0.05, -0.15), settings)
    assert first.shape == (24, 20, 3) and first.dtype == np.float32
    assert np.isfinite(first).all() and first.min() >= 0.0 and first.mean() > 0.01
    assert np.array_equal(first, smoke.volume(density, 0.1, (-0.2, 0.05, -0.15), settings))
    monkeypatch.setattr(smoke, "MOST_SAMPLES", 20 * 24)
    again = [smoke.volume(density, 0.1, (-0.2, 0.05, -0.15), settings) for _ in range(2)]
    assert np.array_equal(*again)
    assert again[0].mean() == pytest.approx(first.mean(), rel=0.15)


def test_an_empty_volume_shows_the_studio() -> None:
    settings = smoke.VolumeSettings(width=8, height=8, spp=1)
    picture = smoke.volume(np.zeros((2, 2, 2)), 0.1, (0.0, 0.0, 0.0), settings)
    assert np.isfinite(picture).all()


def test_the_active_box_keeps_one_empty_cell_around() -> None:
    density = np.zeros((6, 7, 8))
    density[0, 3, 4:6] = 1.0
    assert smoke.active_box(density) == (slice(0, 2), slice(2, 5), slice(3, 7))


@pytest.mark.parametrize(("value", "reason"), [
    (np.nan, "NaN"), (np.inf, "infinity"), (-0.5, "negative"), (1e8, "too much to render"),
])
def test_one_bad_voxel_is_refused_before_rendering(value: float, reason: str) -> None:
    density = np.zeros((3, 4, 5), np.float32)
    density[1, 2, 3] = value
    with pytest.raises(ValueError, match=reason):
        smoke.volume(density, 0.1, (0.0, 0.0, 0.0))


def test_smoke_alone_floats_in_the_sky_under_the_lamps() -> None:
    density = np.ones((4, 4, 4), np.float32)
    settings = smoke.VolumeSettings(width=16, height=20, spp=16, extinction=20.0)
    picture = smoke.alone(density, 0.05, (-0.075, 0.4, -0.075), settings)
    for corner in (picture[0, 0], picture[-1, -1]):
        assert corner == pytest.approx(studio.SKY, rel=1e-5)
    assert picture[10, 8].mean() > 3 * np.mean(studio.SKY)
