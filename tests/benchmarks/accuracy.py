"""Every accuracy figure that a change of LutForge must keep, measured in one run and compared with an earlier one.

    python -m tests.benchmarks.accuracy [--quick] [--only WORD …] [--json FILE] [--compare FILE] [--keep DIR]

Prints one figure a row under a stable name; lower is better in every row. `--compare` prints the ratio to an earlier
`--json` and marks what is worse by more than 3 %; the exit status is then 1. `--quick` measures the published Nikon D40
at three sizes, the Canon S40 and the simulated camera. `--only` keeps the parts whose names hold a word. Photographs of
the simulated cameras are made anew, or taken from `--keep DIR`. LUTFORGE_TEST_DATA names the folder of real data; the
parts that need it are left out where it is missing.

Errors are Euclidean norms of the RGB difference, 1 = full scale, or ΔE00. Seconds are printed, but never marked.
"""

import argparse
import importlib.util
import json
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses
from numpy.typing import NDArray
from scipy.stats import qmc

import lutforge as lf
from lutforge.colour.srgb import delta_e_2000
from lutforge.images.read import read_image
from lutforge.model.published_model import read_published_model
from lutforge.simulate.camera import nikon_d5100, sigma_sd_merrill
from lutforge.simulate.demo import DemoShots, demo_shots
from tests.benchmarks import bake_table, raw_transfer_table, refinish_table

Array = NDArray[np.float64]
Figures = Iterator[tuple[str, float]]
"""Name of a row and its value."""

ROOT = Path(__file__).resolve().parents[2]
SEEDS = (1, 2, 3, 4, 5)
"""Splits of the published pairs."""
WORSE = 1.03
"""A ratio above this is marked."""


def samples_of(camera: str, raw: Array, srgb: Array, multipliers: Array | float = 1.0) -> lf.SampleSet:
    """RAW and JPEG colours (n, 3) as samples of one style and white balance, dealt out to ten shots."""
    count = len(raw)
    names, shots = np.full(count, camera), np.char.add("shot", (np.arange(count) % 10).astype(np.str_))
    known = np.broadcast_to(multipliers, (count, 3)).astype(np.float64)
    patches, times = np.arange(count).astype(np.str_), np.full(count, 0.01)
    style, balance = np.full(count, "standard"), np.full(count, "daylight")
    return lf.SampleSet(names, style, balance, shots, patches, times, raw, srgb, known, names)


def d40(sizes: tuple[int, ...], data: Path) -> Figures:
    """Published pairs of the Nikon D40, 70 % fitted, 30 % predicted: medians of five splits."""
    published = read_published_model(data / "nus_nikon_d40" / "other_white_balances")
    default, thesis = lf.CalibrationOptions(), lf.CalibrationOptions(preset="thesis")
    presets = {"": default, ", thesis": thesis, ", uniform": replace(thesis, nonuniform=False)}
    for size in sizes:
        for preset, options in presets.items():
            if preset and size not in (13, 17, 24):
                continue
            found: dict[str, list[tuple[float, float, float]]] = {}
            for seed in SEEDS:
                order = np.random.default_rng(seed).permutation(len(published.balanced))
                seen, unseen = order[: int(0.7 * len(order))], order[int(0.7 * len(order)) :]
                samples = samples_of("Nikon D40", published.balanced[seen], published.encoded[seen])
                lattice = lf.calibrate(samples, replace(options, size=size)).styles["standard"].render
                assert lattice is not None
                rendered = np.clip(lattice(published.balanced[unseen]), 0.0, 1.0)
                error = np.linalg.norm(rendered - published.encoded[unseen], axis=1)
                entry = float(error.mean()), float(np.quantile(error, 0.95)), float(error.max())
                found.setdefault(preset, []).append(entry)
            for name, entries in found.items():
                for figure, value in zip(("mean", "95 %", "max"), np.median(entries, axis=0), strict=True):
                    yield f"D40 {size}³{name}: {figure}", float(value)


def s40(data: Path) -> Figures:
    """Five photographs of a Canon PowerShot S40, each left out in turn, beside the baselines."""
    samples = lf.sample([data / "canon_powershot_s40"])
    profile = lf.calibrate(samples)
    for name, value in sorted(profile.styles["standard"].errors.items()):
        yield f"S40, in the profile: {name}", value
    for row in lf.evaluate(profile, samples).rows:
        if row.shot == "all":
            yield f"S40 {row.direction}, {row.method}: mean", row.figures.mean
            yield f"S40 {row.direction}, {row.method}: max", row.figures.maximum
            if row.figures.de00_mean is not None:
                yield f"S40 {row.direction}, {row.method}: ΔE00", row.figures.de00_mean


def simulated(keep: Path) -> Figures:
    """The demo's simulated camera: colours of the photograph that was held out, against the known truth."""
    shots = demo_shots(keep / "demo")
    profile = lf.calibrate(lf.sample(list(shots.calibration)))
    for name, style in profile.styles.items():
        for figure, value in sorted(style.errors.items()):
            yield f"simulated, {name}, in the profile: {figure}", value
    yield from _against_the_truth(profile, shots)
    assert shots.held_out.jpeg is not None
    before, wanted = (
        read_image(path).pixels[..., :3].astype(np.float64) for path in (shots.held_out.jpeg, shots.wanted)
    )
    usable = ((before > 0) & (before < 1) & (wanted > 0) & (wanted < 1)).all(axis=-1)
    after = np.rint(255 * np.clip(profile.refinish(shots.source, shots.target, shots.ev)(before[usable]), 0, 1)) / 255
    yield from _figures("simulated, graded picture", after, wanted[usable], display=True)


def _against_the_truth(profile: lf.CameraProfile, shots: DemoShots) -> Figures:
    raw, camera = lf.sample([shots.held_out.dng]).raw, shots.camera
    (style, balance), (target_style, target_balance) = shots.source.split("/"), shots.target.split("/")
    before = camera.render(raw, style, balance)
    after = camera.render(raw, target_style, target_balance, shots.ev)
    cases = {
        f"render {shots.source}": (profile.render(shots.source)(raw), before, True),
        f"render {shots.target}": (profile.render(shots.target)(raw * 2**shots.ev), after, True),
        f"linearize {shots.source}": (profile.linearize(shots.source)(before), raw, False),
        "refinish": (profile.refinish(shots.source, shots.target, shots.ev)(before), after, True),
    }
    usable = ((before > 0.002) & (before < 0.998) & (after > 0.002) & (after < 0.998)).all(axis=-1)
    for name, (got, truth, display) in cases.items():
        yield from _figures(f"simulated, {name}", got[usable], truth[usable], display=display)


def _figures(name: str, got: Array, wanted: Array, *, display: bool) -> Figures:
    yield f"{name}: mean", float(np.linalg.norm(got - wanted, axis=1).mean())
    yield f"{name}: RMSE", float(np.sqrt(np.mean((got - wanted) ** 2)))
    if display:
        yield f"{name}: ΔE00", float(delta_e_2000(got, wanted).mean())


def bakes(data: Path) -> Figures:
    """Baked files of the physical D40 model, a render and a refinish, and the best of `ociobakelut` at 33³ beside."""
    chosen = bake_table.transforms(bake_table.nikon_d40(data))
    for name in ("render daylight", "refinish tungsten to daylight +0 EV"):
        with tempfile.TemporaryDirectory() as work:
            ours = bake_table.ours(chosen[name], Path(work), (17, 33), (".clf", ".cube", ".csp"))
            theirs = bake_table.theirs(chosen[name], Path(work), (33,), (".cube",))
        for side, files in (("bake", ours), ("ociobakelut", theirs)):
            for what, (mean, most) in files.items():
                yield f"{side} {name}, {what}³: mean ΔE00", mean
                yield f"{side} {name}, {what}³: max ΔE00", most


def refinishes(keep: Path) -> Figures:
    """Every pair of settings of a simulated camera, 144 shots: RMSE of the means of tiles and of single pixels."""
    camera, folder = nikon_d5100(), keep / "refinish"
    profile = refinish_table.calibrated(camera, folder)
    found = refinish_table.errors(camera, profile, refinish_table.held_out(camera, profile, folder))
    tiles, _, pixels, _ = np.array(list(found.values())).T
    for name, values in (("tiles", tiles), ("pixels", pixels)):
        yield f"refinish, 132 pairs, {name}: median", float(np.median(values))
        yield f"refinish, 132 pairs, {name}: max", float(values.max())


def charts() -> Figures:
    """Ten cameras, trained on a chart under one light and tested under the other: RMSE of JPEG → RAW by model."""
    path = ROOT / "examples" / "middlebury_table.py"
    spec = importlib.util.spec_from_file_location("middlebury_table", path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["middlebury_table"] = module
    spec.loader.exec_module(module)
    for light in ("light1", "light2"):
        rows = module.table(light)
        for method in module.METHODS:
            values = [row.rmse[method] for row in rows]
            yield f"charts, {light}, {method}: mean", float(np.mean(values))
            yield f"charts, {light}, {method}: max", float(np.max(values))


def unseen_colours() -> Figures:
    """33³ lattices from 5,000 colours of simulated cameras, even in RAW or in codes; ΔE00 of 10,000 others."""
    for camera in (nikon_d5100(), sigma_sd_merrill()):
        gain = camera.multipliers("daylight")
        for style in camera.styles:
            for spread in ("encoded", "RAW"):
                colours = []
                for seed, count in ((1, 5_000), (2, 10_000)):
                    drawn = np.random.default_rng(seed).random((8 * count, 3))
                    if spread == "encoded":
                        drawn = camera.linearize(0.01 + 0.98 * drawn, style, "daylight") * gain
                    balanced = drawn[np.all((drawn > 0) & (drawn < 1), axis=1)]
                    encoded = camera.render(balanced / gain, style, "daylight")
                    inside = np.all((encoded > 0.5 / 255) & (encoded < 1 - 0.5 / 255), axis=1)
                    colours.append((balanced[inside][:count] / gain, encoded[inside][:count]))
                (raw, encoded), (other, wanted) = colours
                samples = samples_of(camera.name, raw, np.rint(255 * encoded) / 255, np.asarray(gain))
                rendered = lf.calibrate(samples).render("standard/daylight")(other)
                error = delta_e_2000(np.clip(rendered, 0.0, 1.0), wanted)
                name = f"unseen colours, {camera.model} {style}, {spread}"
                yield f"{name}: mean ΔE00", float(error.mean())
                yield f"{name}: 95 % ΔE00", float(np.quantile(error, 0.95))


def transfers() -> Figures:
    """One simulated camera's RAW in the look of another: RMSE on surfaces that no fit saw, worst of six lights."""
    for source, target in ((nikon_d5100(), sigma_sd_merrill()), (sigma_sd_merrill(), nikon_d5100())):
        by_light = [raw_transfer_table.errors(source, target, light) for light in source.white_balances]
        for form, values in zip(raw_transfer_table.FORMS, zip(*by_light, strict=True), strict=False):
            yield f"transfer {source.model} to {target.model}, {form}: worst RMSE", max(values)


def configs(data: Path) -> Figures:
    """JPEG to the scene reference and back through the written config, over colours that the model makes."""
    models = [data / "nus_nikon_d40" / name for name in ("other_white_balances", "fluorescent")]
    profiles = {
        "D40": (lf.import_published(models, "Nikon D40"), "standard/daylight"),
        "S40": (lf.calibrate(lf.sample([data / "canon_powershot_s40"])), "standard/auto"),
    }
    for name, (profile, selector) in profiles.items():
        with tempfile.TemporaryDirectory() as folder:
            began = time.perf_counter()
            path = lf.write_config([profile], Path(folder) / "ocio")
            seconds = time.perf_counter() - began
            config = OCIO.Config.CreateFromFile(str(path))
            balanced = np.concatenate([qmc.Sobol(3, rng=21).random(1 << 17), qmc.Sobol(3, rng=22).random(1 << 17) ** 2])
            jpeg = profile.render(selector)(balanced / profile.multipliers(selector))
            pixels = np.ascontiguousarray(np.clip(jpeg, 0.0, 1.0), dtype=np.float32)
            trip = pixels.copy()
            space = f"{profile.camera} {selector.replace('/', ' ')}"
            for ends in ((space, "aces_interchange"), ("aces_interchange", space)):
                config.getProcessor(*ends).getDefaultCPUProcessor().applyRGB(trip)
        error = np.linalg.norm(trip.astype(np.float64) - pixels, axis=1)
        yield f"config {name}, round trip: mean", float(error.mean())
        yield f"config {name}, round trip: 99.9 %", float(np.quantile(error, 0.999))
        yield f"config {name}, round trip: max", float(error.max())
        yield f"config {name}: seconds", seconds


def parts(keep: Path, data: Path | None, *, quick: bool) -> dict[str, Callable[[], Figures]]:
    """What a run measures, by name."""
    real: dict[str, Callable[[Path], Figures]] = {
        "d40": lambda folder: d40((13, 17, 33) if quick else (9, 13, 17, 24, 33, 65), folder),
        "s40": s40,
    }
    made: dict[str, Callable[[], Figures]] = {"simulated": lambda: simulated(keep)}
    if not quick:
        real |= {"bakes": bakes, "configs": configs}
        made |= {
            "refinishes": lambda: refinishes(keep),
            "charts": charts,
            "unseen_colours": unseen_colours,
            "transfers": transfers,
        }
    if data is None:
        print("no real data: set LUTFORGE_TEST_DATA to its folder", file=sys.stderr)
        return made
    return {name: partial(part, data) for name, part in real.items()} | made


def compared(name: str, value: float, before: dict[str, float]) -> tuple[str, bool]:
    """The line of a row, and whether it is marked as worse."""
    if name not in before:
        return f"{name:<66}{value:10.5f}", False
    ratio = value / before[name] if before[name] else (1.0 if value == 0 else float("inf"))
    worse = ratio > WORSE and not name.endswith("seconds") and not name.startswith("ociobakelut")
    return f"{name:<66}{value:10.5f}{before[name]:10.5f}{ratio:8.3f}{'  WORSE' if worse else ''}", worse


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--quick", action="store_true", help="the D40 at three sizes, the S40, the simulated camera")
    parser.add_argument("--only", nargs="+", default=[], metavar="WORD", help="the parts whose names hold a word")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    parser.add_argument("--compare", type=Path, help="an earlier file of figures")
    parser.add_argument("--keep", type=Path, help="where photographs of simulated cameras are kept between runs")
    arguments = parser.parse_args()
    before = json.loads(arguments.compare.read_text()) if arguments.compare else {}
    place = os.environ.get("LUTFORGE_TEST_DATA", str(ROOT.parent / "shared" / "data"))
    data = Path(place) if Path(place).is_dir() else None
    found: dict[str, float] = {}
    marked = 0
    with tempfile.TemporaryDirectory() as temporary:
        keep = arguments.keep or Path(temporary)
        for part, measure in parts(keep, data, quick=arguments.quick).items():
            if arguments.only and not any(word in part for word in arguments.only):
                continue
            began = time.perf_counter()
            for name, value in measure():
                found[name] = value
                line, worse = compared(name, value, before)
                marked += worse
                print(line, flush=True)
            print(f"# {part}: {time.perf_counter() - began:.0f} s", file=sys.stderr, flush=True)
            if arguments.json:
                arguments.json.write_text(json.dumps(found, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    if before:
        print(f"{marked} of {len(found)} rows are worse by more than {WORSE - 1:.0%}")
    return int(marked > 0)


if __name__ == "__main__":
    sys.exit(main())
