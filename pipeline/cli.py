"""The command line: one command per stage, and commands for what surrounds them.

Exit codes: 0 done, 1 differs (diff), 2 bad input, 3 the environment lacks something, 4 storage or memory,
130 interrupted, 143 terminated; 70 is a fault of flowloom itself, with its traceback.
Heavy modules are imported inside the commands, so `flowloom --help` is instant.
"""

from __future__ import annotations

import errno
import os
import signal
import sys
import threading
import traceback
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import App, CycloptsError, Parameter

from pipeline.errors import BadInput, EnvironmentMissing, FlowloomError, StorageFailed, Terminated

if TYPE_CHECKING:
    from collections.abc import Sequence

FAULT = 70  # EX_SOFTWARE of sysexits.h
OUT = Path("out")
STOPPED: dict[int, str] = {signal.SIGINT: "interrupted", signal.SIGTERM: "terminated"}
GO_ON = "run the same command again to go on from the last complete frame"
OURS = ("pipeline", "synth", "render")

app = App(
    name="flowloom",
    help="Motion by example: from a small exemplar and a coarse motion to volumes, pictures and figures.",
    version_flags=[],
    help_format="plaintext",  # markdown would load rich.markdown, a quarter of a second
    result_action="return_value",
    suppress_keyboard_interrupt=False,
)

SceneFile = Annotated[Path, Parameter(help="The scene, a TOML file.")]
SceneFiles = Annotated[Path, Parameter(help="Scenes, TOML files; without any, all the project's.")]
Quick = Annotated[bool, Parameter(negative="", help="Small and fast: the scene's [quick] overrides; writes OUT/quick.")]
Out = Annotated[Path, Parameter(help="Where X/fields, X/geometry, X/images and X.png are written.")]
Quiet = Annotated[bool, Parameter(negative="", help="No progress.")]
FrameRange = Annotated[str | None, Parameter(help="Only these, as 1-10,20,30-40x2; the stages before must be done.")]


def _run(stage: str, scene: Path, quick: bool, out: Path, quiet: bool, frames: str | None = None) -> None:
    from pipeline import stages
    from pipeline.frame_ranges import frames as parsed
    from pipeline.progress import Progress
    from pipeline.scene import load

    scenes = load(scene, quick)
    last = max(s.frames for s in scenes.variants.values())
    stages.run(stage, scenes, out, Progress(quiet), parsed(frames, last) if frames is not None else None)


@app.command
def synth(scene: SceneFile, /, *, quick: Quick = False, out: Out = OUT, quiet: Quiet = False) -> None:
    """Synthesize motion, fields or elements, into OUT/X/fields."""
    _run("synth", scene, quick, out, quiet)


@app.command
def bake(scene: SceneFile, /, *, frames: FrameRange = None, quick: Quick = False, out: Out = OUT,
         quiet: Quiet = False) -> None:
    """Bake the motion into volumes, meshes and points, in world units, into OUT/X/geometry."""
    _run("bake", scene, quick, out, quiet, frames)


@app.command
def render(scene: SceneFile, /, *, frames: FrameRange = None, quick: Quick = False, out: Out = OUT,
           quiet: Quiet = False) -> None:
    """Render the frames and what the figure needs into OUT/X/images."""
    _run("render", scene, quick, out, quiet, frames)


@app.command
def figure(scene: SceneFile, /, *, quick: Quick = False, out: Out = OUT, quiet: Quiet = False) -> None:
    """Set the figure: OUT/X/X.png and OUT/X/X.mp4, running whatever stage is not up to date."""
    _run("figure", scene, quick, out, quiet)


@app.command
def diff(*scenes: SceneFiles, out: Out = OUT, quiet: Quiet = False) -> int:
    """Check that scenes still give, at their quick settings, what their references keep; else exit 1."""
    from pipeline import diff as checking
    from pipeline import references as keeping
    from pipeline import stages
    from pipeline.listing import project_scenes
    from pipeline.progress import Progress
    from pipeline.scene import load

    differs = False
    for scene in scenes or project_scenes():
        loaded, record = load(scene, quick=True), keeping.record_of(scene)
        lines = checking.check(stages.run("bake", loaded, out, Progress(quiet)), record)
        print(*(lines or [f"{scene.stem}: the same"]), sep="\n")
        differs = differs or bool(lines)
    return int(differs)


@app.command
def references(*scenes: SceneFiles, out: Out = OUT, quiet: Quiet = False) -> None:
    """Keep what scenes give at their quick settings as the references that `diff` compares with."""
    from pipeline import references as keeping
    from pipeline import stages
    from pipeline.listing import project_scenes
    from pipeline.progress import Progress
    from pipeline.scene import load

    for scene in scenes or project_scenes():
        print(keeping.write(stages.run("bake", load(scene, quick=True), out, Progress(quiet))))


@app.command
def doctor() -> None:
    """Try what a render needs, each in a child process: what was found, and what to do about what is missing."""
    from pipeline import doctor as examination

    examination.run()


@app.command
def gallery(*, out: Out = OUT) -> None:
    """Write OUT/gallery.html: every figure there is, with its animation."""
    from pipeline import gallery as exhibition

    print(exhibition.write(out))


@app.command
def schema(*, write: Annotated[bool, Parameter(negative="", help="Write them into the project's scenes folder.")]
           = False) -> None:
    """Print the JSON Schema of scenes, by which an editor completes and checks them."""
    from pipeline import schema as page

    if write:
        page.write()
    else:
        print(page.json_schema())


clips = App(name="clips", help="Clips of the database of photographs that flow: your own and those that are made.")
app.command(clips)
Library = Annotated[Path, Parameter(name="--into", help="The folder of clips of your own.")]
OWN_CLIPS = Path("clips")


@clips.command
def add(*files: Annotated[Path, Parameter(help="Videos of fluids, by a fixed camera, without a cut.")],
        library: Library = OWN_CLIPS, quiet: Quiet = False) -> int:
    """Check videos and keep them as clips in a folder, which scenes name as clips.library; exit 2 if one is no use."""
    from pipeline.photo.library import add as kept
    from pipeline.progress import Progress

    if not files:
        raise BadInput("clips add", "", "names no video")
    refused = 0
    with Progress(quiet).task("clips add", len(files)) as advance:
        for file in files:
            try:
                entry, is_new = kept(file, library)
                print(f"{file}: {'is now' if is_new else 'is already'} {library / entry.name}")
            except BadInput as error:
                refused = _say(str(error), error.exit_code)
            advance()
    return refused


@clips.command(name="list")
def list_clips(*, library: Library = OWN_CLIPS) -> None:
    """List the families that are made, and the clips of your own: frames, size, speed, share that moves."""
    from pipeline.photo import library as keeping

    print(keeping.made_line())
    for line in keeping.lines(library):
        print(line)


@clips.command
def sheet(scene: Annotated[Path | None, Parameter(help="A scene, whose clips are shown.")] = None, /, *,
          library: Annotated[Path | None, Parameter(name="--into", help="A folder of clips, which are shown.")] = None,
          png: Annotated[Path, Parameter(name="--out", help="The file to write.")] = Path("clips.png"),
          quick: Quick = False, quiet: Quiet = False) -> None:
    """Write a contact sheet of clips: of a scene, of a folder of your own, or without either of all that are made."""
    from pipeline import stages
    from pipeline.photo import sheet as page
    from pipeline.progress import Progress
    from pipeline.scene import load

    if scene is not None and library is not None:
        raise BadInput("clips sheet", "", "shows a scene or a folder, not both")
    if scene is not None:
        shown = page.of_scene(stages.graph_of(load(scene, quick), OUT), Progress(quiet))
    else:
        shown = page.of_catalogue(Progress(quiet)) if library is None else page.of_library(library)
    page.write(png, shown)
    print(png)


@app.command(name="list")
def list_(folder: Annotated[Path | None, Parameter(help="A folder of scenes; else the project's.")] = None, /, *,
          out: Out = OUT) -> None:
    """List the scenes of a folder: name, source, title, and whether its figure is there."""
    from pipeline.listing import lines

    for line in lines(folder, out):
        print(line)


@app.command
def farm(scene: SceneFile, /, *, workers: Annotated[int, Parameter(help="Processes at a time.")] = 2,
         batch: Annotated[int, Parameter(help="Frames per process.")] = 10,
         dry_run: Annotated[bool, Parameter(negative="", help="Only print the commands, for a farm of your own.")]
         = False, quick: Quick = False, out: Out = OUT, quiet: Quiet = False) -> None:
    """Run the stages in batches of frames on several processes of this machine."""
    from pipeline import farm as farming

    farming.run(scene, workers, batch, quick, out, quiet, dry_run)


GRACE = 5.0  # seconds
_ending = threading.Event()


def _terminated(_signal: int, _frame: Any) -> None:
    raise Terminated


def _handle_signals() -> None:
    """SIGINT and SIGTERM end the work cleanly, and within a few seconds even in the middle of a long render.

    Python runs its handlers between two of its own instructions, so not while Mitsuba renders, and drops what they
    raise in a callback of a library. Where the work has not ended by itself after GRACE, the process ends at once:
    no file is ever half there, and the temporary of one that was being written is removed by the next run.
    """
    signal.signal(signal.SIGTERM, _terminated)
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    signal.set_wakeup_fd(writer, warn_on_full_buffer=False)

    def watch() -> None:
        while number := os.read(reader, 1):
            if number[0] in STOPPED and not _ending.wait(GRACE):
                if sys.stderr.isatty():
                    sys.stderr.write("\x1b[?25h")  # the progress hides the cursor
                os._exit(_say(f"{STOPPED[number[0]]}; {GO_ON}", 128 + number[0]))

    threading.Thread(target=watch, daemon=True).start()


def main(arguments: Sequence[str] | None = None) -> None:
    """Run a command and exit with its code; every foreseen failure is one line on stderr."""
    _handle_signals()
    sys.exit(run(sys.argv[1:] if arguments is None else list(arguments)))


def run(arguments: list[str]) -> int:
    """Run a command; its exit code."""
    try:
        code = app(arguments, exit_on_error=False, print_error=False) or 0
        sys.stdout.flush()  # a pipe that is closed is noticed here, not while Python exits
        return code
    except CycloptsError as error:
        return _say(f"{error}; flowloom --help shows what there is", 2)
    except FlowloomError as error:
        return _say(str(error), error.exit_code)
    except (KeyboardInterrupt, Terminated) as stop:
        _ending.set()
        number = signal.SIGTERM if isinstance(stop, Terminated) else signal.SIGINT
        return _say(f"{STOPPED[number]}; {GO_ON}", 128 + number)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # else Python complains at exit
        return 0
    except Exception as error:
        known = foreseen(error)
        if known is None:
            traceback.print_exc()
            return _say("flowloom: this is a fault of flowloom; please report it with the lines above", FAULT)
        return _say(str(known), known.exit_code)


def foreseen(error: Exception) -> FlowloomError | None:
    """The failure behind an exception that came from a library: memory, storage or the environment."""
    kind = type(error).__name__
    if isinstance(error, MemoryError) or "OUT_OF_" in str(error) or "bad_alloc" in str(error):
        return StorageFailed("memory", "not enough; try --quick, a smaller size, or close other programs")
    if kind in ("OpenCLUnavailable", "RenderUnavailable"):
        return EnvironmentMissing(f"{error}; flowloom doctor shows more")
    if isinstance(error, ImportError) and (error.name or "").split(".")[0] not in OURS:
        return EnvironmentMissing(f"{error}; run make setup, or flowloom doctor to see what is missing")
    if isinstance(error, OSError) and error.errno in (
            errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EROFS, errno.EACCES, errno.EPERM, errno.ENOTDIR,
            errno.EISDIR, errno.EMFILE, errno.ENAMETOOLONG):
        return StorageFailed(error.filename or "storage", error.strerror or str(error))
    return None


def _say(line: str, code: int) -> int:
    print(" ".join(line.split()), file=sys.stderr)
    return code


if __name__ == "__main__":
    main()
