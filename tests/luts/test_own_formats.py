"""Formats that OpenColorIO does not read: .dctl compiled as C, .vlt by its description; and the numbers of texts."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike, NDArray

from lutforge.errors import LutError
from lutforge.luts.formats.text import DIGITS, EXACT, rows
from lutforge.luts.ops import Cube, Curve
from lutforge.luts.reading import file_processor, read_lut
from lutforge.luts.sequence import Lut, evaluate
from lutforge.pipeline.baking import bake

MACROS = r"""
#include <math.h>
#include <stdio.h>
#define __CONSTANT__ static const
#define __DEVICE__ static
typedef struct { float x, y, z; } float3;
static int size; static float nodes[65 * 65 * 65][3];
#define DEFINE_LUT(name, path)
#define APPLY_LUT(r, g, b, name) tetrahedral(r, g, b)
static float3 tetrahedral(float r, float g, float b)
{
    float p[3] = {r, g, b}, f[3]; int i[3], step[3] = {1, size, size * size}, order[3] = {0, 1, 2};
    for (int c = 0; c < 3; c++) {
        float at = fminf(fmaxf(p[c], 0.0f), 1.0f) * (size - 1);
        i[c] = at >= size - 1 ? size - 2 : (int)at;
        f[c] = at - i[c];
    }
    for (int a = 0; a < 2; a++) for (int c = 0; c < 2 - a; c++) if (f[order[c]] < f[order[c + 1]]) {
        int kept = order[c]; order[c] = order[c + 1]; order[c + 1] = kept;
    }
    int at = i[0] + size * (i[1] + size * i[2]); float y[3];
    for (int k = 0; k < 3; k++) y[k] = nodes[at][k];
    for (int c = 0; c < 3; c++) {
        int next = at + step[order[c]];
        for (int k = 0; k < 3; k++) y[k] += f[order[c]] * (nodes[next][k] - nodes[at][k]);
        at = next;
    }
    float3 result = {y[0], y[1], y[2]};
    return result;
}
"""

MAIN = r"""
int main(int count, char **words)
{
    char line[256]; int n = 0; float r, g, b;
    FILE *cube = fopen(words[1], "r");
    while (fgets(line, sizeof line, cube)) {
        if (sscanf(line, "LUT_3D_SIZE %d", &size) == 1) continue;
        if (sscanf(line, "%f %f %f", &r, &g, &b) == 3) { nodes[n][0] = r; nodes[n][1] = g; nodes[n++][2] = b; }
    }
    while (scanf("%f %f %f", &r, &g, &b) == 3) {
        float3 y = transform(0, 0, 0, 0, r, g, b);
        printf("%.9g %.9g %.9g\n", y.x, y.y, y.z);
    }
    return 0;
}
"""


def look(x: ArrayLike) -> NDArray[np.float64]:
    """A steep look, which needs a bent shaper."""
    y = np.asarray(x, dtype=np.float64) ** 0.4
    return np.asarray(np.clip(y @ np.array([[1.1, -0.1, 0.0], [0.05, 0.9, 0.05], [0.0, -0.2, 1.2]]).T, 0.0, 1.0))


def run_as_c(path: Path, x: NDArray[np.float64]) -> NDArray[np.float64]:
    """What the program computes, compiled with DCTL's macros."""
    source, program = path.with_suffix(".c"), path.with_suffix("")
    source.write_text(MACROS + path.read_text(encoding="utf-8") + MAIN, encoding="utf-8")
    build = subprocess.run(
        ["cc", "-O1", "-o", str(program), str(source), "-lm"], capture_output=True, text=True, check=False
    )
    assert build.returncode == 0, build.stderr
    text = "\n".join(" ".join(f"{value:.9g}" for value in row) for row in x)
    words = [str(program), str(path.with_suffix(".cube"))]
    run = subprocess.run(words, input=text, capture_output=True, text=True, check=True)
    return np.array(run.stdout.split(), dtype=np.float64).reshape(-1, 3)


@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler")
@pytest.mark.parametrize("smooth", [False, True])
def test_compiled_as_c_it_is_the_clf(tmp_path: Path, smooth: bool) -> None:
    lut: Lut = bake(look, size=17, form="shaper")
    if smooth:  # a shaper that bends everywhere
        entries = np.repeat(np.linspace(0.0, 1.0, 65536)[:, None] ** 0.45, 3, axis=1)
        assert lut.cube is not None
        lut = Lut((Curve(entries), Cube(lut.cube.values)))
    lut.write(tmp_path / "look.dctl")
    lut.write(tmp_path / "look.clf")
    x = np.random.default_rng(3).uniform(-0.05, 1.05, (5000, 3))
    x[:2000] **= 4
    wanted = evaluate(file_processor(tmp_path / "look.clf"), x)
    assert np.abs(run_as_c(tmp_path / "look.dctl", x) - wanted).max() <= 1e-5
    assert np.abs(read_lut(tmp_path / "look.dctl")(x) - wanted).max() <= 1e-5


def test_other_programs_are_refused_in_a_line(tmp_path: Path) -> None:
    path = tmp_path / "other.dctl"
    path.write_text("__DEVICE__ float3 transform(int w, int h, int x, int y, float r, float g, float b) {}")
    with pytest.raises(LutError, match="only those that LutForge wrote"):
        read_lut(path)
    bake(look, size=5, form="shaper").write(tmp_path / "look.dctl")
    (tmp_path / "look.cube").unlink()
    with pytest.raises(LutError, match=r"look\.cube is missing"):
        read_lut(tmp_path / "look.dctl")


def parsed(path: Path) -> np.ndarray:
    """(17, 17, 17, 3), red index first: three header lines, a blank one, then codes of 12 bits, red fastest."""
    data = path.read_bytes()
    assert b"\r" not in data
    lines = data.decode("ascii").split("\n")
    assert lines[:4] == ["# panasonic vlt file version 1.0", '# source vlt file ""', "LUT_3D_SIZE 17", ""]
    codes = np.array([line.split() for line in lines[4:-1]], dtype=np.int64)
    assert codes.shape == (17**3, 3)
    assert codes.min() >= 0
    assert codes.max() <= 4095
    return codes.reshape(17, 17, 17, 3).transpose(2, 1, 0, 3) / 4095


def test_a_vlt_is_written_as_published(tmp_path: Path) -> None:
    lut = bake(look, tmp_path / "look.vlt")
    assert lut.cube is not None
    assert np.abs(parsed(tmp_path / "look.vlt") - np.clip(lut.cube.values, 0, 1)).max() <= 0.5 / 4095 + 1e-12
    again = read_lut(tmp_path / "look.vlt")
    assert again.cube is not None
    assert np.array_equal(again.cube.values, parsed(tmp_path / "look.vlt"))


@pytest.mark.parametrize(("line", "text"), [(2, "LUT_3D_SIZE 33"), (4, "0 0 5000"), (4, "0 0 0.5"), (4, "0 0")])
def test_other_numbers_in_a_vlt_are_refused(tmp_path: Path, line: int, text: str) -> None:
    path = tmp_path / "look.vlt"
    bake(look, path)
    lines = path.read_text().split("\n")
    lines[line] = text
    path.write_text("\n".join(lines))
    with pytest.raises(LutError, match=r"look\.vlt"):
        read_lut(path)


@settings(max_examples=200, deadline=None)
@given(st.lists(st.tuples(*[st.floats(-2 * EXACT, 2 * EXACT)] * 3), max_size=4))
def test_numbers_are_written_as_python_does(numbers: list[tuple[float, float, float]]) -> None:
    numbers += [(0.0, -0.0, -1e-12), (1.0, 0.5, -123.25)]
    rounded = np.round(np.array(numbers), DIGITS) + 0.0
    assert rows(numbers) == "".join(f"{r:.10f} {g:.10f} {b:.10f}\n" for r, g, b in rounded.tolist())
