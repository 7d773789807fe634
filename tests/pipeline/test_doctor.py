"""The doctor says what works and what does not, and survives whatever a trial does."""

import importlib.util
import os
from pathlib import Path
from types import ModuleType

import pytest

from pipeline import doctor
from pipeline.errors import EnvironmentMissing
from pipeline.files import volumes
from render import backend

TRIALS = """
import os, sys, time
from pathlib import Path
def fine(): print("noise"); Path("litter").touch(); return "a device"
def broken(): raise RuntimeError("first line\\nthe reason")
def dead(): os.abort()
def silent(): time.sleep(60)
def quits(): sys.exit(0)
"""


@pytest.fixture
def trials(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """A module of trials that the child finds too."""
    (tmp_path / "trials.py").write_text(TRIALS)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    spec = importlib.util.spec_from_file_location("trials", tmp_path / "trials.py")
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_a_trial_is_judged_from_outside(trials: ModuleType, tmp_path: Path,
                                        monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    before = sorted(os.listdir())
    assert doctor.tried(doctor.Trial("a", trials.fine)) == (True, "a device")
    assert doctor.tried(doctor.Trial("a", trials.broken)) == (False, "the reason")
    assert doctor.tried(doctor.Trial("a", trials.dead)) == (False, "ended by SIGABRT")
    assert doctor.tried(doctor.Trial("a", trials.quits))[0] is False
    assert doctor.tried(doctor.Trial("a", trials.silent), seconds=1) == (False, "no answer after 1 s")
    assert sorted(os.listdir()) == before, "a trial leaves nothing where the user stands"


def test_one_line_each_and_exit_code_3(trials: ModuleType, monkeypatch: pytest.MonkeyPatch,
                                       capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(doctor, "TRIALS", (doctor.Trial("one", trials.fine),
                                           doctor.Trial("two", trials.broken, "apt-get install x"),
                                           doctor.Trial("three", trials.dead)))
    with pytest.raises(EnvironmentMissing, match="missing: two; three") as caught:
        doctor.run()
    assert caught.value.exit_code == 3
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == ["ok", "MISSING", "MISSING"]
    assert lines[0].endswith("a device")
    assert lines[1].endswith("the reason; to fix it: apt-get install x")


def test_this_machine_is_well(capsys: pytest.CaptureFixture[str]) -> None:
    doctor.run()
    told = capsys.readouterr().out
    assert len(told.splitlines()) == len(doctor.TRIALS)
    assert f"({backend.llvm_library()})" in told
    assert f"OpenVDB {volumes.library_version()}" in told
    assert "OpenEXR 3.5.3" in told


def test_no_opencl_and_only_old_llvm_are_said(monkeypatch: pytest.MonkeyPatch) -> None:
    by_name = {trial.name: trial for trial in doctor.TRIALS}
    monkeypatch.setenv("OCL_ICD_VENDORS", "/nowhere")
    works, told = doctor.tried(by_name["OpenCL"])
    assert not works and "OpenCL" in told
    assert "pocl-opencl-icd" in by_name["OpenCL"].remedy
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", "/usr/lib/x86_64-linux-gnu/libLLVM-15.so.1")
    works, told = doctor.tried(by_name["Mitsuba, LLVM"])
    assert not works and "LLVM 15 is too old" in told and "libllvm19" in told
    assert doctor.tried(by_name["Mitsuba, scalar"])[0], "the scalar variant needs no LLVM"
