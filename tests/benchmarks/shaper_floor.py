"""How near a shaper and a cube can come: the least error over all shapers, beside ours and the cube of `ociobakelut`.

    python -m tests.benchmarks.shaper_floor FOLDER SIZE WORD…

FOLDER is that of `bake_table.py`, with the other side's figures; WORDs choose transforms. LUTFORGE_TEST_DATA names the
real data. Files without a response behind the cube (.cube, .csp, .spi3d) hold nothing else than a curve per axis and a
cube. The curves are bent by a descent on 48 steps of each axis, from ours, the cube solved anew for every trial: the
slope of its error is that at a fixed cube, since the cube is at its own best (variable projection, Golub and Pereyra
1973). Both norms that matter are tried: p = 1.3, near the mean, and p = 2. Minutes at 33³: no way to bake.
"""

import json
import os
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.optimize import minimize

from lutforge.colour.colour_difference import delta_e_2000
from lutforge.interpolation import INTERPOLATIONS, Interpolation, interpolate, through
from lutforge.luts.bake import bake
from lutforge.luts.fit import Evaluated, fit_without_response
from lutforge.luts.least_squares import GREY_POINTS, GREY_WEIGHT, Samples, fit_cube, sample, solve_nodes
from lutforge.luts.lut import Lut
from lutforge.luts.shaper import SHAPER_SIZE
from lutforge.model.lattice import uniform_levels
from lutforge.model.transform import Transform
from lutforge.solvers.node_levels import snap_levels
from tests.benchmarks.bake_table import colours, nikon_d40, transforms

Array = NDArray[np.float64]

STEPS, ROUNDS = 48, 25
STIFFNESS = 1e-3
"""What a squared difference between neighbouring steps counts, in units of the error at the start."""


def table_of(q: Array) -> tuple[Array, Array]:
    """A monotone warp of each axis, (STEPS + 1, 3), with W' ∝ exp(q); and its steps."""
    steps = np.exp(q.reshape(STEPS, 3))
    steps /= steps.sum(axis=0)
    return np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)]), steps


def best_warp(v: Array, y: Array, omega: Array, nodes: Array, method: Interpolation) -> Array:
    """The warp of the axes v (n, 3) under which a cube comes nearest to y."""
    knots, unit = uniform_levels(len(nodes)), [0.0]
    place = np.minimum((v * STEPS).astype(np.int64), STEPS - 1)
    fraction, cube = v * STEPS - place, [nodes]

    def error(q: Array) -> tuple[float, Array]:
        table, steps = table_of(q)
        u = through(table, v)
        cube[0] = solve_nodes(u, y, knots, method, omega, nodes, cube[0])
        rest = interpolate(u, knots, cube[0], method) - y
        value, gradient = float(np.sum(omega * np.sum(rest**2, axis=1))), np.empty((STEPS, 3))
        unit[0] = unit[0] or value
        for c in range(3):
            above, below = u.copy(), u.copy()
            above[:, c], below[:, c] = np.minimum(u[:, c] + 1e-6, 1), np.maximum(u[:, c] - 1e-6, 0)
            slope = interpolate(above, knots, cube[0], method) - interpolate(below, knots, cube[0], method)
            by_u = 2 * omega * np.sum(rest * slope, axis=1) / (above[:, c] - below[:, c])
            by_table = np.bincount(place[:, c], by_u * (1 - fraction[:, c]), STEPS + 1)
            by_table += np.bincount(place[:, c] + 1, by_u * fraction[:, c], STEPS + 1)
            gradient[:, c] = (np.cumsum(by_table[::-1])[::-1][1:] - by_table @ table[:, c]) * steps[:, c] / unit[0]
        rough = np.diff(q.reshape(STEPS, 3), axis=0)
        gradient[1:] += 2 * STIFFNESS * rough
        gradient[:-1] -= 2 * STIFFNESS * rough
        return value / unit[0] + STIFFNESS * float(np.sum(rough**2)), gradient.ravel()

    found = minimize(error, np.zeros(3 * STEPS), jac=True, method="L-BFGS-B", options={"maxiter": ROUNDS})
    return table_of(found.x)[0]


def bent(known: Evaluated, lut: Lut, norm: float) -> Lut:
    """Ours, with its axes bent to the least error in a norm, and the cube fitted again."""
    assert known.parts.response is not None
    even, knots = np.linspace(0.0, 1.0, lut.size), lut.knots
    x, y, omega = known.samples.through(known.parts.response).of_design(1)
    omega[-GREY_POINTS:] *= GREY_WEIGHT

    def axes(inputs: Array) -> Array:
        stretched = lut.stretched(inputs)
        return np.stack([np.interp(stretched[:, c], knots[c], even) for c in range(3)], axis=1)

    v = axes(x)
    rest = np.linalg.norm(interpolate(v, uniform_levels(lut.size), lut.cube, lut.interpolation) - y, axis=1)
    omega *= (0.1 + np.minimum(rest / rest.mean(), 20.0)) ** (norm - 2)
    warp = best_warp(v, y, omega / omega.mean(), lut.cube, lut.interpolation)
    grid = np.repeat(np.linspace(0.0, 1.0, SHAPER_SIZE)[:, None], 3, axis=1)
    places = axes(grid)
    steps = np.linspace(0.0, 1.0, STEPS + 1)
    curve = np.stack([PchipInterpolator(steps, warp[:, c])(places[:, c]) for c in range(3)], axis=1)
    curve[0], curve[-1] = 0.0, 1.0
    r, g, b = (snap_levels(np.interp(even, curve[:, c], grid[:, 0]), SHAPER_SIZE) for c in range(3))
    better = replace(lut, curve=curve, levels=(r, g, b))
    samples: Samples = sample(known.parts.inner, ((r, g, b),), known.parts.gain).through(known.parts.response)
    return replace(better, cube=fit_cube(samples, 0, better.knots, lut.interpolation, better.stretched))


def measured(luts: list[Lut], transform: Transform) -> tuple[float, float]:
    """Mean and maximum ΔE00 of the better of two, as the table has it."""
    x = colours()
    wanted = transform(x)
    errors = [delta_e_2000(lut.folded()(x), wanted) for lut in luts]
    return min((float(error.mean()), float(error.max())) for error in errors)


def main(folder: str, size: str, *words: str) -> None:
    profile, n = nikon_d40(Path(os.environ["LUTFORGE_TEST_DATA"])), int(size)
    print(
        f"| mean / max ΔE00 | ours {n}³ | least p = 1.3 | least p = 2 | ociobakelut {2 * n - 1}³ |\n" + "|---" * 5 + "|"
    )
    for name, transform in transforms(profile).items():
        if not any(word in name for word in words):
            continue
        known = bake(transform, n).source
        assert isinstance(known, Evaluated)
        ours = [fit_without_response(known, method) for method in INTERPOLATIONS]
        figures = [measured(ours, transform)]
        figures += [measured([bent(known, lut, norm) for lut in ours], transform) for norm in (1.3, 2.0)]
        figures.append(json.loads((Path(folder) / f"theirs {name}.json").read_text())[f".cube {2 * n - 1}"])
        print("| " + " | ".join([name, *(f"{mean:.4f} / {most:.2f}" for mean, most in figures)]) + " |", flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
