"""The stages: synth, bake, render and figure. Each makes the products of its folder that are not yet whole.

What runs after what stands in one table, `products`; a file's key is made of the scene values it depends on, the
sources that compute it and the hashes of the files it is made from. So an interrupted run goes on from the last
whole file, a changed ω re-bakes and does not re-synthesize, and variants share all that they do not change.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from pipeline import elements, fields, geometry, manifest, obstacles, panels, sources
from pipeline.errors import BadInput, StorageFailed, WrongValue
from pipeline.manifest import Entry, Folder
from pipeline.product import Product, Scene, Stock
from pipeline.progress import Progress
from pipeline.scene import Scenes, folder_name
from pipeline.schema import Scene as MotionScene

VERBS = ("synth", "bake", "render", "figure")


def products(scene: Scene) -> dict[str, Product]:
    """All products of a scene, by name, each after those it is made from."""
    if isinstance(scene, MotionScene):
        made = (*obstacles.products(scene), *fields.products(scene), *geometry.products(scene), *panels.products(scene))
    else:
        made = (*obstacles.products(scene), *elements.products(scene))
    return {p.name: p for p in made}


class Works:
    """All products of a scene file under one output root: where they are, which are whole, how to make them."""

    def __init__(self, scenes: Scenes, out: Path):
        self.scenes = scenes
        self.root = out / "quick" / scenes.name if scenes.quick else out / scenes.name
        self.products = {variant: products(scene) for variant, scene in scenes.variants.items()}
        self._folders: dict[Path, Folder] = {}
        self._keys: dict[tuple[Path, str], str] = {}
        self._chains: dict[tuple[Path, str], list[str]] = {}
        self._plans: dict[tuple[str, str], str] = {}

    # -- where ----------------------------------------------------------------------------------------------

    def plan(self, variant: str, name: str) -> str:
        """Equal for two variants exactly if their product `name` has the same content."""
        if (variant, name) not in self._plans:
            product = self.products[variant][name]
            inputs = [self.plan(variant, other) for other, _ in product.inputs]
            self._plans[variant, name] = manifest.digest([product.tables(self.scenes.variants[variant]), inputs])
        return self._plans[variant, name]

    def makers(self, name: str) -> list[str]:
        """The variants that make `name`, one for each different content: the first that has it."""
        first: dict[str, str] = {}
        for variant in self.scenes.variants:
            if name in self.products[variant]:
                first.setdefault(self.plan(variant, name), variant)
        return list(first.values())

    def folder(self, variant: str, name: str) -> Folder:
        """out/X/<folder>, or out/X/<folder>/<variant> where the variants differ in this product."""
        product, makers = self.products[variant][name], self.makers(name)
        path = self.root / product.folder
        if len(makers) > 1:
            path /= folder_name(next(v for v in makers if self.plan(v, name) == self.plan(variant, name)))
        if path not in self._folders:  # opening one reads all its entries
            self._folders[path] = Folder(path)
        return self._folders[path]

    def file(self, variant: str, name: str, frame: int) -> Path:
        """Where a frame of a product is, or will be."""
        return self.folder(variant, name).path / self.products[variant][name].file(self.scenes.variants[variant], frame)

    # -- whether it is whole ------------------------------------------------------------------------------------

    def entry(self, variant: str, name: str, frame: int) -> Entry | None:
        """The entry of a frame that is whole and up to date."""
        key = self.key(variant, name, frame)
        file = self.file(variant, name, frame)
        return self.folder(variant, name).whole(file.name, key) if key else None

    def key(self, variant: str, name: str, frame: int) -> str | None:
        """What a frame's content depends on; None if an input is not whole yet."""
        file = self.file(variant, name, frame)
        if (file.parent, file.name) not in self._keys:
            product = self.products[variant][name]
            hashes = []
            for other, which in product.inputs:
                if which in ("until", "every"):
                    last = frame if which == "until" else self.scenes.variants[variant].frames
                    hashes.append(self._chain(variant, other, last))
                else:
                    entry = self.entry(variant, other, frame if which == "same" else 0)
                    hashes.append(entry.sha256 if entry else None)
            if None in hashes:
                return None
            tables = product.tables(self.scenes.variants[variant])
            code = sources.digest(product.make.__module__, product.methods)
            self._keys[file.parent, file.name] = manifest.digest([name, frame, tables, code, hashes])
        return self._keys[file.parent, file.name]

    def _chain(self, variant: str, name: str, frame: int) -> str | None:
        """One hash of the frames 1 to `frame`."""
        chain = self._chains.setdefault((self.folder(variant, name).path, name), [""])
        while len(chain) <= frame:
            entry = self.entry(variant, name, len(chain))
            if not entry:
                return None
            chain.append(manifest.digest([chain[-1], entry.sha256]))
        return chain[frame]

    def stock(self, variant: str, name: str) -> Stock:
        """What the product may read."""
        return _Stock(self, variant, self.products[variant][name])

    def missing(self, variant: str, name: str, frames: Iterable[int]) -> list[int]:
        """Those of `frames` that are not whole."""
        return [frame for frame in frames if not self.entry(variant, name, frame)]

    def require(self, variant: str, name: str, frame: int) -> Entry:
        """The entry of a frame; BadInput if it is not whole, with the command that makes it."""
        entry = self.entry(variant, name, frame)
        if not entry:
            product = self.products[variant][name]
            reason = f"is not there yet: run flowloom {product.stage} on this scene first"
            raise BadInput(self.scenes.file, product.file(self.scenes.variants[variant], frame), reason)
        return entry

    def require_memory(self, stage: str, frames: Sequence[int] | None) -> None:
        """Refuse what is missing of a stage and too large for this machine, before anything is allocated."""
        there = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
        for variant, products in self.products.items():
            scene = self.scenes.variants[variant]
            for product in products.values():
                if product.stage != stage or product.memory is None:
                    continue
                if not self.missing(variant, product.name, frames or product.frames(scene)):
                    continue
                needed, key = product.memory(scene)
                if needed > there:
                    size = "×".join(map(str, scene.cells))
                    raise StorageFailed(f"{self.scenes.file}: {key}", f"{product.name} on {size} cells needs "
                                        f"{needed / 1e9:,.0f} GB of memory; this machine has {there / 1e9:,.0f} GB")

    # -- making -------------------------------------------------------------------------------------------------

    def make(self, stage: str, frames: Sequence[int] | None, progress: Progress) -> None:
        """Make what is not whole of a stage's products, all frames or `frames`; then write the manifests.

        Raises BadInput if a stage before it has not been run.
        """
        names = self._in_order(stage)
        self._check_foreign_files(names)
        for name in names:
            for variant in self.makers(name):
                self._make(variant, name, frames, progress)
        self._close(stage)

    def _in_order(self, stage: str) -> list[str]:
        """The names of a stage's products in all variants, each after those that it is made from in any."""
        names: list[str] = []
        inputs: dict[str, dict[str, None]] = {}
        for products in self.products.values():
            for product in products.values():
                inputs.setdefault(product.name, {}).update(dict.fromkeys(other for other, _ in product.inputs))

        def place(name: str) -> None:
            for other in inputs[name]:
                place(other)
            if name not in names and any(
                    name in products and products[name].stage == stage for products in self.products.values()):
                names.append(name)

        for name in inputs:
            place(name)
        return names

    def _check_foreign_files(self, names: Iterable[str]) -> None:
        """Read every file of the user's that is still needed, and check what else can be, before anything is written.
        """
        for name in names:
            for variant in self.makers(name):
                product, scene = self.products[variant][name], self.scenes.variants[variant]
                first = product.check is None and not product.inputs and product.reads_files(scene)
                missing = self.missing(variant, name, product.frames(scene)) if first or product.check else []
                if not missing:
                    continue
                with self._blaming(product):
                    if product.check:
                        product.check(scene)
                    else:
                        next(product.make(scene, self.stock(variant, name), missing[:1]))

    @contextmanager
    def _blaming(self, product: Product) -> Iterator[None]:
        """The methods raise ValueError for values that do not do; the schema cannot know all of those."""
        try:
            yield
        except ValueError as error:
            key = error.key if isinstance(error, WrongValue) else product.reads[0]
            raise BadInput(self.scenes.file, key, str(error)) from error

    def _make(self, variant: str, name: str, frames: Sequence[int] | None, progress: Progress) -> None:
        product, scene = self.products[variant][name], self.scenes.variants[variant]
        wanted = [f for f in product.frames(scene) if frames is None or not product.animated or f in frames]
        if product.export and not product.animated and frames is not None and scene.frames not in frames:
            return  # nothing reads it: of several batches of frames the last one makes it
        for other, which in product.inputs:
            needed = {"same": wanted, "until": range(1, max(wanted, default=0) + 1), "once": [0],
                      "every": range(1, scene.frames + 1)}
            for frame in needed[which]:
                self.require(variant, other, frame)
        missing = self.missing(variant, name, wanted)
        if not missing:
            return
        label = f"{product.stage} {name}" + (f" ({variant})" if len(self.makers(name)) > 1 else "")
        folder = self.folder(variant, name)
        stock = self.stock(variant, name)
        with self._blaming(product), progress.task(label, len(wanted), len(wanted) - len(missing)) as advance:
            for frame, value in product.make(scene, stock, missing):
                file = self.file(variant, name, frame)
                product.write(file, value, scene)
                folder.add(file.name, stock.key(frame))
                advance()

    def _close(self, stage: str) -> None:
        """Write the manifest of each folder of the stage that is whole, and drop folders of variants of the past."""
        expected: dict[Path, dict[str, str | None]] = {}
        for variant, made in self.products.items():
            for name, product in made.items():
                if product.stage == stage:
                    keys = expected.setdefault(self.folder(variant, name).path, {})
                    for frame in product.frames(self.scenes.variants[variant]):
                        keys[self.file(variant, name, frame).name] = self.key(variant, name, frame)
        for path, keys in expected.items():
            known = {name: key for name, key in keys.items() if key}
            if len(known) == len(keys):
                self._folders[path].close(known, {"scene": self.scenes.name, "stage": stage})
        for noun in {path.relative_to(self.root).parts[0] for path in expected}:
            for path in (self.root / noun, *(self.root / noun).glob("*/")):
                # the folder of notes holds the manifest that work in progress has set aside
                past = path not in expected and path.name != manifest.NOTES
                if past and (path / manifest.MANIFEST).exists():
                    Folder(path).discard()


class _Stock:
    """product.Stock of one product of one variant."""

    def __init__(self, works: Works, variant: str, product: Product):
        self._works, self._variant, self._product = works, variant, product

    def read(self, product: str, frame: int = 0) -> Any:
        works = self._works
        scene = works.scenes.variants[self._variant]
        return works.products[self._variant][product].read(works.file(self._variant, product, frame), scene)

    def own(self, frame: int) -> Any | None:
        whole = self._works.entry(self._variant, self._product.name, frame)
        return self.read(self._product.name, frame) if whole else None

    def key(self, frame: int) -> str:
        return self._works.key(self._variant, self._product.name, frame) or ""

    @property
    def work(self) -> Path:
        return self._works.folder(self._variant, self._product.name).path / manifest.NOTES


def run(verb: str, scenes: Scenes, out: Path, progress: Progress, frames: Sequence[int] | None = None) -> None:
    """Run a stage; without `frames`, the stages before it first, as far as they are not up to date."""
    works = Works(scenes, out)
    verbs = VERBS[: VERBS.index(verb) + 1] if frames is None else [verb]
    for stage in verbs:
        works.require_memory(stage, frames)
    for stage in verbs:
        if stage == "figure":
            from pipeline import figure

            figure.make(works, progress)
        else:
            works.make(stage, frames, progress)
