"""Every accuracy figure that a change of LutForge must keep, measured in one run and compared with an earlier one.

    python -m tests.benchmarks.accuracy [--quick] [--only WORD …] [--json FILE] [--compare FILE] [--keep DIR]

Prints one figure a row under a stable name; lower is better in every row. `--compare` prints the ratio to an earlier
`--json` and marks what is worse by more than 3 %; the exit status is then 1. `--quick` measures the published Nikon D40
at three sizes, the Canon S40 and the simulated camera. `--only` keeps the parts whose names hold a word. Photographs of
the simulated cameras are made anew, or taken from `--keep DIR`. LUTFORGE_TEST_DATA names the folder of real data; the
parts that need it are left out where it is missing.

Errors are Euclidean norms of the RGB difference, 1 = full scale, or ΔE00. Seconds are printed, but never marked.
"""

import runpy
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses
from scipy import ndimage
from scipy.stats import qmc

import lutforge as lf
from lutforge.colour.srgb import delta_e_2000
from lutforge.images.read import read_image
from lutforge.simulate.camera import nikon_d5100, sigma_sd_merrill
from lutforge.simulate.demo import HELD_OUT
from lutforge.simulate.scene import SCENES
from tests.benchmarks import bake_table, common, lattices, raw_transfer_table, refinish_table
from tests.benchmarks.common import ROOT, Array, Figure, Figures, Parts


def d40(sizes: tuple[int, ...]) -> Figures:
    """Published pairs of the Nikon D40, 70 % fitted, 30 % predicted: medians of five splits."""
    default, thesis = lf.CalibrationOptions(), lf.CalibrationOptions(preset="thesis")
    presets = {"": default, ", thesis": thesis, ", uniform": replace(thesis, nonuniform=False)}
    for size in sizes:
        for preset, options in presets.items():
            if preset and size not in (13, 17, 24):
                continue
            median = np.median(lattices.held_out(lattices.lattice(replace(options, size=size))), axis=0)
            for figure, value in zip(("mean", "95 %", "max"), median, strict=False):
                yield Figure(f"D40 {size}³{preset}: {figure}", float(value))


def s40(data: Path, keep: Path) -> Figures:
    """Five photographs of a Canon PowerShot S40, each left out in turn, beside the baselines."""
    samples = common.s40(data, keep)
    profile = lf.calibrate(samples)
    for name, value in sorted(profile.styles["standard"].errors.items()):
        yield Figure(f"S40, in the profile: {name}", value)
    for row in lf.evaluate(profile, samples).rows:
        if row.shot == "all":
            yield Figure(f"S40 {row.direction}, {row.method}: mean", row.figures.mean)
            yield Figure(f"S40 {row.direction}, {row.method}: max", row.figures.maximum)
            if row.figures.de00_mean is not None:
                yield Figure(f"S40 {row.direction}, {row.method}: ΔE00", row.figures.de00_mean)


def simulated(keep: Path) -> Figures:
    """The demo's simulated camera: colours of the photograph that was held out, against the known truth."""
    shots, profile = common.demo(keep)
    for name, style in profile.styles.items():
        for figure, value in sorted(style.errors.items()):
            yield Figure(f"simulated, {name}, in the profile: {figure}", value)
    raw, before, after = common.refinished_colours(shots)
    refinish = profile.refinish(shots.source, shots.target, shots.ev)
    yield from _figures(f"simulated, render {shots.source}", profile.render(shots.source)(raw), before)
    yield from _figures(f"simulated, render {shots.target}", profile.render(shots.target)(raw * 2**shots.ev), after)
    linear = profile.linearize(shots.source)(before)
    yield from _figures(f"simulated, linearize {shots.source}", linear, raw, display=False)
    yield from _figures("simulated, refinish", refinish(before), after)
    assert shots.held_out.jpeg is not None
    jpeg, wanted = (read_image(path).pixels[..., :3].astype(np.float64) for path in (shots.held_out.jpeg, shots.wanted))
    graded = np.rint(255 * np.clip(refinish(jpeg), 0, 1)) / 255
    usable = ((jpeg > 0) & (jpeg < 1) & (wanted > 0) & (wanted < 1)).all(axis=-1)
    yield from _figures("simulated, graded picture", graded[usable], wanted[usable])
    # Its ball, a strong blue, is the largest blue part of the scene.
    surface = SCENES[HELD_OUT.scene](808, 1216, HELD_OUT.seed).first
    top, left = ((length - inner) // 2 for length, inner in zip(surface.shape, jpeg.shape, strict=False))
    blues, _ = ndimage.label(surface[top : top + jpeg.shape[0], left : left + jpeg.shape[1]] == 12)
    ball = blues == 1 + np.argmax(np.bincount(blues.ravel())[1:])
    yield Figure("simulated, blue ball of the graded picture: ΔE00", delta_e_2000(graded[ball], wanted[ball]).mean())


def _figures(name: str, colours: Array, truth: Array, *, display: bool = True) -> Figures:
    yield Figure(f"{name}: mean", float(np.linalg.norm(colours - truth, axis=1).mean()))
    yield Figure(f"{name}: RMSE", float(np.sqrt(np.mean((colours - truth) ** 2))))
    if display:
        yield Figure(f"{name}: ΔE00", float(delta_e_2000(colours, truth).mean()))


def bakes(data: Path) -> Figures:
    """Baked files of the physical D40 model, a render and a refinish."""
    chosen = bake_table.transforms(bake_table.nikon_d40(data))
    for name in ("render daylight", "refinish tungsten to daylight +0 EV"):
        with tempfile.TemporaryDirectory() as work:
            files = bake_table.ours(chosen[name], Path(work), (17, 33))
        for what, (mean, most) in files.items():
            yield Figure(f"bake {name}, {what}³: mean ΔE00", mean)
            yield Figure(f"bake {name}, {what}³: max ΔE00", most)


def refinishes(keep: Path) -> Figures:
    """Every pair of settings of a simulated camera, 144 shots: RMSE of the means of tiles and of single pixels."""
    tiles, _, pixels, _ = np.array(list(refinish_table.errors(nikon_d5100(), keep / "refinish").values())).T
    for name, values in (("tiles", tiles), ("pixels", pixels)):
        yield Figure(f"refinish, 132 pairs, {name}: median", float(np.median(values)))
        yield Figure(f"refinish, 132 pairs, {name}: max", float(values.max()))


def charts() -> Figures:
    """Ten cameras, trained on a chart under one light and tested under the other: RMSE of JPEG → RAW by model."""
    example = runpy.run_path(str(ROOT / "examples" / "middlebury_table.py"))
    for light in ("light1", "light2"):
        rows = example["table"](light)
        for method in example["METHODS"]:
            values = [row.rmse[method] for row in rows]
            yield Figure(f"charts, {light}, {method}: mean", float(np.mean(values)))
            yield Figure(f"charts, {light}, {method}: max", float(np.max(values)))


def unseen_colours() -> Figures:
    """33³ lattices from 5,000 colours of simulated cameras, even in RAW or in codes; ΔE00 of 10,000 others."""
    for camera in (nikon_d5100(), sigma_sd_merrill()):
        gain = camera.multipliers("daylight")
        for style in camera.styles:
            for spread in ("encoded", "RAW"):
                (x, y), (other, truth) = (
                    common.unseen_colours(camera, style, seed, count, drawn=8 * count, even_codes=spread == "encoded")
                    for seed, count in ((1, 5_000), (2, 10_000))
                )
                shot = np.char.add("shot", (np.arange(len(x)) % 10).astype(np.str_))
                samples = lf.SampleSet.from_arrays(
                    x / gain,
                    np.rint(255 * y) / 255,
                    camera=camera.name,
                    white_balance="daylight",
                    shot=shot,
                    patch=np.arange(len(x)).astype(np.str_),
                    exposure_s=0.01,
                    wb=gain,
                )
                rendered = lf.calibrate(samples).render("standard/daylight")(other / gain)
                error = delta_e_2000(np.clip(rendered, 0.0, 1.0), truth)
                name = f"unseen colours, {camera.model} {style}, {spread}"
                yield Figure(f"{name}: mean ΔE00", float(error.mean()))
                yield Figure(f"{name}: 95 % ΔE00", float(np.quantile(error, 0.95)))


def transfers() -> Figures:
    """One simulated camera's RAW in the look of another: RMSE on surfaces that no fit saw, worst of six lights."""
    for source, target in ((nikon_d5100(), sigma_sd_merrill()), (sigma_sd_merrill(), nikon_d5100())):
        by_light = [raw_transfer_table.errors(source, target, light) for light in source.white_balances]
        for form, values in zip(raw_transfer_table.FORMS, zip(*by_light, strict=True), strict=False):
            yield Figure(f"transfer {source.model} to {target.model}, {form}: worst RMSE", max(values))


def configs(data: Path, keep: Path) -> Figures:
    """JPEG to the scene reference and back through the written config, over colours that the model makes."""
    profiles = {
        "D40": (bake_table.nikon_d40(data), "standard/daylight"),
        "S40": (lf.calibrate(common.s40(data, keep)), "standard/auto"),
    }
    for name, (profile, selector) in profiles.items():
        with tempfile.TemporaryDirectory() as folder:
            began = time.perf_counter()
            written = lf.write_config([profile], Path(folder) / "ocio")
            seconds = time.perf_counter() - began
            config = OCIO.Config.CreateFromFile(str(written.path))
            balanced = np.concatenate([qmc.Sobol(3, rng=21).random(1 << 17), qmc.Sobol(3, rng=22).random(1 << 17) ** 2])
            jpeg = profile.render(selector)(balanced / profile.multipliers(selector))
            pixels = np.ascontiguousarray(np.clip(jpeg, 0.0, 1.0), dtype=np.float32)
            trip = pixels.copy()
            space = f"{profile.camera} {selector.replace('/', ' ')}"
            for ends in ((space, "aces_interchange"), ("aces_interchange", space)):
                config.getProcessor(*ends).getDefaultCPUProcessor().applyRGB(trip)
        error = np.linalg.norm(trip.astype(np.float64) - pixels, axis=1)
        yield Figure(f"config {name}, round trip: mean", float(error.mean()))
        yield Figure(f"config {name}, round trip: 99.9 %", float(np.quantile(error, 0.999)))
        yield Figure(f"config {name}, round trip: max", float(error.max()))
        yield Figure(f"config {name}: seconds", seconds, unit="s", compared=False)


def parts(keep: Path, *, quick: bool) -> Parts:
    """What a run measures, by name."""
    sizes = (13, 17, 33) if quick else (9, 13, 17, 24, 33, 65)
    made: dict[str, Callable[[], Figures]] = {"d40": partial(d40, sizes), "simulated": partial(simulated, keep)}
    data = common.real_data()
    if data is not None:
        made["s40"] = partial(s40, data, keep)
    if not quick:
        made |= {"refinishes": partial(refinishes, keep), "charts": charts}
        made |= {"unseen_colours": unseen_colours, "transfers": transfers}
        if data is not None:
            made |= {"bakes": partial(bakes, data), "configs": partial(configs, data, keep)}
    return made


def main() -> int:
    """Print the figures."""
    parser = common.parser(__doc__)
    parser.add_argument("--quick", action="store_true", help="the D40 at three sizes, the S40, the simulated camera")
    arguments = parser.parse_args()
    return common.measured(partial(parts, quick=arguments.quick), arguments)


if __name__ == "__main__":
    sys.exit(main())
