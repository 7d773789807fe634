"""OpenCL's one home: device, build, launch; with no device one clear line."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from synth import opencl

ROOT = Path(__file__).parents[2]


@pytest.fixture
def source(tmp_path):
    path = tmp_path / "scaled.cl"
    path.write_text("kernel void scaled(global float *a, const float factor)"
                    " { a[get_global_id(0)] *= factor * TIMES; }")
    return path


def test_a_kernel_runs_on_device_arrays_and_scalars(source):
    a = opencl.to_device(np.arange(6, dtype=np.float32))
    opencl.program(source, TIMES=2).scaled((6,), None, a, np.float32(0.5))
    np.testing.assert_array_equal(a.get(), np.arange(6))


def test_one_program_per_set_of_defines(source):
    assert opencl.program(source, TIMES=2) is opencl.program(source, TIMES=2)
    assert opencl.program(source, TIMES=2) is not opencl.program(source, TIMES=3)
    for times in (2, 3):  # PoCL's cache once served one define's kernel for the other's
        a = opencl.to_device(np.ones(4, np.float32))
        opencl.program(source, TIMES=times).scaled((4,), None, a, np.float32(1))
        np.testing.assert_array_equal(a.get(), times)


def test_device_arrays_are_copies_in_c_order():
    a = np.arange(6, dtype=np.float32).reshape(2, 3)
    device = opencl.to_device(a.T)
    a[:] = -1
    np.testing.assert_array_equal(device.get(), [[0, 3], [1, 4], [2, 5]])
    np.testing.assert_array_equal(opencl.zeros((2, 3)).get(), np.zeros((2, 3), np.float32))
    assert opencl.empty((2, 3), np.int32).get().dtype == np.int32


def test_includes_are_part_of_the_text():
    text = opencl.with_includes(ROOT / "synth/motion/density.cl")
    assert "#include" not in text
    assert text.index("at_departure(global") < text.index("kernel void step_lanes")


def test_a_checkout_may_lie_under_a_path_with_spaces(tmp_path):
    shutil.copytree(ROOT / "synth", tmp_path / "my work" / "synth", ignore=shutil.ignore_patterns("__pycache__"))
    script = ("import sys; sys.path.insert(0, '.'); sys.meta_path[:] = [m for m in sys.meta_path if"
              " 'ditable' not in repr(m) and 'ScikitBuild' not in repr(m)]\n"
              "import numpy as np, synth; from synth.motion.density import Source, naive\n"
              "D, = naive([np.ones((8, 8, 2), np.float32)], [Source((0.0, 0.5), 0.3)])\n"
              "print(synth.__file__, D.max())")
    told = subprocess.run([sys.executable, "-c", script], cwd=tmp_path / "my work", check=True, text=True,
                          capture_output=True).stdout
    assert "my work" in told and told.split()[-1] == "1.0"


def test_the_device_is_named():
    assert "(" in opencl.description()
    assert opencl._queue().device.name in opencl.description()


@pytest.mark.parametrize("environment, line", [
    ({"FLOWLOOM_DEVICE": "abacus"}, "FLOWLOOM_DEVICE='abacus' matches none of"),
    ({"OCL_ICD_VENDORS": "/nowhere/", "OPENCL_VENDOR_PATH": "/nowhere/"}, "pocl-opencl-icd"),
])
def test_without_a_device_one_line_says_what_to_do(environment, line):
    script = "from synth import opencl\ntry: opencl.description()\nexcept opencl.OpenCLUnavailable as e: print(e)"
    told = subprocess.run([sys.executable, "-c", script], cwd=ROOT, env={**os.environ, **environment}, check=True,
                          text=True, capture_output=True).stdout
    assert line in told and told.count("\n") == 1
