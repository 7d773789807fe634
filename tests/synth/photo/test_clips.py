"""The catalogue: 150 recipes in their shares, and a small one whose every clip passes the checks."""

import hashlib

import numpy as np
import processes
import pytest

from synth.photo.checks import faults
from synth.photo.clips import FAMILIES, SHARES, catalogue, clip

FRAMES, SIZE = 32, (160, 120)


@pytest.mark.parametrize("recipe", catalogue(9), ids=lambda recipe: recipe.family)
def test_every_family_passes_the_checks(recipe):
    made = recipe.clip(FRAMES, SIZE)
    assert made.luma.shape == (FRAMES, 120, 160) and made.luma.dtype == np.uint8
    assert made.velocity.shape == (120, 160, 2) and made.velocity.dtype == np.float32
    assert made.coverage.shape == (120, 160) and made.coverage.dtype == np.float32
    assert made.coverage.min() >= 0 and made.coverage.max() <= 1
    assert (made.chroma is not None) == (recipe.family == "fire")
    assert faults(made) == []


def test_the_catalogue_holds_its_shares():
    families = [recipe.family for recipe in catalogue()]
    assert {family: families.count(family) for family in FAMILIES} == SHARES and len(families) == 150
    assert len(set(families[:9])) == 9, "a small one has every family"
    assert catalogue(30) == catalogue()[:30]


def test_no_two_recipes_are_alike():
    recipes = catalogue()
    assert len({recipe.seed for recipe in recipes}) == 150
    assert len({str(recipe) for recipe in recipes}) == 150


@pytest.mark.parametrize("family", ["white-water", "river", "cloud"])
def test_directions_go_all_round(family):
    angles = np.sort([recipe.variation["direction"] for recipe in catalogue() if recipe.family == family])
    gaps = np.diff(np.append(angles, angles[0] + 2 * np.pi))
    assert gaps.max() < 3 * 2 * np.pi / len(angles)


def test_the_seed_decides():
    one, same, other = (clip("fall", seed, FRAMES, SIZE) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one.luma, same.luma)
    assert np.abs(one.luma.astype(int) - other.luma).mean() > 5


@pytest.mark.parametrize(("family", "frames", "size", "named"), [
    ("lava", 32, (160, 120), "'lava' is none of fall, white-water"),
    ("fall", 30, (160, 120), "not 30 frames"), ("fall", 8, (160, 120), "at least 16 frames"),
    ("fall", 32, (161, 120), "even numbers"), ("fall", 32, (160, 62), "at least 64 x 64")])
def test_a_clip_that_cannot_be_is_refused(family, frames, size, named):
    with pytest.raises(ValueError, match=named):
        clip(family, 1, frames, size)


def digest():
    total = hashlib.sha256()
    for family in ("fall", "river", "fire", "cloud", "lake"):  # each module, each kernel
        made = clip(family, 1, 16, (128, 96))  # enough pixels for a library to split sums between threads
        for values in (made.luma, made.velocity, made.coverage):
            total.update(np.ascontiguousarray(values).tobytes())
    return total.hexdigest()


def test_the_same_bits_at_any_thread_count_and_from_a_cold_cache(tmp_path):
    assert processes.digests(__file__, tmp_path) == {digest()}
