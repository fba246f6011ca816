"""Every accuracy figure that a change of LutForge must keep, measured in one run and compared with an earlier one.

    python -m tests.benchmarks.accuracy [--quick] [--only WORD …] [--json FILE] [--compare FILE] [--keep DIR]

Prints one figure a row under a stable name; lower is better in every row. `--compare` prints the ratio to an earlier
`--json` and marks what is worse by more than 3 %; the exit status is then 1. `--quick` measures the published Nikon D40
at three sizes, the Canon S40, the simulated camera and three cameras of the fleet. `--only` keeps the parts whose names
hold a word. Photographs of the simulated cameras are made anew, or taken from `--keep DIR`. LUTFORGE_TEST_DATA names
the folder of real data; the parts that need it are left out where it is missing.

Errors are Euclidean norms of the RGB difference, 1 = full scale, or ΔE00. Seconds are printed, but never marked.
"""

import runpy
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from itertools import permutations, product
from pathlib import Path

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses
from numpy.typing import NDArray
from scipy import ndimage
from scipy.optimize import least_squares
from scipy.stats import qmc

import lutforge as lf
from lutforge.arrays import Array
from lutforge.calibration.calibrate import calibrate
from lutforge.calibration.raw_transfer import fit_raw_transfer
from lutforge.calibration.style import style_data
from lutforge.calibration.white_balance import complete_multipliers
from lutforge.cli.demo_shots import HELD_OUT_SHOT, DemoShots
from lutforge.colour.spectra import chart_reflectances, surface_reflectances
from lutforge.colour.srgb import delta_e_2000
from lutforge.evaluation.methods import fit_baselines
from lutforge.images.read import read_image
from lutforge.interpolation import INTERPOLATIONS, Interpolation
from lutforge.luts.bake import bake_steps, bake_to
from lutforge.luts.ocio_transforms import evaluate
from lutforge.luts.reading import trusted_processor
from lutforge.luts.refinish import steps_of
from lutforge.luts.target import target_of
from lutforge.model.camera_profile import match, raw_to_balanced
from lutforge.model.transform import through_stages
from lutforge.simulate.camera import SimulatedCamera, nikon_d5100, sigma_sd_merrill
from lutforge.simulate.dials import CameraSettings
from lutforge.simulate.photograph import Photograph, develop_again, photograph
from lutforge.simulate.scene import palette
from lutforge.simulate.scenes import SCENES
from lutforge.thesis.options import Options, ThesisOptions
from tests.benchmarks import common, lattices
from tests.benchmarks.common import ROOT, Figure, Figures, Parts
from tests.benchmarks.fleet import is_error
from tests.benchmarks.fleet_cameras import fleet
from tests.benchmarks.fleet_figures import measure
from tests.cases import input_transforms
from tests.cases.real_data import CHARTS


def d40(sizes: tuple[int, ...]) -> Figures:
    """Published pairs of the Nikon D40, 70 % fitted, 30 % predicted: medians of five splits."""
    default, thesis = lf.CalibrationOptions(), ThesisOptions()
    presets: dict[str, Options] = {"": default, ", thesis": thesis, ", uniform": replace(thesis, nonuniform=False)}
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
    yield from _plain_methods(shots, profile, raw, before, after)
    assert shots.held_out.jpeg is not None
    paths = shots.held_out.jpeg, shots.right
    jpeg, expected = (read_image(path).pixels[..., :3].astype(np.float64) for path in paths)
    graded = np.rint(255 * np.clip(refinish(jpeg), 0, 1)) / 255
    usable = ((jpeg > 0) & (jpeg < 1) & (expected > 0) & (expected < 1)).all(axis=-1)
    yield from _figures("simulated, graded picture", graded[usable], expected[usable])
    # Its ball, a strong blue, is the largest blue part of the scene.
    surface = SCENES[HELD_OUT_SHOT.scene](808, 1216, HELD_OUT_SHOT.seed).first
    top, left = ((length - inner) // 2 for length, inner in zip(surface.shape, jpeg.shape, strict=False))
    blues, _ = ndimage.label(surface[top : top + jpeg.shape[0], left : left + jpeg.shape[1]] == 12)
    ball = blues == 1 + np.argmax(np.bincount(blues.ravel())[1:])
    yield Figure("simulated, blue ball of the graded picture: ΔE00", delta_e_2000(graded[ball], expected[ball]).mean())


def _plain_methods(shots: DemoShots, profile: lf.CameraProfile, raw: Array, before: Array, after: Array) -> Figures:
    """What the guide has beside LutForge: three models of the way back, and a polynomial that has seen the answer.

    No method that maps a picture by one polynomial of these 11 terms can do better in the mean square (Hong, Luo and
    Rhodes 2001, https://doi.org/10.1002/1520-6378(200102)26:1%3C76::AID-COL8%3E3.0.CO;2-3).
    """
    gain, calibration = profile.multipliers(shots.source), lf.sample(shots.calibration)
    data = style_data(calibration, complete_multipliers(calibration)[0])[0][shots.source.split("/")[0]]
    methods = {name: fit.linearize for name, fit in fit_baselines(data).items()}
    for name, method in {"LutForge": lambda x: profile.linearize(shots.source)(x) * gain, **methods}.items():
        error = np.linalg.norm(method(before) - raw * gain, axis=1)
        yield Figure(f"simulated, JPEG to balanced RAW, {name}: mean", float(error.mean()))
        yield Figure(f"simulated, JPEG to balanced RAW, {name}: max", float(error.max()))
    r, g, b = before.T
    terms = np.stack([np.ones(len(r)), r, g, b, r * g, r * b, g * b, r * r, g * g, b * b, r * g * b], axis=1)
    fitted = np.clip(terms @ np.linalg.lstsq(terms, after, rcond=None)[0], 0.0, 1.0)
    yield from _figures("simulated, refinish by a polynomial that has seen the answer", fitted, after)


def _figures(name: str, colours: Array, truth: Array, *, display: bool = True) -> Figures:
    yield Figure(f"{name}: mean", float(np.linalg.norm(colours - truth, axis=1).mean()))
    yield Figure(f"{name}: RMSE", float(np.sqrt(np.mean((colours - truth) ** 2))))
    if display:
        difference = delta_e_2000(colours, truth)
        yield Figure(f"{name}: ΔE00", float(difference.mean()))
        yield Figure(f"{name}: max ΔE00", float(difference.max()))


def bakes(data: Path) -> Figures:
    """Baked files of the physical D40 model, each read back by OpenColorIO at the better of both interpolations.

    The .clf is also told by the error of `ociobakelut`, which has twice the nodes and the best of its shapers.
    """
    profile = common.nikon_d40(data)
    grey = np.repeat(np.linspace(0, 1, 1025)[:, None], 3, axis=1)
    corners = np.array(np.meshgrid([0.0, 1.0], [0.0, 1.0], [0.0, 1.0])).reshape(3, -1).T
    x = np.concatenate([np.random.default_rng(3).random((30000, 3)), grey, corners]).astype(np.float32).astype(float)
    chosen = {
        "render daylight": profile.render("standard/daylight"),
        # The other side's config holds the bare model.
        "refinish tungsten to daylight +0 EV": profile.refinish(
            "standard/tungsten", "standard/daylight", neutral_highlights=False
        ),
    }

    def error(path: Path, method: Interpolation, expected: Array) -> tuple[float, float]:
        difference = delta_e_2000(evaluate(trusted_processor(path, method), x).astype(np.float64), expected)
        return float(difference.mean()), float(difference.max())

    for name, transform in chosen.items():
        expected, best = transform(x), dict[str, tuple[float, float]]()
        with tempfile.TemporaryDirectory() as work:
            paths = [Path(work, file) for file in ("a.clf", "a.resolve.cube", "a.csp")]
            for size, method in product((17, 33), INTERPOLATIONS):
                luts = [bake_to(transform, target_of(path, None, size, method)) for path in paths]
                for path, lut in zip(paths, luts, strict=True):
                    key = f"{path.suffix} {size}"
                    best[key] = min(best.get(key, (np.inf, np.inf)), error(lut.write(path), method, expected))
            for what, (mean, most) in best.items():
                yield Figure(f"bake {name}, {what}³: mean ΔE00", mean)
                yield Figure(f"bake {name}, {what}³: max ΔE00", most)
            bare = evaluate(trusted_processor(bake_steps(transform, 65).write(Path(work, "model.clf"))), x).astype(
                float
            )
            peer = min(error(path, method, bare) for path in by_ociobakelut(Path(work)) for method in INTERPOLATIONS)
            for figure, mine, theirs in zip(("mean", "max"), best[".clf 17"], peer, strict=True):
                yield Figure(f"bake {name}, .clf 17³ by 33³ of ociobakelut: {figure}", mine / theirs)


def by_ociobakelut(folder: Path) -> Iterator[Path]:
    """The 33³ .cube of the model.clf in a folder by each shaper, on a config that shapes by powers and a logarithm.

    The logarithm takes the last ten stops, with a straight line below them.
    """
    shapes = [f"!<ExponentTransform> {{value: [{1 / g}, {1 / g}, {1 / g}, 1]}}" for g in (1.0, 1.5, 2.0, 2.4, 3.0)]
    shapes += ["!<LogCameraTransform> {base: 2, log_side_slope: 0.1, log_side_offset: 1, lin_side_break: 0.00097656}"]
    shapes += ["!<FileTransform> {src: model.clf}"]
    spaces = (f"  - !<ColorSpace> {{name: {at}, from_scene_reference: {shape}}}\n" for at, shape in enumerate(shapes))
    (folder / "config.ocio").write_text(
        "ocio_profile_version: 2\nsearch_path: .\nroles: {default: raw}\ndisplays:\n  d:\n"
        "    - !<View> {name: v, colorspace: raw}\nactive_displays: []\nactive_views: []\ncolorspaces:\n"
        "  - !<ColorSpace> {name: raw, isdata: false}\n" + "".join(spaces)
    )
    command = [str(Path(sys.executable).with_name("ociobakelut")), "--iconfig", "config.ocio", "--inputspace", "raw"]
    command += ["--outputspace", str(len(shapes) - 1), "--format", "resolve_cube", "--cubesize", "33", "baked.cube"]
    shaped = product(range(len(shapes) - 1), (4096, 65536))
    for shaper in ([], *(["--shaperspace", str(at), "--shapersize", str(length)] for at, length in shaped)):
        subprocess.run([*command, *shaper], cwd=folder, check=True, capture_output=True)
        yield folder / "baked.cube"


STYLES = ("standard", "vivid")
PLAN = (
    (1.0, None, "wall"), (0.3, None, "wall"), (0.8, "tungsten", "still-life"), (0.7, "shade", "still-life"),
    (0.5, "daylight", "wall"), (0.6, "fluorescent", "wall"), (1.3, "cloudy", "still-life"), (0.25, "tungsten", "wall"),
    (1.4, "tungsten", "wall"), (1.3, "shade", "wall"), (0.9, None, "still-life"), (0.4, "shade", "chart"),
)  # fmt: skip
"""Relative exposure, light (None: the one that the white balance is made for) and scene of a setting's shots."""
UNSEEN = (("still-life", 7, "daylight", 0.6), ("wall", 77, "daylight", 0.7), ("still-life", 8, "tungsten", 0.7))
SIDE = 8


def refinishes(keep: Path) -> Figures:
    """Every pair of settings of a simulated camera, 144 shots: RMSE of the means of tiles and of single pixels.

    The floor is what the camera's own functions make of the same 8-bit JPEGs of quality 95.
    """
    camera, folder = nikon_d5100(), keep / "refinish"
    settings, table = list(product(STYLES, camera.white_balances)), folder / "samples.csv"
    if not table.exists():
        for number, (style, balance) in enumerate(settings):
            for index, (exposure, light, scene) in enumerate(PLAN):
                place, count = divmod(number, len(settings) // 2)
                picture = SCENES[scene](616, 920, 200 + 80 * place + len(PLAN) * count + index)
                taken = CameraSettings(style, balance, camera.nominal_exposure_s * exposure)
                photograph(camera, picture, taken, folder / "shots", f"{style}-{balance}-{index}", light=light)
        lf.sample([folder / "shots"]).save(table)
    profile = lf.calibrate(lf.read_samples(table))
    encoded = {setting: np.concatenate(tiles) for setting, tiles in _unseen_tiles(camera, folder, settings).items()}
    usable = {at: np.all((tiles > 0.002) & (tiles < 0.998), axis=(1, 2)) for at, tiles in encoded.items()}
    raw = {at: profile.linearize("/".join(at))(tiles) for at, tiles in encoded.items()}
    true_raw = {}
    for at, tiles in encoded.items():
        # Most colours of a JPEG occur more than once, and the true inverse is found by bisection.
        colours, rows = np.unique(tiles[usable[at]].reshape(-1, 3), axis=0, return_inverse=True)
        true_raw[at] = np.zeros_like(tiles)
        true_raw[at][usable[at]] = camera.linearize(colours, *at)[rows.ravel()].reshape(-1, SIDE * SIDE, 3)
    errors = []
    for source, target in permutations(settings, 2):
        selectors = profile.selector("/".join(source)), profile.selector("/".join(target))
        exposed = raw_to_balanced(profile, selectors[0], profile, selectors[1])
        steps = steps_of(profile.refinish(*selectors))
        both = usable[source] & usable[target]
        made = steps.render(steps.highlights(through_stages(exposed, raw[source][both])))
        off = [made - encoded[target][both], camera.render(true_raw[source][both], *target) - encoded[target][both]]
        errors.append([[np.sqrt(np.mean(each**2)) for each in (one.mean(axis=1), one)] for one in off])
    for side, compared in (("", True), (", floor", False)):
        for name, values in zip(("tiles", "pixels"), np.array(errors)[:, int(not compared)].T, strict=True):
            yield Figure(f"refinish, 132 pairs, {name}{side}: median", float(np.median(values)), compared=compared)
            yield Figure(f"refinish, 132 pairs, {name}{side}: max", float(values.max()), compared=compared)


def _unseen_tiles(
    camera: SimulatedCamera, folder: Path, settings: list[tuple[str, str]]
) -> dict[tuple[str, str], list[Array]]:
    """The 8 × 8 pixels (tiles, 64, 3) of scenes that were held out, by setting."""
    tiles: dict[tuple[str, str], list[Array]] = {setting: [] for setting in settings}
    for number, (scene, seed, light, exposure) in enumerate(UNSEEN):
        place, exposure_s = folder / "held-out" / str(number), camera.nominal_exposure_s * exposure
        if not (place / "shot.dng").exists():
            taken = CameraSettings("standard", light, exposure_s)
            photograph(camera, SCENES[scene](404, 608, seed), taken, place, "shot", light=light)
        for (style, balance), parts in tiles.items():
            path = place / f"{style}-{balance}.jpg"
            if not path.exists():
                shot = Photograph(place / "shot.dng", None)
                develop_again(camera, shot, CameraSettings(style, balance, exposure_s), path)
            pixels = read_image(path).pixels
            rows, columns = (length // SIDE for length in pixels.shape[:2])
            cut = pixels[: rows * SIDE, : columns * SIDE].reshape(rows, SIDE, columns, SIDE, 3).swapaxes(1, 2)
            parts.append(cut.reshape(rows * columns, SIDE * SIDE, 3).astype(np.float64))
    return tiles


def charts() -> Figures:
    """Ten cameras, trained on a chart under one light and tested under the other: RMSE of JPEG → RAW by model."""
    example = runpy.run_path(str(ROOT / "examples" / "middlebury_table.py"))
    for light in ("light1", "light2"):
        rows = example["table"](light)
        for method in example["METHODS"]:
            values = [row.rmse[method] for row in rows]
            yield Figure(f"charts, {light}, {method}: mean", float(np.mean(values)))
            yield Figure(f"charts, {light}, {method}: max", float(np.max(values)))


def matches() -> Figures:
    """Ten cameras of which none has RAW but a Nikon D200: mean distances of the 90 pairs of pictures, one matched."""
    charts = lf.read_samples(CHARTS)
    for light in ("light1", "light2"):
        samples = charts.select(np.char.startswith(charts.shot, light))
        raw, cameras = samples.select(samples.camera == "NikonD200"), []
        for name in np.unique(samples.camera):
            own = taken = samples.select(samples.camera == name)
            if name != "NikonD200":
                here, there = _same_patches(own, raw)
                none = np.full((len(here), 3), np.nan)
                taken = replace(own.select(here), raw=raw.raw[there], raw_camera=raw.camera[there], wb=none)
            cameras.append((own, calibrate(taken)[0]))
        errors = []
        for (first, source), (second, target) in permutations(cameras, 2):
            here, there = _same_patches(first, second)
            x, y = first.srgb[here], second.srgb[there]
            inside = np.all((np.minimum(x, y) > 0.02) & (np.maximum(x, y) < 0.98), axis=1)
            made = match(source, "standard/wb1", target, "standard/wb1")(x[inside])
            errors.append(np.linalg.norm(made - y[inside], axis=1).mean())
        yield Figure(f"charts matched, {light}: median", float(np.median(errors)))
        yield Figure(f"charts matched, {light}: pairs of 90 beyond 0.03", float(np.sum(np.array(errors) > 0.03)))


def _same_patches(samples_a: lf.SampleSet, samples_b: lf.SampleSet) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    here, there = (np.char.add(np.char.add(side.shot, "/"), side.patch) for side in (samples_a, samples_b))
    _, first, second = np.intersect1d(here, there, return_indices=True)
    return first, second


def charts_without_raw() -> Figures:
    """Input transforms of cameras without RAW, ΔE00 of exposures and of surfaces that were not photographed."""
    settings = (("daylight", "daylight"), ("tungsten", "tungsten"), ("daylight", "cloudy"))
    for camera, (light, white_balance) in product((nikon_d5100(), sigma_sd_merrill()), settings):
        with tempfile.TemporaryDirectory() as folder:
            errors = input_transforms.errors(camera, light, white_balance, Path(folder))
        for method, values in errors.items():
            for what, value in zip(("chart", "other surfaces"), values, strict=True):
                name = f"input transform, {camera.model}, {light} on {white_balance}, {what}, {method}"
                yield Figure(name, value, compared=method == "LutForge")


def transfers() -> Figures:
    """One simulated camera's RAW in the look of another: RMSE on 600 surfaces that no fit saw, under six lights.

    Fitted to the patches of a chart and 99 surfaces with a little noise. The best one matrix is fitted to the rendered
    values of the 600 themselves.
    """
    for source, target in permutations((nikon_d5100(), sigma_sd_merrill()), 2):
        by_light = np.array([_transfer_errors(source, target, light) for light in source.white_balances])
        for form, values in zip(("matrix", "best one matrix"), by_light.T, strict=True):
            name, compared = f"transfer {source.model} to {target.model}, {form}", form != "best one matrix"
            yield Figure(f"{name}: least RMSE", values.min(), compared=compared)
            yield Figure(f"{name}: worst RMSE", values.max(), compared=compared)


def _transfer_errors(source: SimulatedCamera, target: SimulatedCamera, light: str) -> list[float]:
    rng = np.random.default_rng(0)
    surfaces, unseen = np.vstack([chart_reflectances(), surface_reflectances()]), palette(600, np.random.default_rng(9))
    x, y = (camera.expose(surfaces, light) + rng.normal(0, 0.002, (len(surfaces), 3)) for camera in (source, target))
    raw, truth = (camera.expose(unseen, light) for camera in (source, target))
    fit = fit_raw_transfer(source.name, target.name, x, y, 1 / source.multipliers(light))
    expected = target.render(truth, "standard", light)
    inside = np.all((expected > 0.004) & (expected < 0.996), axis=1)

    def residual(values: Array) -> Array:
        return np.asarray((target.render(values, "standard", light) - expected)[inside].ravel())

    best = least_squares(lambda m: residual(raw @ m.reshape(3, 3).T), fit.matrix.ravel(), x_scale=0.1).fun
    return [float(np.sqrt(np.mean(off**2))) for off in (residual(fit(raw)), best)]


def configs(data: Path, keep: Path) -> Figures:
    """JPEG to the scene reference and back through the written config, over colours that the model makes."""
    profiles = {
        "D40": (common.nikon_d40(data), "standard/daylight"),
        "S40": (lf.calibrate(common.s40(data, keep)), "standard/auto"),
        "simulated, standard": (common.demo(keep)[1], "standard/daylight"),
        "simulated, vivid": (common.demo(keep)[1], "vivid/daylight"),
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


HANDFUL = ("Canon_EOS_R5", "Sony_ILCE-7M3", "Canon 300D")
"""Cameras of the fleet's first half: charts, casual photographs of a published rendering, and a single chart."""


def some_of_the_fleet(data: Path, keep: Path) -> Figures:
    """Three cameras to choose on; `make fleet` has all, and those to report on."""
    for camera in fleet(data):
        if camera.name in HANDFUL:
            for name, value in measure(camera, keep).items():
                yield Figure(f"fleet, {camera.name}, {name}", value, compared=is_error(name))


def parts(keep: Path, *, quick: bool) -> Parts:
    """What a run measures, by name."""
    sizes = (13, 17, 33) if quick else (9, 13, 17, 24, 33, 65)
    made: dict[str, Callable[[], Figures]] = {"d40": partial(d40, sizes), "simulated": partial(simulated, keep)}
    data = common.real_data()
    if data is not None:
        made |= {"s40": partial(s40, data, keep), "fleet": partial(some_of_the_fleet, data, keep)}
    if not quick:
        made |= {"refinishes": partial(refinishes, keep), "charts": charts}
        made |= {"transfers": transfers, "matches": matches, "charts_without_raw": charts_without_raw}
        if data is not None:
            made |= {"bakes": partial(bakes, data), "configs": partial(configs, data, keep)}
    return made


def main() -> int:
    """Print the figures."""
    parser = common.parser(__doc__)
    parser.add_argument("--quick", action="store_true", help="the D40, the S40, the demo, three of the fleet")
    arguments = parser.parse_args()
    return common.measured(partial(parts, quick=arguments.quick), arguments)


if __name__ == "__main__":
    sys.exit(main())
