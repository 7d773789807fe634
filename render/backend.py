"""The only module that imports Mitsuba and Dr.Jit: which LLVM they use, which folder their plug-ins come from.

It works around two problems. Mitsuba looks for plug-ins in the working directory first, and loads any library
it finds there; `mitsuba` removes that folder from the search path before anything is instantiated. Dr.Jit
accepts LLVM 15 and 16 and then aborts the process on a real render; `llvm_library` accepts a candidate only
after a child process has rendered with it.

Run as a script (`python backend.py VARIANT [LIBRARY]`), this file is that child process.
"""

from __future__ import annotations

import functools
import hashlib
import importlib.metadata
import json
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

OLDEST_LLVM = 17  # 14 is refused by Dr.Jit; 15 and 16 abort with "Cannot select … fminimum"
PREFERRED_LLVM = 19  # Debian's libllvm19, which made every reference picture
REMEDY = "install Debian's libllvm19 (apt-get install libllvm19)"
LIBRARY_FOLDERS = tuple(
    folder for pattern in ("*-linux-gnu", "llvm-*/lib") for folder in sorted(Path("/usr/lib").glob(pattern))
)
PROOF_SECONDS = 120.0  # a cold trial takes about one second, on a busy farm node longer


class RenderUnavailable(RuntimeError):
    """Mitsuba cannot render here; the message is one line that says what to install."""


def version_in_name(library: Path) -> int:
    """The LLVM version in a file name (`libLLVM-15.so.1`, `libLLVM.so.19.1`), 0 if there is none."""
    found = re.search(r"libLLVM(?:-|\.so\.)(\d+)", library.name)
    return int(found[1]) if found else 0


def candidates(folders: tuple[Path, ...] = LIBRARY_FOLDERS) -> list[Path]:
    """The LLVM libraries to try, best first: 19, then newer ones, then 18 and 17; each file once.

    `DRJIT_LIBLLVM_PATH`, where the user has set it, is the only candidate.
    """
    chosen = os.environ.get("DRJIT_LIBLLVM_PATH", "")
    if chosen:
        return [Path(chosen)]
    found = {p.resolve() for folder in folders for p in folder.glob("libLLVM[-.]*so*")}
    usable = [p for p in found if version_in_name(p) >= OLDEST_LLVM]

    def rank(library: Path) -> tuple[bool, int, str]:
        version = version_in_name(library)
        return version != PREFERRED_LLVM, -version, str(library)

    return sorted(usable, key=rank)


def proven(variant: str, library: Path | None = None) -> str:
    """Renders a small volume in a child process; returns "" on success, else the reason in one line."""
    with tempfile.TemporaryDirectory(prefix="flowloom-proof-") as folder:
        # an empty kernel cache: kernels compiled by another LLVM would hide that this one fails
        environment = os.environ | {"DRJIT_CACHE_DIR": folder}
        command = [sys.executable, "-I", __file__, variant, *([str(library)] if library else [])]
        try:
            child = subprocess.run(
                command, cwd=folder, env=environment, capture_output=True, text=True,
                timeout=PROOF_SECONDS, check=False,
            )
        except subprocess.TimeoutExpired:
            return f"no picture after {PROOF_SECONDS:.0f} s"
    if child.returncode == 0:
        return ""
    lines = [line.strip() for line in child.stderr.splitlines() if line.strip()]
    reason = next((line for line in lines if "LLVM" in line), lines[-1] if lines else "no message")
    ended = f"signal {-child.returncode}" if child.returncode < 0 else f"exit {child.returncode}"
    return f"{reason[:160]} ({ended})"


def _verdict_file(library: Path) -> Path:
    """The marker of a proven library; its name depends on the library's file and the versions of Mitsuba and Dr.Jit."""
    state = library.stat()
    versions = [importlib.metadata.version(name) for name in ("mitsuba", "drjit")]
    key = json.dumps([str(library), state.st_size, state.st_mtime_ns, *versions])
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "flowloom"
    return cache / f"llvm-{hashlib.sha256(key.encode()).hexdigest()[:16]}"


def _proven_once(library: Path) -> str:
    """`proven`, cached on disk; only success is cached, as a failure may be temporary."""
    try:
        verdict = _verdict_file(library)
    except OSError as error:
        return f"cannot be read ({error.strerror})"
    except ImportError as error:
        return f"mitsuba is not installed ({error}); run make setup"
    if verdict.exists():
        return ""
    reason = proven("llvm_ad_rgb", library)
    if not reason:
        try:
            verdict.parent.mkdir(parents=True, exist_ok=True)
            verdict.touch()
        except OSError:
            pass  # a read-only home directory: the trial is repeated next time
    return reason


@functools.cache
def llvm_library() -> Path:
    """The LLVM library that Dr.Jit renders with; raises `RenderUnavailable` if none here can."""
    reasons = []
    for library in candidates():
        if 0 < version_in_name(library.resolve()) < OLDEST_LLVM:
            reason = f"LLVM {version_in_name(library.resolve())} is too old"
        else:
            reason = _proven_once(library)
        if not reason:
            return library
        reasons.append(f"{library}: {reason}")
    found = "; ".join(reasons) if reasons else f"no LLVM {OLDEST_LLVM} or newer"
    unset = "unset DRJIT_LIBLLVM_PATH or " if os.environ.get("DRJIT_LIBLLVM_PATH") else ""
    raise RenderUnavailable(f"{found}; {unset}{REMEDY}")


def _load(variant: str, library: Path | None) -> Any:
    """Imports Mitsuba with Dr.Jit on `library`, excludes the working directory and sets the variant."""
    if library:
        os.environ["DRJIT_LIBLLVM_PATH"] = str(library)
    try:
        import mitsuba
    except ImportError as error:
        raise RenderUnavailable(f"mitsuba cannot be loaded ({error}); run make setup") from error
    resolver = mitsuba.file_resolver()
    resolver.clear()
    resolver.append(str(Path(mitsuba.__file__).parent))
    mitsuba.set_variant(variant)
    # the command line reports an interrupted render, in one line
    mitsuba.set_log_level(mitsuba.LogLevel.Error)
    return mitsuba


def mitsuba(variant: str) -> Any:
    """The mitsuba module with `variant` set: "scalar_rgb", or "llvm_ad_rgb" on a proven LLVM.

    The variant is a property of the whole process: the last call wins. Never fork afterwards (the children
    hang): start processes with spawn or subprocess. Raises `RenderUnavailable`.
    """
    library: Path | None = None
    try:
        # also for scalar variants: Dr.Jit reads the path once, at its import, and llvm may be requested later
        library = llvm_library()
    except RenderUnavailable:
        if variant.startswith("llvm"):
            raise
    return _load(variant, library)


def drjit() -> Any:
    """The drjit module of the loaded `mitsuba`."""
    import drjit as loaded

    return loaded


def versions(variant: str) -> dict[str, str]:
    """The versions that a picture's bits depend on: variant, Mitsuba, Dr.Jit and (llvm variants) LLVM."""
    loaded = mitsuba(variant)
    import drjit

    result = {"variant": variant, "mitsuba": str(loaded.__version__), "drjit": drjit.__version__}
    if variant.startswith("llvm"):
        result["llvm"] = ".".join(map(str, drjit.detail.llvm_version()))
    return result


def _proof(variant: str, library: Path | None) -> None:
    """Renders 8 x 8 pixels of a grid volume in constant light: every instruction that volpath needs."""
    import numpy as np

    mi = _load(variant, library)
    grid = np.random.default_rng(1).random((4, 4, 4, 1), dtype=np.float32)
    camera = mi.ScalarTransform4f().look_at(origin=[0.5, 0.5, 4], target=[0.5, 0.5, 0.5], up=[0, 1, 0])
    medium = {
        "type": "heterogeneous",
        "albedo": 0.9,
        "sigma_t": {"type": "gridvolume", "grid": mi.VolumeGrid(grid)},
    }
    film = {"type": "hdrfilm", "width": 8, "height": 8, "rfilter": {"type": "box"}}
    scene = mi.load_dict({
        "type": "scene",
        "integrator": {"type": "volpath", "max_depth": 4},
        "sensor": {"type": "perspective", "to_world": camera, "film": film},
        "light": {"type": "constant"},
        "smoke": {"type": "cube", "bsdf": {"type": "null"}, "interior": medium},
    })
    mean = float(np.array(mi.render(scene, spp=4, seed=1)).mean())
    if not 0.5 < mean < 1.0:  # white light, a little of it absorbed
        raise SystemExit(f"the proof picture is wrong: mean {mean}")


if __name__ == "__main__":
    _proof(sys.argv[1], Path(sys.argv[2]) if len(sys.argv) > 2 else None)
