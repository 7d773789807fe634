"""The time to go is honest, and short to read."""

import pytest

from pipeline.progress import Progress, remaining, spelled


def test_frames_that_were_there_before_make_nothing_look_faster() -> None:
    # 40 of 90 frames were there; this run made 10 in 20 s: the other 40 take 80 s
    assert remaining(20.0, 10, 90 - 40 - 10) == 80.0


@pytest.mark.parametrize(("seconds", "text"), [
    (0.4, "0 s"), (59.6, "60 s"), (89, "89 s"), (90, "2 min"), (600, "10 min"), (3 * 3600 + 290, "3 h 05 min"),
    (5399, "1 h 30 min"), (86400, "24 h 00 min"),
])
def test_a_duration_reads_well(seconds: float, text: str) -> None:
    assert spelled(seconds) == text


def test_it_is_silent_where_no_terminal_is(capsys: pytest.CaptureFixture[str]) -> None:
    with Progress().task("synth H", 3) as advance:
        advance()
    assert capsys.readouterr() == ("", "")


def test_a_note_is_told_also_in_a_log_but_not_to_who_wants_quiet(capsys: pytest.CaptureFixture[str]) -> None:
    Progress().note("x.toml: clips: few")
    Progress(quiet=True).note("x.toml: clips: none")
    assert capsys.readouterr().err == "x.toml: clips: few\n"
