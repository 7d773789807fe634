"""The build graph of a scene file: all artifacts of all its variants, which are up to date, and making the others.

A file's key is made of the scene values it depends on, the code that computes it and the hashes of the files it is made
from (`keys`). So an interrupted run goes on from the last complete file, a changed ω re-bakes and does not
re-synthesize, and variants share all that they do not change.
"""

from __future__ import annotations

import graphlib
import os
import re
import unicodedata
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from pipeline.build import keys, manifest
from pipeline.build.artifact import FOLDERS, Artifact
from pipeline.build.checkpoint import Checkpoint, OwnFrames
from pipeline.build.manifest import Entry, Folder
from pipeline.build.method import Method
from pipeline.build.view import SceneView, Undeclared, value_at
from pipeline.errors import BadInput, InvalidValue, StorageFailed
from pipeline.progress import Progress


def folder_name(name: str) -> str:
    """The folder of a variant: "ω = 15" is kept in omega-15."""
    greek = (unicodedata.name(c, "").split()[-1] if "GREEK" in unicodedata.name(c, "") else c for c in name)
    return re.sub(r"[^a-z0-9.]+", "-", "".join(greek).lower()).strip("-.")


class BuildGraph:
    """All artifacts of a scene file: where they are, which are up to date, how to make them.

    file      the scene file, which its stem names
    variants  its scenes by name; one named "" where it has no variants
    out       the output root: artifacts lie in out/<name>/<folder>, with `quick` in out/quick/<name>/<folder>, those
              that belong to no scene in out/shared/<artifact>-<content>
    """

    def __init__(self, method: Method, file: Path, variants: Mapping[str, Any], out: Path, quick: bool = False):
        self.method, self.file_of_scene, self.variants = method, file, variants
        self.root = (out / "quick" if quick else out) / file.stem
        self.shared = out / "shared"
        self.artifacts = {name: {a.name: a for a in method.artifacts(scene)} for name, scene in variants.items()}
        self._folders: dict[Path, Folder] = {}
        self._keys: dict[tuple[Path, str], str] = {}
        self._chains: dict[tuple[Path, str], list[str]] = {}
        self._content: dict[tuple[str, str], str] = {}
        self._constant: dict[tuple[str, str], str] = {}

    @property
    def name(self) -> str:
        """The scene file's stem, which names the make target, the output folder and the pictures."""
        return self.file_of_scene.stem

    # -- where ----------------------------------------------------------------------------------------------

    def content_id(self, variant: str, name: str) -> str:
        """Equal for two variants exactly if their artifact `name` has the same content."""
        if (variant, name) not in self._content:
            artifact = self.artifacts[variant][name]
            inputs = [self.content_id(variant, other) for other, _ in artifact.inputs]
            self._content[variant, name] = keys.content_id(artifact, self.variants[variant], inputs)
        return self._content[variant, name]

    def distinct_variants(self, name: str) -> list[str]:
        """The variants that make `name`, one for each different content: the first that has it."""
        first: dict[str, str] = {}
        for variant in self.variants:
            if name in self.artifacts[variant]:
                first.setdefault(self.content_id(variant, name), variant)
        return list(first.values())

    def folder(self, variant: str, name: str) -> Folder:
        """The folder of an artifact, in it one for each variant where the variants differ in this artifact."""
        artifact, content = self.artifacts[variant][name], self.content_id(variant, name)
        if artifact.shared:
            path = self.shared / f"{name}-{content[:16]}"
        else:
            path, distinct = self.root / FOLDERS[artifact.stage], self.distinct_variants(name)
            if len(distinct) > 1:
                path /= folder_name(next(v for v in distinct if self.content_id(v, name) == content))
        if path not in self._folders:  # opening one reads all its entries
            self._folders[path] = Folder(path)
        return self._folders[path]

    def file(self, variant: str, name: str, frame: int) -> Path:
        """Where a frame of an artifact is, or will be."""
        return self.folder(variant, name).path / self.artifacts[variant][name].file(frame)

    # -- whether it is up to date -------------------------------------------------------------------------------

    def entry(self, variant: str, name: str, frame: int) -> Entry | None:
        """The entry of a frame that is intact and up to date."""
        key = self.key(variant, name, frame)
        file = self.file(variant, name, frame)
        return self.folder(variant, name).up_to_date(file.name, key) if key else None

    def key(self, variant: str, name: str, frame: int) -> str | None:
        """What a frame's content depends on; None if an input is not up to date yet."""
        file = self.file(variant, name, frame)
        if (file.parent, file.name) not in self._keys:
            artifact, scene = self.artifacts[variant][name], self.variants[variant]
            hashes = [self._input_hash(variant, other, which, frame) for other, which in artifact.inputs]
            known = [sha256 for sha256 in hashes if sha256]
            if len(known) < len(hashes):
                return None
            if (variant, name) not in self._constant:
                self._constant[variant, name] = keys.constant(artifact, scene, self.artifacts[variant])
            self._keys[file.parent, file.name] = keys.key(self._constant[variant, name], frame, known)
        return self._keys[file.parent, file.name]

    def _input_hash(self, variant: str, name: str, which: str, frame: int) -> str | None:
        """One hash of the frames of an input that `frame` needs."""
        if which in ("until", "every"):
            return self._chain(variant, name, frame if which == "until" else self.variants[variant].frames)
        entry = self.entry(variant, name, frame if which == "same" else 0)
        return entry.sha256 if entry else None

    def _chain(self, variant: str, name: str, frame: int) -> str | None:
        """One hash of the frames 1 to `frame`."""
        chain = self._chains.setdefault((self.folder(variant, name).path, name), [""])
        while len(chain) <= frame:
            entry = self.entry(variant, name, len(chain))
            if not entry:
                return None
            chain.append(manifest.digest([chain[-1], entry.sha256]))
        return chain[frame]

    def missing(self, variant: str, name: str, frames: Iterable[int]) -> list[int]:
        """Those of `frames` that are not up to date."""
        return [frame for frame in frames if not self.entry(variant, name, frame)]

    def require(self, variant: str, name: str, frame: int) -> Entry:
        """The entry of a frame; BadInput if it is not up to date, with the command that makes it."""
        entry = self.entry(variant, name, frame)
        if not entry:
            artifact = self.artifacts[variant][name]
            raise BadInput(self.file_of_scene, artifact.file(frame),
                           f"is not there yet: run flowloom {artifact.stage} on this scene first")
        return entry

    def read(self, variant: str, name: str, frame: int) -> Any:
        """The value of a frame that is up to date."""
        return self.artifacts[variant][name].format.read(self.file(variant, name, frame))

    def require_memory(self, stage: str, frames: Sequence[int] | None) -> None:
        """Refuse what is missing of a stage and too large for this machine, before anything is allocated."""
        there = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
        for variant, artifacts in self.artifacts.items():
            scene = self.variants[variant]
            for artifact in artifacts.values():
                if artifact.stage != stage or artifact.memory is None:
                    continue
                if not self.missing(variant, artifact.name, frames or artifact.frames(scene)):
                    continue
                needed, key = artifact.memory(scene)
                if needed > there:
                    size = "×".join(map(str, scene.cells))
                    raise StorageFailed(f"{self.file_of_scene}: {key}", f"{artifact.name} on {size} cells needs "
                                        f"{needed / 1e9:,.0f} GB of memory; this machine has {there / 1e9:,.0f} GB")

    # -- making -------------------------------------------------------------------------------------------------

    def make(self, stage: str, frames: Sequence[int] | None, progress: Progress) -> None:
        """Make what is not up to date of a stage's artifacts, all frames or `frames`; then write the manifests.

        Raises BadInput if a stage before it has not been run.
        """
        for name in self._in_order(stage):
            for variant in self.distinct_variants(name):
                self._make(variant, name, frames, progress)
        self._close(stage)

    def _in_order(self, stage: str) -> list[str]:
        """The names of a stage's artifacts, each after those that any variant makes it from."""
        before: dict[str, list[str]] = {}
        for artifact in (one for artifacts in self.artifacts.values() for one in artifacts.values()):
            if artifact.stage == stage:
                before.setdefault(artifact.name, []).extend(name for name, _ in artifact.inputs)
        return [name for name in graphlib.TopologicalSorter(before).static_order() if name in before]

    def check(self, stage: str) -> None:
        """Read every file of the user's that a stage still needs, and check what else can be, before any work."""
        for name in self._in_order(stage):
            for variant in self.distinct_variants(name):
                artifact, scene = self.artifacts[variant][name], self.variants[variant]
                first = artifact.check is None and not artifact.inputs and keys.reads_files(artifact, scene)
                missing = self.missing(variant, name, artifact.frames(scene)) if first or artifact.check else []
                if not missing:
                    continue
                with self._attributed_to(artifact):
                    if artifact.check:
                        artifact.check(scene)
                    else:
                        next(self.run(variant, name, missing[:1]))

    @contextmanager
    def _attributed_to(self, artifact: Artifact) -> Iterator[None]:
        """The methods raise ValueError for values that cannot be used; the schema cannot know all of those."""
        try:
            yield
        except ValueError as error:
            key = error.key if isinstance(error, InvalidValue) else next(iter(artifact.reads), artifact.name)
            raise BadInput(self.file_of_scene, key, str(error)) from error

    def run(self, variant: str, name: str, frames: Sequence[int]) -> Iterator[tuple[int, Any]]:
        """Compute frames of an artifact from its inputs; what it reads and does not declare raises Undeclared."""
        artifact = self.artifacts[variant][name]
        return computed(artifact, self.variants[variant], DeclaredInputs(self, variant, artifact), frames)

    def _make(self, variant: str, name: str, frames: Sequence[int] | None, progress: Progress) -> None:
        artifact, scene = self.artifacts[variant][name], self.variants[variant]
        asked = [f for f in artifact.frames(scene) if frames is None or not artifact.animated or f in frames]
        if artifact.export and not artifact.animated and frames is not None and scene.frames not in frames:
            return  # nothing reads it: of several batches of frames the last one makes it
        for other, which in artifact.inputs:
            needed = {"same": asked, "until": range(1, max(asked, default=0) + 1), "once": [0],
                      "every": range(1, scene.frames + 1)}
            for frame in needed[which]:
                self.require(variant, other, frame)
        missing = self.missing(variant, name, asked)
        if not missing:
            return
        label = f"{artifact.stage} {name}" + (f" ({variant})" if len(self.distinct_variants(name)) > 1 else "")
        folder, notes = self.folder(variant, name), []
        with self._attributed_to(artifact), progress.task(label, len(asked), len(asked) - len(missing)) as advance:
            for frame, value in self.run(variant, name, missing):
                file = self.file(variant, name, frame)
                artifact.format.save(file, value)
                folder.add(file.name, self.key(variant, name, frame) or "")
                notes.append(artifact.note(scene, value) if artifact.note else "")
                advance()
        for note in filter(None, notes):  # after the bar, which it would break
            progress.note(f"{self.file_of_scene}: {note}")

    def _close(self, stage: str) -> None:
        """Write the manifest of each complete folder of the stage, and remove the folders of former variants."""
        expected: dict[Path, dict[str, str | None]] = {}
        for variant, artifacts in self.artifacts.items():
            for name, artifact in artifacts.items():
                if artifact.stage == stage:
                    wanted = expected.setdefault(self.folder(variant, name).path, {})
                    for frame in artifact.frames(self.variants[variant]):
                        wanted[self.file(variant, name, frame).name] = self.key(variant, name, frame)
        for path, wanted in expected.items():
            known = {name: key for name, key in wanted.items() if key}
            if len(known) == len(wanted):
                owner = {} if path.parent == self.shared else {"scene": self.name}
                self._folders[path].close(known, {**owner, "stage": stage})
        for noun in {path.relative_to(self.root).parts[0] for path in expected if path.parent != self.shared}:
            for path in (self.root / noun, *(self.root / noun).glob("*/")):
                # the journal holds the manifest that work in progress has set aside
                former = path not in expected and path.name != manifest.JOURNAL
                if former and (path / manifest.MANIFEST).exists():
                    Folder(path).discard()


def computed(artifact: Artifact, scene: Any, inputs: DeclaredInputs, frames: Sequence[int],
             ) -> Iterator[tuple[int, Any]]:
    """Run an artifact's `make` on a view of the scene: (frame, value) for each of `frames`."""
    table = getattr(artifact.make, "__self__", None)
    if table is not None and not isinstance(table, type) and all(
            value_at(scene, read) is not table for read in artifact.reads):
        raise Undeclared(f"{artifact.name} is made by a table of the scene that it does not declare")
    made = artifact.make(SceneView(scene, artifact.reads, artifact.name), inputs, list(frames), **artifact.arguments)
    for frame in frames:
        inputs.current = frame
        if artifact.check_frame:
            artifact.check_frame(scene, inputs, frame)
        found, value = next(made, (None, None))
        if found != frame:
            raise RuntimeError(f"{artifact.name} yields frame {found} instead of {frame}")
        yield frame, value


class DeclaredInputs:
    """The inputs of one artifact of one variant: artifact.Inputs, which raises Undeclared at any other file."""

    def __init__(self, graph: BuildGraph, variant: str, artifact: Artifact):
        self._graph, self._variant, self._artifact = graph, variant, artifact
        self.current = 0  # the frame in work

    def __contains__(self, name: str) -> bool:
        return name in dict(self._artifact.inputs)

    def read(self, name: str, frame: int = 0) -> Any:
        which = dict(self._artifact.inputs).get(name)
        allowed = {"same": frame == self.current, "until": 0 < frame <= self.current, "once": frame == 0,
                   "every": 0 < frame <= self._graph.variants[self._variant].frames}
        if which is None or not allowed[which]:
            raise Undeclared(f"{self._artifact.name} reads {name} of frame {frame} for frame {self.current}, "
                             f"which it does not declare ({which or 'not an input'})")
        return self._value(name, frame)

    def _value(self, name: str, frame: int) -> Any:
        """The value of a frame of an input, from its file."""
        return self._graph.read(self._variant, name, frame)

    @property
    def checkpoint(self) -> Checkpoint:
        graph, variant, name = self._graph, self._variant, self._artifact.name
        if self._artifact.state_is_frame:
            return OwnFrames(lambda frame: graph.read(variant, name, frame)
                             if graph.entry(variant, name, frame) else None)
        file = graph.folder(variant, name).path / manifest.JOURNAL / f"{name}.state.npz"
        return Checkpoint(file, lambda frame: graph.key(variant, name, frame) or "")
