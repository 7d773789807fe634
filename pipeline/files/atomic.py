"""How every file comes into being: written under a unique name in its own folder, synced, renamed.

At any moment, killed however, a path holds its old content or its new content, or nothing: never half a file.
What killed runs leave behind is removed by the next run that writes into the folder.
"""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
import socket
import time
from collections.abc import Iterator
from pathlib import Path

from pipeline.errors import StorageFailed

SUFFIX = ".partial"
ABANDONED_SECONDS = 24 * 3600.0  # another host's temporary of this age: its process cannot be asked
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


def _temporary(path: Path) -> Path:
    """A name no other process chooses: `.density.0001.vdb.node7.4711-9f3c21aa.partial`."""
    host = socket.gethostname().replace("-", "_")
    return path.with_name(f".{path.name}.{host}.{os.getpid()}-{secrets.token_hex(4)}{SUFFIX}")


def _is_abandoned(temporary: Path) -> bool:
    """Whether no living process of this host writes it, or it is very old."""
    try:
        age = time.time() - temporary.stat().st_mtime
        owner, _, _ = temporary.name.removesuffix(SUFFIX).rpartition("-")
        host, _, process = owner.rpartition(".")
        here = host.endswith("." + socket.gethostname().replace("-", "_"))
        return age > ABANDONED_SECONDS or (here and not Path("/proc", str(int(process))).exists())
    except (OSError, ValueError):  # gone meanwhile, or no temporary of ours
        return False


def sweep(folder: Path) -> None:
    """Remove the temporaries of killed runs from `folder`; those of living processes stay."""
    for temporary in folder.glob(f".*{SUFFIX}"):
        if _is_abandoned(temporary):
            with contextlib.suppress(OSError):  # another user's, in a shared folder
                temporary.unlink()


def _sync(path: Path) -> None:
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def storage_failure(path: Path, error: OSError) -> StorageFailed:
    """The one line for an error of the file system; a full disk is called by its name."""
    reason = error.strerror or str(error)
    if error.errno in _FULL:
        reason = f"the disk is full ({reason}); free some space and run the same command again"
    return StorageFailed(path, reason)


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """`with replacing(path) as temporary:` write and check `temporary`; it is then renamed to `path`.

    The folder is made if it is missing. On any error, Ctrl-C and termination included, the temporary is
    removed and `path` stays as it was. An OSError becomes `StorageFailed`.
    """
    temporary = _temporary(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        sweep(path.parent)
        yield temporary
        _sync(temporary)
        os.replace(temporary, path)
        _sync(path.parent)
    except OSError as error:
        temporary.unlink(missing_ok=True)
        raise storage_failure(path, error) from error
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def write_bytes(path: Path, content: bytes) -> None:
    """Replace the content of `path` as a whole."""
    with replacing(path) as temporary:
        temporary.write_bytes(content)


def write_text(path: Path, content: str) -> None:
    """Replace the content of `path` as a whole, in UTF-8."""
    write_bytes(path, content.encode())
