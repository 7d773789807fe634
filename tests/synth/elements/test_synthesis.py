"""Synthesis: the energy falls, constraints hold, motion is kept, an interrupted run gives the same bits."""

import hashlib
import itertools
from pathlib import Path

import numpy as np
import processes
import pytest

from synth.elements import (
    arrangement,
    collision,
    fidelity,
    initialize,
    neighborhood,
    orientation,
    search,
    synthesis,
)
from synth.elements.constraints import Constraints, Domain, Pins
from synth.elements.neighborhood import Shape
from synth.elements.samples import Elements
from synth.elements.synthesis import Controls, Settings


def square(edge: float = 9.0) -> Domain:
    at = (np.arange(72) + 0.5) * edge / 72
    away = np.minimum(at, edge - at)
    return Domain(np.minimum(away[:, None], away).astype(np.float32), edge / 72, np.full(2, edge / 144))


def parts(shape: Shape, frames: int = 1, exemplar: Elements | None = None, seed: int = 1) -> tuple:
    exemplar = exemplar or arrangement.hexagonal_grid((6, 6))
    period = (exemplar.box[1] - exemplar.box[0]).astype(float)
    within = search.exemplar(exemplar, shape, period=period)
    start = initialize.points(exemplar, square(), frames, shape.radius, 1.0, seed)
    return within, start


@pytest.mark.parametrize("solver", ["sparse", "local"])
def test_the_energy_falls_and_the_arrangement_becomes_the_exemplars(solver: str) -> None:
    within, start = parts(Shape(2.0, sigma=4.0, most=20))
    rng = np.random.Generator(np.random.Philox(key=1))
    shaken = Elements(start.elements.positions + rng.normal(0, 0.2, start.elements.positions.shape))
    run = list(synthesis.together(within, shaken, start.source, Controls(Constraints(square())),
                                  Settings(iterations=8, coherent=False, solver=solver)))
    energies = run[-1].energies
    assert energies[-1] < 0.8 * energies[0]
    assert all(b < 1.02 * a for a, b in itertools.pairwise(energies))

    def away(elements: Elements) -> float:
        given = fidelity.statistics(within.elements.positions, 0.8, within.elements.box[1].astype(float))
        found = fidelity.statistics(elements.positions, 0.8, depth=square().distance)
        return fidelity.difference(given.correlation, found.correlation)

    assert away(run[-1].result()) < 0.8 * away(shaken)


def test_hard_positions_and_the_domain_are_kept() -> None:
    within, start = parts(Shape(2.0))
    pins = Pins(np.array([0]), np.array([5]), np.array([[4.0, 4.0]]))
    *_, last = synthesis.together(within, start.elements, start.source, Controls(Constraints(square(), 0.4, pins)),
                                  Settings(iterations=3, coherent=False))
    points = last.result().positions[0, :, 0]
    assert np.allclose(points[5], 4.0)
    assert square().distance(np.delete(points, 5, axis=0)).min() > 0.39


def drift(frames: int) -> Elements:
    """A cloud that breathes: every element swings to and fro, neighbours alike."""
    exemplar = arrangement.poisson_disk((7, 7), seed=3)
    phase = 2 * np.pi * (np.arange(frames)[:, None] / frames + exemplar.positions[0, :, 0, 0] / 7)
    swing = 0.25 * np.stack([np.sin(phase), np.cos(phase)], axis=-1)[:, :, None]
    return Elements(exemplar.positions + swing, box=exemplar.box)


def test_all_frames_together_keep_the_motion_without_jitter() -> None:
    example = drift(24)
    within, start = parts(Shape(1.8, before=3, after=3), 24, example)
    *_, last = synthesis.together(within, start.elements, start.source, Controls(Constraints(square(), hard=False)),
                                  Settings(iterations=5, coherent=True))
    found, given = last.result().positions, example.positions
    assert np.diff(found, axis=0).std() == pytest.approx(np.diff(given, axis=0).std(), rel=0.2)
    assert fidelity.jitter(found) < 2 * fidelity.jitter(given)


def test_smooth_synthesis_has_at_most_half_the_jitter_of_the_basic_one() -> None:
    """§4.2 on a small exemplar in a flow: two matches, falloff, and motion that counts."""
    exemplar = arrangement.jittered_grid((5, 5), seed=2)
    period = (exemplar.box[1] - exemplar.box[0]).astype(float)

    def flow(t: int, points: np.ndarray) -> np.ndarray:
        away = points - 4.5
        return 0.02 * np.stack([-away[:, 1], away[:, 0]], axis=-1) * np.exp(-(away**2).sum(axis=1) / 12)[:, None]

    found = {}
    for n, shape in ((1, Shape(1.8, 1, 1, at_rest=1.0)), (2, Shape(1.8, 1, 1, sigma=1.8**2))):
        within = search.exemplar(exemplar, shape, period=period)
        start = initialize.carried(initialize.points(exemplar, square(), 12, 1.8, 1.0, 1), flow)
        *_, last = synthesis.together(within, start.elements, start.source, Controls(Constraints(square()), flow),
                                      Settings(iterations=5, n=n, coherent=False))
        found[n] = last.result().positions
    assert fidelity.jitter(found[2]) < 0.5 * fidelity.jitter(found[1])
    way, wish = np.diff(found[2], axis=0)[:, :, 0], np.stack([flow(0, p[:, 0]) for p in found[2][:-1]])
    assert np.sum(way * wish) > 0.85 * np.sum(wish * wish), "the flow is followed"


def test_frame_by_frame_the_flow_carries_the_elements() -> None:
    within, start = parts(Shape(2.0, sigma=4.0))
    controls = Controls(Constraints(square()), flow=lambda t, points: np.tile([0.05, 0.0], (len(points), 1)),
                    period=np.array([9.0, 0.0]))
    *_, last = synthesis.by_frames(within, start.elements, start.source, 5, controls,
                                   Settings(iterations=2, coherent=False))
    step = np.diff(last.result().positions[:, :, 0, 0], axis=0)
    assert abs(np.median(step) - 0.05) < 0.02


def test_frame_by_frame_knows_no_later_frames() -> None:
    within, start = parts(Shape(2.0, before=1, after=1), exemplar=drift(6))
    with pytest.raises(ValueError, match="no frames after its own"):
        next(synthesis.by_frames(within, start.elements, start.source, 2, Controls(), Settings()))


def test_the_hybrid_has_fewer_collisions() -> None:
    within, start = parts(Shape(2.0, sigma=4.0), exemplar=arrangement.poisson_disk((6, 6), seed=4))
    radius = np.full(start.elements.count, 0.5)
    counts = []
    for hybrid in (False, True):
        elements = Elements(start.elements.positions, size=radius)
        *_, last = synthesis.together(within, elements, start.source, Controls(Constraints(square(), 0.5)),
                                      Settings(iterations=4, coherent=False, hybrid=hybrid))
        points = last.result().positions[0, :, 0]
        _, _, depth = collision.overlaps(points, radius, np.arange(len(points)))
        counts.append(int((depth > 0.05).sum()))
    assert counts[0] >= 5 and counts[1] <= 0.7 * counts[0]


@pytest.mark.parametrize("sequence", ["together", "frames"])
def test_an_interrupted_run_goes_on_with_the_same_bits(sequence: str) -> None:
    shape = Shape(1.8, before=2, after=2 if sequence == "together" else 0)
    within, start = parts(shape, 5 if sequence == "together" else 1, drift(8))
    settings, controls = Settings(iterations=2), Controls(Constraints(square(), hard=False))

    def run(kept: dict | None = None) -> list:
        if sequence == "together":
            made = synthesis.together(within, start.elements, start.source, controls, settings, kept)
        else:
            made = synthesis.by_frames(within, start.elements, start.source, 5, controls, settings, kept)
        return [{name: np.array(v) for name, v in o.state().items()} for o in made]

    whole = run()
    for done in (0, len(whole) - 1):  # the last one too: stopped when all was done but the file
        rest = run(whole[done])
        assert len(rest) == len(whole) - done
        assert (rest[-1]["positions"] == whole[-1]["positions"]).all()
    other = parts(shape, 5 if sequence == "together" else 1, drift(8), seed=9)
    bad = {**whole[0], "sample": whole[0]["sample"][:-1]}
    with pytest.raises(ValueError, match="another output"):
        next(synthesis.together(*other[:1], other[1].elements, other[1].source, controls, settings, bad))


def test_threads_follow_their_coarse_positions() -> None:
    s = np.arange(10.0) * 0.5
    coarse = np.zeros((8, 5, 10, 3))
    coarse[..., 2] = s
    coarse[..., 0] = np.arange(5)[:, None]
    rng = np.random.Generator(np.random.Philox(key=5))
    phase = rng.uniform(0, 6, 5)[:, None] + s + 0.4 * np.arange(8)[:, None, None]
    wavy = coarse + 0.2 * np.stack([np.sin(phase), np.cos(phase), 0 * phase], axis=-1)
    example = Elements(wavy, (10,), coarse=coarse)
    bent = np.zeros((8, 9, 10, 3))
    bent[..., 0], bent[..., 2] = np.sin(s / 3) * 4, np.cos(s / 3) * 4
    bent[..., 1] = np.arange(9)[:, None]
    inner, outer = orientation.along_threads(coarse), orientation.along_threads(bent)
    within = search.exemplar(example, Shape(1.5, before=2, after=2, along=2, most=6), inner)
    start = initialize.on_coarse(example, bent, inner, outer, 3, 1, 24.0)
    *_, last = synthesis.together(within, start.elements, start.source, Controls(axes=outer), Settings(iterations=3))
    found = last.result()
    away = np.linalg.norm(found.positions - bent, axis=-1)
    assert 0.1 < away.mean() < 0.35 and away.max() < 1.0
    length = np.linalg.norm(np.diff(found.positions, axis=2), axis=-1)
    assert length.min() > 0.35 and length.max() < 0.75
    detail = neighborhood.details(found, outer)
    assert np.sqrt(np.mean(detail**2)) == pytest.approx(np.sqrt(np.mean(within.detail**2)), rel=0.2)


def digest() -> str:
    """SHA-256 of a small animation: what the subprocesses below print."""
    within, start = parts(Shape(1.8, before=2, after=2), 6, drift(8))
    controls = Controls(Constraints(square()))
    *_, last = synthesis.together(within, start.elements, start.source, controls, Settings(iterations=2))
    return hashlib.sha256(last.result().positions.tobytes()).hexdigest()


def test_the_same_bits_at_any_number_of_threads(tmp_path: Path) -> None:
    assert len(processes.digests(__file__, tmp_path)) == 1
