from pathlib import Path

import pytest

from bench import results, targets

MACHINE = {"processor": "AMD EPYC", "cores": 2, "load when it began": 0.1,
           "device": "AMD EPYC (PoCL 3.1  Linux, None+Asserts, RELOC)"}
FASTER = {f"{dims} dimensions": {"ours": 0.09, "FAISS": 0.11, "ratio": 0.82, "same match": 1.0} for dims in (32, 64)}
SLOWER = {"32 dimensions": {"ours": 0.33, "FAISS": 0.11, "ratio": 3.0, "same match": 1.0}}


def outside(page: str, part: str) -> tuple[str, str]:
    """What stands before and after the section of a part."""
    before, rest = page.split(f"<!-- part: {part} -->")
    return before, rest.split(f"<!-- end of {part} -->")[1]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    page = tmp_path / "RESULTS.md"
    page.write_text(results.skeleton() + "\nwritten by hand, with  two spaces and no line end", encoding="utf-8")
    return page


def test_a_part_is_replaced_and_every_other_byte_stays(path: Path) -> None:
    before = path.read_text(encoding="utf-8")
    for found, ratio in ((FASTER, "0.82"), (SLOWER, "3.00")):
        results.write("search", found, MACHINE, "abc1234", "2026-11-29", path)
        after = path.read_text(encoding="utf-8")
        assert outside(after, "search") == outside(before, "search")
        assert ratio in after
        assert ("Measured 2026-11-29 at revision abc1234.\nAMD EPYC, 2 cores, load 0.1 when it began; OpenCL device "
                "AMD EPYC (PoCL 3.1 Linux).\n") in after
    assert "0.82" not in after, "the section of the first run is still there"


def test_an_unknown_part_is_refused_and_nothing_is_written(path: Path) -> None:
    before = path.read_bytes()
    for part in ("serach", "figures", "earlier"):  # a slip; and what no run measures
        with pytest.raises(ValueError, match=f"no part is called '{part}'"):
            results.write(part, FASTER, MACHINE, "abc1234", "2026-11-29", path)
    with pytest.raises(ValueError, match="there are synthesis, search"):
        results.replaced(path.read_text(encoding="utf-8"), "serach", "")
    assert path.read_bytes() == before


def test_a_missing_end_marker_costs_no_other_section(path: Path) -> None:
    whole = path.read_text(encoding="utf-8")
    broken = whole.replace("<!-- end of search -->\n", "")
    mended = results.replaced(broken, "search", results.placeholder("search"))
    assert mended == whole
    # of its neighbour: the section that is replaced is still found, the broken one stays as it was
    other = results.replaced(broken, "density", "new")
    assert outside(other, "density") == outside(broken, "density")


def test_a_section_that_is_missing_is_inserted_in_its_place(path: Path) -> None:
    whole = path.read_text(encoding="utf-8")
    section = results.between_markers("search", results.placeholder("search"))
    without = whole.replace(f"{section}\n\n", "")
    assert section not in without
    assert results.replaced(without, "search", results.placeholder("search")) == whole


def test_a_file_cut_in_the_middle_keeps_what_it_has(path: Path) -> None:
    whole = path.read_text(encoding="utf-8")
    cut = whole[:whole.index("run `python -m bench density`")]
    kept = cut[:cut.index("<!-- part: density -->")]
    mended = results.replaced(cut, "density", "new")
    assert mended == f"{kept}<!-- part: density -->\nnew\n<!-- end of density -->\n"
    assert results.replaced(mended, "repeat", "next").startswith(mended.rstrip())


def test_without_a_file_a_whole_page_is_written(tmp_path: Path) -> None:
    results.write("search", FASTER, MACHINE, "abc1234", "2026-11-29", tmp_path / "RESULTS.md")
    page = (tmp_path / "RESULTS.md").read_text(encoding="utf-8")
    assert [page.count(f"<!-- part: {part} -->") for part in results.PARTS] == [1] * len(results.PARTS)
    assert page.count("Not measured yet with this revision") == len(results.PARTS) - 1


def test_a_missed_target_says_so_in_its_row_and_above_the_table() -> None:
    missed = results.section("search", targets.ROWS["search"](SLOWER), [], MACHINE, "abc1234", "2026-11-29")
    assert "**1 of 1 targets MISSED.**" in missed
    assert "| ≤ 1.5 of FAISS's time | MISSED | FAISS flat index: 0.110 s |" in missed
    met = results.section("search", targets.ROWS["search"](FASTER), [], MACHINE, "abc1234", "2026-11-29")
    assert met.count("| met |") == 2
    assert "MISSED" not in met


def test_limits_are_met_at_the_limit_and_missed_beyond_it() -> None:
    assert [targets.at_most("", "", value, 1.5).verdict for value in (1.5, 1.501)] == ["met", "MISSED"]
    assert [targets.at_least("", "", value, 10).verdict for value in (10, 9.9)] == ["met", "MISSED"]
    assert targets.at_most("", "", float("nan"), 1.5).verdict == "MISSED"


def test_a_row_without_a_target_says_so() -> None:
    row = targets.without_target("peak memory", "3.2 GB")
    assert row.cells == ("peak memory", "3.2 GB", "no target", "", "not reported")
    assert "| no target |  | not reported |" in results.section("search", [row], [], MACHINE, "abc1234", "2026-11-29")


def test_tables_set_numbers_to_the_right_and_keep_bars_apart() -> None:
    table = results.markdown(["name", "distance", "met"], [["a|b", 0.25, True], ["c", None, False]])
    assert table.splitlines() == ["| name | distance | met |", "| --- | ---: | --- |", "| a\\|b | 0.25 | met |",
                                  "| c |  | MISSED |"]


def test_the_page_in_the_repository_has_every_section_once_and_whole() -> None:
    page = results.RESULTS.read_text(encoding="utf-8")
    starts = [page.find(f"<!-- part: {name} -->") for name in results.SECTIONS]
    assert min(starts) >= 0
    assert starts == sorted(starts)
    for name in results.SECTIONS:
        assert page.count(f"<!-- part: {name} -->") == page.count(f"<!-- end of {name} -->") == 1
