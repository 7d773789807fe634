"""What can go wrong for a user, and the exit code of each.

0 done, 1 differs (`flowloom diff`), 2 bad input, 3 the environment lacks something, 4 storage or memory,
130 interrupted (SIGINT), 143 terminated (SIGTERM); 70 is a fault of flowloom itself. Each error is one line on stderr.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


class FlowloomError(Exception):
    """An error with an exit code; its text is the one line the user reads."""

    exit_code: int


class BadInput(FlowloomError):
    """A scene, or a file it names, cannot be used: `file: key: reason`."""

    exit_code = 2

    def __init__(self, file: Path | str, key: str, reason: str):
        self.file, self.key, self.reason = file, key, reason
        super().__init__(": ".join(str(part) for part in (file, key, reason) if str(part)))


class InvalidValue(ValueError):
    """A value of a scene that a method refuses: its dotted key, and the reason."""

    def __init__(self, key: str, reason: str):
        self.key = key
        super().__init__(reason)


@contextmanager
def attributed_to(key: str) -> Iterator[None]:
    """A ValueError inside is an InvalidValue of this key of the scene."""
    try:
        yield
    except InvalidValue:
        raise
    except ValueError as error:
        raise InvalidValue(key, str(error)) from error


class EnvironmentMissing(FlowloomError):
    """The machine lacks what the work needs; the text says what, and what to do about it."""

    exit_code = 3


class StorageFailed(FlowloomError):
    """A file could not be written or read back intact, or memory ran out: `file: reason`."""

    exit_code = 4

    def __init__(self, file: Path | str, reason: str):
        self.file, self.reason = file, reason
        super().__init__(f"{file}: {reason}")


class Terminated(BaseException):
    """SIGTERM: raised in the main thread so that open work is closed cleanly (as KeyboardInterrupt is)."""
