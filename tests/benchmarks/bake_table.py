"""Our baked files beside those of `ociobakelut`, for 12 transforms of the published Nikon D40.

    python -m tests.benchmarks.bake_table FOLDER [--again] [WORD…]

FOLDER keeps what is measured, a file per transform, so that a run can be broken off and taken up; --again measures ours
anew. WORDs choose the transforms whose names hold one of them. LUTFORGE_TEST_DATA names the folder of real data.

Each LUT is measured as the file that was written, read back by OpenColorIO. The other side is the program itself, on a
config that holds the model in stages of 65³ nodes, with the best of its shapers (six shapes, two lengths) and of both
interpolations; its errors are counted from the config's own transform, so that it is not charged with what the config
lacks. A .clf of it holds the numbers of its .cube. Ours, too, has the better of both interpolations.
"""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses
from numpy.typing import NDArray

from lutforge.colour.srgb import delta_e_2000
from lutforge.interpolation import INTERPOLATIONS
from lutforge.luts.bake import bake_forms, bake_steps
from lutforge.luts.processor import evaluate
from lutforge.luts.programs import target_of
from lutforge.luts.reading import file_processor
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.published_model import import_published
from lutforge.model.transform import ColourFunction

Array = NDArray[np.float64]
Errors = dict[str, tuple[float, float]]
"""Mean and maximum ΔE00 by "suffix size"."""

GAMMAS = (1.0, 1.5, 2.0, 2.4, 3.0)
LOG = "!<LogCameraTransform> {base: 2, log_side_slope: 0.1, log_side_offset: 1, lin_side_break: 0.00097656}"
"""The last ten stops, and a straight line below them."""
SHAPER_SIZES = (4096, 65536)
PAIRS = ((17, 33), (33, 65))
"""Nodes per axis: ours, theirs."""
OURS = {".clf": "a.clf", ".cube": "a.resolve.cube", ".csp": "a.csp"}
THEIRS = {".cube": "resolve_cube", ".csp": "cinespace", ".spi3d": "spi3d"}
"""Formats of `ociobakelut` by suffix; .spi3d without a shaper."""
REFINISHES = (
    ("tungsten", "daylight", 0.0),
    ("daylight", "tungsten", 0.0),
    ("shade", "daylight", 0.0),
    ("daylight", "shade", 0.5),
    ("cloudy", "flash", -0.5),
    ("daylight", "daylight", 0.7),
)
RENDERS = ("daylight", "tungsten", "shade", "cloudy", "flash", "fluorescent")


def nikon_d40(data: Path) -> CameraProfile:
    folder = data / "nus_nikon_d40"
    return import_published([folder / "other_white_balances", folder / "fluorescent"], "Nikon D40")


def transforms(profile: CameraProfile) -> dict[str, ColourFunction]:
    found: dict[str, ColourFunction] = {f"render {name}": profile.render(f"standard/{name}") for name in RENDERS}
    for source, target, ev in REFINISHES:
        # The other side's config holds the bare model.
        refinish = profile.refinish(f"standard/{source}", f"standard/{target}", ev, neutral_highlights=False)
        found[f"refinish {source} to {target} {ev:+g} EV"] = refinish
    return found


def colours() -> Array:
    grey = np.repeat(np.linspace(0, 1, 1025)[:, None], 3, axis=1)
    corners = np.array(np.meshgrid([0.0, 1.0], [0.0, 1.0], [0.0, 1.0])).reshape(3, -1).T
    x = np.concatenate([np.random.default_rng(3).random((30000, 3)), grey, corners])
    return x.astype(np.float32).astype(np.float64)


def write_config(transform: ColourFunction, folder: Path) -> OCIO.CPUProcessor:
    """Write a config whose colour space "jpeg" is the transform, and others to shape with; what it makes of colours."""
    bake_steps(transform, 65).write(folder / "model.clf")
    spaces = [
        f"  - !<ColorSpace>\n    name: shaper{index}\n    from_scene_reference: {shape}\n"
        for index, shape in enumerate(
            [*(f"!<ExponentTransform> {{value: [{1 / g}, {1 / g}, {1 / g}, 1]}}" for g in GAMMAS), LOG]
        )
    ]
    (folder / "config.ocio").write_text(
        "ocio_profile_version: 2\nsearch_path: .\nroles: {default: raw}\ndisplays:\n  d:\n"
        "    - !<View> {name: v, colorspace: raw}\nactive_displays: []\nactive_views: []\ncolorspaces:\n"
        "  - !<ColorSpace> {name: raw, isdata: false}\n" + "".join(spaces) + "  - !<ColorSpace>\n    name: jpeg\n"
        "    from_scene_reference: !<FileTransform> {src: model.clf}\n"
    )
    return file_processor(folder / "model.clf")


def theirs(transform: ColourFunction, folder: Path, sizes: tuple[int, ...], suffixes: tuple[str, ...]) -> Errors:
    """Of the files of `ociobakelut`, at the best of its shapers and interpolations."""
    x = colours()
    wanted = evaluate(write_config(transform, folder), x).astype(np.float64)
    tool = Path(sys.executable).parent / "ociobakelut"
    best: Errors = {}
    for suffix in suffixes:
        shapers = [[]] if suffix == ".spi3d" else [
            [], *(["--shaperspace", f"shaper{index}", "--shapersize", str(length)]
                  for index in range(1, len(GAMMAS) + 1) for length in SHAPER_SIZES),
        ]  # fmt: skip
        for size in sizes:
            errors = []
            for shaper in shapers:
                command = [str(tool), "--iconfig", "config.ocio", "--inputspace", "raw", "--outputspace", "jpeg"]
                command += ["--format", THEIRS[suffix], "--cubesize", str(size), *shaper, f"baked{suffix}"]
                subprocess.run(command, cwd=folder, check=True, capture_output=True)
                errors += [measured(folder / f"baked{suffix}", method, x, wanted) for method in INTERPOLATIONS]
            best[f"{suffix} {size}"] = min(errors)
    return best


def ours(transform: ColourFunction, folder: Path, sizes: tuple[int, ...], suffixes: tuple[str, ...]) -> Errors:
    """Of our files, at the better of the two interpolations, each with its own fit."""
    x = colours()
    wanted = transform(x)
    errors: dict[str, list[tuple[float, float]]] = {}
    for size in sizes:
        for method in INTERPOLATIONS:
            paths = [folder / OURS[suffix] for suffix in suffixes]
            luts = bake_forms(transform, [target_of(path, None, size, method) for path in paths])
            for suffix, path, lut in zip(suffixes, paths, luts, strict=True):
                lut.write(path)
                errors.setdefault(f"{suffix} {size}", []).append(measured(path, method, x, wanted))
    return {name: min(both) for name, both in errors.items()}


def measured(path: Path, method: str, x: Array, wanted: Array) -> tuple[float, float]:
    """Mean and maximum ΔE00 of a file."""
    got = evaluate(file_processor(path, "trilinear" if method == "trilinear" else "tetrahedral"), x)
    error = delta_e_2000(got.astype(np.float64), wanted)
    return float(error.mean()), float(error.max())


def kept(path: Path, measure: Callable[[], Errors], again: bool = False) -> Errors:
    """What a file keeps of an earlier run, else measured and kept."""
    if again or not path.exists():
        path.write_text(json.dumps(measure()))
    return {name: (mean, most) for name, (mean, most) in json.loads(path.read_text()).items()}


def table(rows: dict[str, Errors]) -> str:
    """Markdown: a row per transform, and how often ours is not above theirs of the same kind."""
    columns = list(next(iter(rows.values())))
    lines = ["| mean / max ΔE00 | " + " | ".join(columns) + " |", "|---" * (len(columns) + 1) + "|"]
    for name, errors in rows.items():
        lines.append("| " + " | ".join([name, *(f"{mean:.4f} / {most:.2f}" for mean, most in errors.values())]) + " |")
    for mine, size, larger in [(s, *pair) for s in OURS for pair in PAIRS if f"ours {s} {pair[0]}" in columns]:
        pairs = [(row[f"ours {mine} {size}"], row[f"theirs {'.cube' if mine == '.clf' else mine} {larger}"])
                 for row in rows.values()]  # fmt: skip
        for which, figure in ((0, "mean"), (1, "max")):
            ratios = [a[which] / b[which] for a, b in pairs]
            lines.append(
                f"\n{mine} {size}³ by theirs {larger}³, {figure}: {min(ratios):.2f} to {max(ratios):.2f} times, "
                f"not above it in {sum(ratio <= 1 for ratio in ratios)} of {len(ratios)}"
            )
    return "\n".join(lines)


def main(arguments: list[str]) -> None:
    folder, *words = [word for word in arguments if word != "--again"]
    keep, again = Path(folder), "--again" in arguments
    keep.mkdir(parents=True, exist_ok=True)
    profile = nikon_d40(Path(os.environ["LUTFORGE_TEST_DATA"]))
    small, large = zip(*PAIRS, strict=True)
    rows = {}
    for name, transform in transforms(profile).items():
        if words and not any(word in name for word in words):
            continue
        with tempfile.TemporaryDirectory() as work:
            peer = kept(keep / f"theirs {name}.json", partial(theirs, transform, Path(work), large, tuple(THEIRS)))
            mine = kept(keep / f"ours {name}.json", partial(ours, transform, Path(work), small, tuple(OURS)), again)
        rows[name] = {f"ours {key}": value for key, value in mine.items()}
        rows[name] |= {f"theirs {key}": value for key, value in peer.items()}
        print(name, {key: tuple(round(v, 4) for v in value) for key, value in rows[name].items()}, flush=True)
    print(table(rows))


if __name__ == "__main__":
    main(sys.argv[1:])
