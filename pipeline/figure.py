"""The figure: panels, labels, legends, as one still X.png and one animation X.mp4.

A scene without variants has its panels in one row (or rows of `figure.columns`). With variants and one panel,
that panel stands once for each variant; with several panels, each variant has a row.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from pipeline import manifest, panels, sources
from pipeline.elements_schema import ElementsScene
from pipeline.files import pictures, video
from pipeline.product import Product, Scene
from pipeline.progress import Progress
from pipeline.schema import is_of_exemplar

if TYPE_CHECKING:
    from pipeline.stages import Works

LABELS = {
    "input": "input", "exemplar": "exemplar *I*", "exemplar-colour": "exemplar *I*", "exemplar-arrows": "exemplar *I*",
    "coarse": "coarse motion *L*", "coarse-colour": "coarse motion *L*", "detail": "detail *H′*",
    "detail-colour": "detail *H′*", "detail-arrows": "detail *H′*",
    "detail-divergence": "divergence of *H′*", "combined": "*F* = *L* + *ωH′*",
    "combined-colour": "*F* = *L* + *ωH′*", "result": "result",
}
INSET = 0.27  # of a panel's width
METHODS = ("render.layout", "render.tonemap", "render.lic")


def make(works: Works, progress: Progress) -> None:
    """Set X.png and X.mp4, unless they are whole. The images must be."""
    scenes = list(works.scenes.variants.values())
    last = max(scene.frames for scene in scenes)
    still = scenes[0].figure.frame or last
    folder = manifest.Folder(works.root)
    png, mp4 = f"{works.scenes.name}.png", f"{works.scenes.name}.mp4"
    keys = {png: _key(works, [still], still=True)}
    if scenes[0].figure.animation:
        keys[mp4] = _key(works, range(1, last + 1))
    if not folder.whole(png, keys[png]):
        pictures.write(works.root / png, sheet(works, still, still=True))
        folder.add(png, keys[png])
    if mp4 in keys and not folder.whole(mp4, keys[mp4]):
        with progress.task("figure", last) as advance:

            def sheets() -> Iterator[np.ndarray]:
                for frame in range(1, last + 1):
                    yield sheet(works, frame)
                    advance()

            video.write(works.root / mp4, sheets(), scenes[0].fps)
        folder.add(mp4, keys[mp4])
    folder.close(keys, {"scene": works.scenes.name, "stage": "figure"})


def _key(works: Works, frames: Any, still: bool = False) -> str:
    """What a figure of these frames depends on."""
    shown = [works.scenes.variants[variant].figure.model_dump() for variant in works.scenes.variants]
    hashes = []
    for variant, panel in _places(works):
        product = _product(works, variant, panel, still)
        scene = works.scenes.variants[variant]
        inset = ["exemplar-picture"] if getattr(scene.figure, "inset", False) else []
        for frame in dict.fromkeys(_frame(product.animated, scene, f) for f in frames):
            hashes += [works.require(variant, name, frame).sha256 for name in [product.name, *inset]]
    kinds = [scene.render.kind for scene in works.scenes.variants.values()]
    names = list(works.scenes.variants)
    fps = next(iter(works.scenes.variants.values())).fps
    return manifest.digest([shown, names, kinds, fps, hashes, sources.digest(__name__, METHODS)])


def _frame(animated: bool, scene: Scene, frame: int) -> int:
    """The frame of a product to show: an animation that is shorter than another stands still at its end."""
    return min(frame, scene.frames) if animated else 0


def _places(works: Works) -> list[tuple[str, panels.Shown]]:
    """(variant, panel) of the figure, in reading order."""
    return [(variant, panel) for variant, scene in works.scenes.variants.items() for panel in panels.shown(scene)]


def _product(works: Works, variant: str, panel: panels.Shown, still: bool) -> Product:
    """The product that a panel shows, in the animation or in the still."""
    made = works.products[variant]
    return made["still"] if still and panel.panel == "result" and "still" in made else made[panel.picture]


def sheet(works: Works, frame: int, still: bool = False) -> np.ndarray:
    """The figure at a frame, (h, w, 3) uint8 sRGB: as the animation shows it, or as the still does."""
    from render import layout

    scenes = works.scenes.variants
    first = next(iter(scenes.values()))
    several = len(scenes) > 1 or "" not in scenes
    shown = []
    for variant, panel in _places(works):
        label = _label(scenes[variant], panel)
        if several:
            label = variant if panel == panels.shown(scenes[variant])[0] else label
        shown.append(_panel(works, variant, panel, frame, still, label))
    if several and len(panels.shown(first)) > 1:
        columns = len(panels.shown(first))
    else:
        columns = first.figure.columns or len(shown)
    rows = [shown[start:start + columns] for start in range(0, len(shown), columns)]
    return layout.figure(rows)


def _label(scene: Scene, panel: panels.Shown) -> str:
    labels = scene.figure.labels
    if labels:
        return labels[panels.shown(scene).index(panel)]
    if panel.panel == "coarse" and isinstance(scene, ElementsScene) and not scene.flows:
        return "coarse motion *C*"
    return LABELS[panel.panel] + (f", {panel.view}" if panel.view else "")


def _panel(works: Works, variant: str, panel: panels.Shown, frame: int, still: bool, label: str) -> Any:
    from render import layout, lic, tonemap

    scene = works.scenes.variants[variant]
    product = _product(works, variant, panel, still)
    file = works.file(variant, product.name, _frame(product.animated, scene, frame))
    light = product.read(file, scene)
    width = _width(scene, panel)
    shown = layout.fitted(tonemap.to_display(light, _tone(scene, panel)), width)
    legend = lic.wheel(width // 6) if panel.style == "colour" else None
    return layout.Panel(shown, label, inset=_inset(works, variant, panel, frame), legend=legend)


def _tone(scene: Scene, panel: panels.Shown) -> Literal["filmic", "straight"]:
    """How light becomes display values: pictures of things as film does, pictures of fields as they were drawn."""
    if isinstance(scene, ElementsScene):
        return "straight" if panel.panel == "coarse" and scene.flows else "filmic"
    return "filmic" if panel.panel == "result" and scene.render.kind != "ink" else "straight"


def _inset(works: Works, variant: str, panel: panels.Shown, frame: int) -> np.ndarray | None:
    """The exemplar, in a corner of the result."""
    from render import layout, tonemap

    scene = works.scenes.variants[variant]
    if not isinstance(scene, ElementsScene) or not scene.figure.inset or panel.panel != "result":
        return None
    product = works.products[variant]["exemplar-picture"]
    light = product.read(works.file(variant, product.name, _frame(product.animated, scene, frame)), scene)
    return layout.fitted(tonemap.to_display(light, "filmic"), round(INSET * scene.figure.panel))


def _width(scene: Scene, panel: panels.Shown) -> int:
    """Pixels across a panel: figure.panel, but an exemplar is no higher than a result that is wider than high."""
    render: Any = scene.render
    whole = scene.figure.panel
    if isinstance(scene, ElementsScene):
        return whole // 2 if panel.panel == "exemplar" else whole
    if not is_of_exemplar(panel.panel) or "result" not in scene.figure.panels or not hasattr(render, "height"):
        return whole
    return min(whole, round(whole * render.height / render.width))
