"""Our baked files beside those of `ociobakelut`, for 12 transforms of the published Nikon D40.

    python -m tests.benchmarks.bake_table FOLDER [WORD…]

FOLDER keeps what is measured, two files a transform, so that a run can be broken off and taken up; files that are taken
away are measured anew. WORDs choose the transforms whose names hold one of them. LUTFORGE_TEST_DATA names the folder of
real data.

Each LUT is measured as the file that was written, read back by OpenColorIO. The other side is the program itself, on a
config that holds the model in stages of 65³ nodes, with the best of its shapers (six shapes, two lengths) and of both
interpolations; its errors are counted from the config's own transform, so that it is not charged with what the config
lacks. A .clf of it holds the numbers of its .cube. Ours, too, has the better of both interpolations.
"""

import json
import subprocess
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

from lutforge.arrays import ColourFunction
from lutforge.colour.srgb import delta_e_2000
from lutforge.interpolation import INTERPOLATIONS
from lutforge.luts.bake import bake_forms, bake_steps
from lutforge.luts.programs import target_of
from lutforge.luts.reading import file_processor
from lutforge.luts.sequence import evaluate
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.published_model import import_published
from tests.benchmarks.common import Array, chosen, heading, real_data, row

Errors = dict[str, tuple[float, float]]
"""Mean and maximum ΔE00 by "suffix size"."""

GAMMAS = (1.0, 1.5, 2.0, 2.4, 3.0)
LOG = "!<LogCameraTransform> {base: 2, log_side_slope: 0.1, log_side_offset: 1, lin_side_break: 0.00097656}"
"""The last ten stops, and a straight line below them."""
PAIRS = ((17, 33), (33, 65))
"""Nodes per axis: ours, theirs."""
OURS = {".clf": "a.clf", ".cube": "a.resolve.cube", ".csp": "a.csp"}
THEIRS = {".cube": "resolve_cube", ".csp": "cinespace"}
"""Formats of `ociobakelut` by suffix."""
PEER_OF = {".clf": ".cube", ".cube": ".cube", ".csp": ".csp"}
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
    made: dict[str, ColourFunction] = {f"render {name}": profile.render(f"standard/{name}") for name in RENDERS}
    for source, target, ev in REFINISHES:
        # The other side's config holds the bare model.
        refinish = profile.refinish(f"standard/{source}", f"standard/{target}", ev, neutral_highlights=False)
        made[f"refinish {source} to {target} {ev:+g} EV"] = refinish
    return made


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


def theirs(transform: ColourFunction, folder: Path, sizes: tuple[int, ...]) -> Errors:
    """Of the files of `ociobakelut`, at the best of its shapers and interpolations."""
    x = colours()
    wanted = evaluate(write_config(transform, folder), x).astype(np.float64)
    tool = Path(sys.executable).with_name("ociobakelut")
    shaped = product(range(1, len(GAMMAS) + 1), (4096, 65536))
    shapers = [["--shaperspace", f"shaper{index}", "--shapersize", str(length)] for index, length in shaped]
    best: Errors = {}
    for suffix in THEIRS:
        for size in sizes:
            errors = []
            for shaper in ([], *shapers):
                command = [str(tool), "--iconfig", "config.ocio", "--inputspace", "raw", "--outputspace", "jpeg"]
                command += ["--format", THEIRS[suffix], "--cubesize", str(size), *shaper, f"baked{suffix}"]
                subprocess.run(command, cwd=folder, check=True, capture_output=True)
                errors += [measured(folder / f"baked{suffix}", method, x, wanted) for method in INTERPOLATIONS]
            best[f"{suffix} {size}"] = min(errors)
    return best


def ours(transform: ColourFunction, folder: Path, sizes: tuple[int, ...]) -> Errors:
    """Of our files, at the better of the two interpolations, each with its own fit."""
    x = colours()
    wanted = transform(x)
    errors: dict[str, list[tuple[float, float]]] = {}
    for size in sizes:
        for method in INTERPOLATIONS:
            paths = [folder / name for name in OURS.values()]
            luts = bake_forms(transform, [target_of(path, None, size, method) for path in paths])
            for suffix, path, lut in zip(OURS, paths, luts, strict=True):
                lut.write(path)
                errors.setdefault(f"{suffix} {size}", []).append(measured(path, method, x, wanted))
    return {name: min(both) for name, both in errors.items()}


def measured(path: Path, method: str, x: Array, wanted: Array) -> tuple[float, float]:
    """Mean and maximum ΔE00 of a file."""
    got = evaluate(file_processor(path, "trilinear" if method == "trilinear" else "tetrahedral"), x)
    error = delta_e_2000(got.astype(np.float64), wanted)
    return float(error.mean()), float(error.max())


def kept(path: Path, measure: Callable[[], Errors]) -> Errors:
    """What a file keeps of an earlier run, else measured and kept."""
    if not path.exists():
        path.write_text(json.dumps(measure()))
    return {name: (mean, most) for name, (mean, most) in json.loads(path.read_text()).items()}


def main(folder: Path, words: list[str]) -> None:
    """Print a row per transform, and how often ours is not above theirs of the same kind."""
    folder.mkdir(parents=True, exist_ok=True)
    data = real_data()
    if data is None:
        return
    small, large = zip(*PAIRS, strict=True)
    rows: list[tuple[Errors, Errors]] = []
    for name, transform in transforms(nikon_d40(data)).items():
        if not chosen(name, words):
            continue
        with tempfile.TemporaryDirectory() as work:
            peer = kept(folder / f"theirs {name}.json", partial(theirs, transform, Path(work), large))
            mine = kept(folder / f"ours {name}.json", partial(ours, transform, Path(work), small))
        if not rows:
            heading("mean / max ΔE00", *(f"ours {key}" for key in mine), *(f"theirs {key}" for key in peer))
        row(name, *(f"{mean:.4f} / {most:.2f}" for mean, most in [*mine.values(), *peer.values()]))
        rows.append((mine, peer))
    for suffix, (size, larger) in product(OURS, PAIRS):
        pairs = [(mine[f"{suffix} {size}"], peer[f"{PEER_OF[suffix]} {larger}"]) for mine, peer in rows]
        for which, figure in enumerate(("mean", "max")):
            ratios = [a[which] / b[which] for a, b in pairs]
            print(
                f"{suffix} {size}³ by theirs {larger}³, {figure}: {min(ratios):.2f} to {max(ratios):.2f} times, "
                f"not above it in {sum(ratio <= 1 for ratio in ratios)} of {len(ratios)}"
            )


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
