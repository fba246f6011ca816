"""How right the estimator is on a fleet of cameras whose truth is known: what a change of it is judged by.

    LUTFORGE_TEST_DATA=DIR python -m tests.benchmarks.fleet [--half choose|report] [--only NAME …] [--json FILE]
        [--compare FILE] [--tables FILE …]

Each camera is calibrated from samples like a person's, and asked for colours of other reflectances, lights and
exposures. A change is chosen on the cameras of the first half, and lands with the figures of both. Printed are all
figures of each camera, lower is better, then a table of each half, the worst camera first. `--compare` prints the
ratio to an earlier `--json`. `--tables` measures nothing: it prints the tables of the guide, in Markdown, from earlier
`--json` files, the oldest first. LUTFORGE_TEST_DATA names the folder of real data; without it nothing is measured.

ΔE00 of a linearization is that of its light as linear sRGB through the camera's true matrix; RMSE is of balanced RAW.
"bare" is the refinish without its care for white. The kriging beside is plain universal kriging in sixty lines.
"""

import json
import os
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from functools import partial
from itertools import permutations, product
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.spatial.distance import cdist

import lutforge as lf
from lutforge.arrays import Array, Mask
from lutforge.colour.srgb import delta_e_2000, srgb_decode, srgb_encode
from lutforge.model.camera_profile import CameraProfile, match
from tests.benchmarks import common
from tests.benchmarks.common import HALF_CODE, Figure, Figures, heading, row
from tests.benchmarks.fleet_cameras import LIGHTS, STYLES, FleetCamera, Half, fleet

PER_SETTING = 1000
"""Colours that each setting is asked for; as many for each pair of settings."""
BRIGHT, SATURATED = 230 / 255, 0.6
"""A bright colour has a code above this; of a saturated one the least code is less than 1 − this of the largest."""
BELOW_WHITE = 200 / 255
"""Colours whose least code is below this are none of white's."""
TINTS = ((254, 254, 254), (254, 250, 245), (245, 250, 254), (250, 254, 250), (254, 248, 254), (254, 234, 214))
WORKERS = 2


def kriging(balanced: Array, encoded: Array, most: int = 2000) -> tuple[Callable[[Array], Array], ...]:
    """RAW → JPEG and back, fitted to unclipped samples Tw E → I, each (n, 3), at most so many of them."""
    order = np.random.default_rng(0).permutation(len(balanced))[:most]
    x, y = balanced[order], encoded[order]
    weight = 1 / (0.03 + x.mean(axis=1, keepdims=True))
    matrix = np.linalg.lstsq(x * weight, srgb_decode(y) * weight, rcond=None)[0].T
    matrix /= matrix.sum(axis=1, keepdims=True)
    offset, power = 0.005, 1 / 2.4

    def even(linear: Array) -> Array:
        return np.asarray(np.sign(linear) * ((np.abs(linear) + offset) ** power - offset**power))

    def uneven(z: Array) -> Array:
        return np.asarray(np.sign(z) * ((np.abs(z) + offset**power) ** (1 / power) - offset))

    def covariance(one: Array, other: Array) -> Array:
        distance = cdist(one, other)
        smooth = np.sqrt(3) * distance / 0.8
        return np.asarray(0.2 * np.exp(-distance / 3.2) + 0.8 * (1 + smooth) * np.exp(-smooth))

    def kriged(z: Array, values: Array) -> Callable[[Array], Array]:
        trend = np.column_stack([np.ones(len(z)), z])
        factor = cho_factor(covariance(z, z) + 1e-3 * np.eye(len(z)))
        of_trend = cho_solve(factor, trend)
        slope = np.linalg.solve(trend.T @ of_trend, of_trend.T @ values)
        rest = cho_solve(factor, values - trend @ slope)
        return lambda q: np.asarray(covariance(q, z) @ rest + slope[0] + q @ slope[1:])

    z = even(x @ matrix.T)
    curves = [np.polyfit(z[:, c], y[:, c], 5) for c in range(3)]  # the response, of all colours alike
    curved = np.stack([np.polyval(curves[c], z[:, c]) for c in range(3)], axis=1)
    low, high = z.min(axis=0), z.max(axis=0)
    forward, backward = kriged(z, y - curved), kriged(y, z)

    def render(q: Array) -> Array:
        at = even(q @ matrix.T)
        curve = np.stack([np.polyval(curves[c], np.clip(at[:, c], low[c], high[c])) for c in range(3)], axis=1)
        return np.clip(curve + forward(at), 0.0, 1.0)

    return render, lambda codes: uneven(backward(codes)) @ np.linalg.inv(matrix).T


def whole(encoded: Array) -> Mask:
    """Colours (n,) without a clipped channel."""
    return np.asarray(np.all((encoded > HALF_CODE) & (encoded < 1 - HALF_CODE), axis=1))


def measure(camera: FleetCamera, folder: Path) -> dict[str, float]:
    """All figures of a camera but those of pairs of cameras; its profile is saved in the folder."""
    samples = camera.samples()
    began = time.process_time()
    profile = lf.calibrate(samples)
    values = {"calibration: CPU seconds": time.process_time() - began}
    profile.save(folder / f"{camera.half} {camera.name}.npz")
    values |= rendered_and_linearized(camera, profile, samples)
    values |= refinished(camera, profile)
    values |= written(camera, profile)
    values |= properties(camera, profile)
    if camera.sampling == "casual":
        corners = [vignetting.corner_ev for vignetting in profile.vignettings] or [0.0]
        values["vignetting: off by, EV"] = float(np.max(np.abs(np.array(corners) - camera.vignetting)))
    return values


def settings(profile: CameraProfile) -> list[tuple[str, str]]:
    """Styles and white balances that samples were given of."""
    return [(style, balance) for style in STYLES for balance in LIGHTS if balance in profile.white_balances]


def unseen(camera: FleetCamera, seed: int, balance: str) -> Array:
    """RAW (n, 3): of a setting's own light three in five, the others of other lights."""
    rng = np.random.default_rng([seed, camera.seed, list(LIGHTS).index(balance)])
    parts = [camera.unseen(rng, PER_SETTING * (6 if light == balance else 1) // 10, light) for light in LIGHTS]
    return np.concatenate(parts)


def rendered_and_linearized(camera: FleetCamera, profile: CameraProfile, samples: lf.SampleSet) -> dict[str, float]:
    """Errors to the truth on colours that no fit saw, beside kriging, and beside what the profile says of itself."""
    errors: dict[str, list[Array]] = {}
    ratios: dict[str, list[float]] = {"render": [], "linearize": []}
    balances, others = settings(profile), {}
    for style in STYLES:
        rows = (samples.style == style) & whole(samples.srgb) & np.all(samples.raw < 0.999, axis=1)
        gains = np.array([profile.multipliers(f"{style}/{balance}") for balance in samples.white_balance[rows]])
        others[style] = kriging(samples.raw[rows] * gains, samples.srgb[rows])
        distances: dict[str, list[Array]] = {"render": [], "linearize": []}
        for _, balance in (setting for setting in balances if setting[0] == style):
            name, factors = f"{style}/{balance}", camera.balances[balance]
            raw = unseen(camera, 1, balance)
            raw = raw[camera.known(raw, style, balance)]
            truth = camera.render(raw, style, balance)
            made = np.clip(profile.render(name)(raw), 0.0, 1.0)
            own = np.clip(profile.render(name, model="model")(raw), 0.0, 1.0)
            beside = others[style][0](np.minimum(raw * profile.multipliers(name), 1.0))
            for of, colours in {"render": made, "render, model": own, "render, kriging": beside}.items():
                errors.setdefault(of, []).append(delta_e_2000(colours, truth))
            errors.setdefault("largest code", []).append(truth.max(axis=1))
            errors.setdefault("least code", []).append(truth.min(axis=1))
            inside = whole(truth) & np.all(raw * factors < 1.0, axis=1)
            raw, truth, made = raw[inside], truth[inside], made[inside]
            distances["render"].append(np.linalg.norm(made - truth, axis=1))
            errors.setdefault("largest code of JPEG", []).append(truth.max(axis=1))
            expected = srgb_encode(np.clip(raw * factors @ camera.matrix.T, 0.0, 1.0))
            back = {
                "linearize": profile.linearize(name)(truth),
                "linearize, kriging": others[style][1](truth) / profile.multipliers(name),
            }
            for of, light in back.items():
                shown = srgb_encode(np.clip(light * factors @ camera.matrix.T, 0.0, 1.0))
                errors.setdefault(of, []).append(delta_e_2000(shown, expected))
                errors.setdefault(f"{of}, squared", []).append(np.mean(((light - raw) * factors) ** 2, axis=1))
            distances["linearize"].append(np.linalg.norm((back["linearize"] - raw) * factors, axis=1))
        for direction, parts in distances.items():
            words = profile.styles[style].errors.get(f"{direction}_mean")
            if words is not None:
                ratios[direction].append(float(words / np.concatenate(parts).mean()))
    all_of = {name: np.concatenate(parts) for name, parts in errors.items()}
    values: dict[str, float] = {}
    for name in ("render", "render, model", "render, kriging", "linearize", "linearize, kriging"):
        values |= quantiles(name, all_of[name])
        if f"{name}, squared" in all_of:
            values[f"{name}: RMSE"] = float(np.sqrt(all_of[f"{name}, squared"].mean()))
    bright = all_of["largest code"] > BRIGHT
    saturated = all_of["least code"] < (1 - SATURATED) * all_of["largest code"]
    for name in ("render", "render, kriging"):
        values[f"{name}, bright: ΔE00 mean"] = float(all_of[name][bright].mean())
        values[f"{name}, saturated: ΔE00 mean"] = float(all_of[name][saturated].mean())
    bright = all_of["largest code of JPEG"] > BRIGHT
    for name in ("linearize", "linearize, kriging"):
        values[f"{name}, bright: RMSE"] = float(np.sqrt(all_of[f"{name}, squared"][bright].mean()))
    for direction, each in ratios.items():
        if each:
            values[f"{direction}: held-out error / true"] = float(np.mean(each))
    return values


def quantiles(name: str, difference: Array) -> dict[str, float]:
    """Mean, 95 %, 99.9 % and largest of ΔE00 (n,)."""
    high, far = np.quantile(difference, (0.95, 0.999))
    parts = {"mean": difference.mean(), "95 %": high, "99.9 %": far, "max": difference.max()}
    return {f"{name}: ΔE00 {part}": float(value) for part, value in parts.items()}


def refinished(camera: FleetCamera, profile: CameraProfile) -> dict[str, float]:
    """All pairs of settings against the truth, on colours that neither clips, with the care for white and bare."""
    rng = np.random.default_rng([2, camera.seed])
    raw = np.concatenate([camera.unseen(rng, PER_SETTING // 5, light) for light in LIGHTS])
    known = settings(profile)
    truth = {at: camera.render(raw, *at) for at in known}
    usable = {
        at: whole(truth[at]) & camera.known(raw, *at) & np.all(raw * camera.balances[at[1]] < 1, axis=1) for at in known
    }
    pairs: dict[str, list[float]] = {"refinish": [], "refinish, bare": []}
    below: dict[str, list[Array]] = {"refinish": [], "refinish, bare": []}
    moved, steps, bare_steps = 0.0, 0.0, 0.0
    for source, target in permutations(known, 2):
        both = usable[source] & usable[target]
        x, expected = truth[source][both], truth[target][both]
        ends = "/".join(source), "/".join(target)
        chains = {
            "refinish": profile.refinish(*ends),
            "refinish, bare": profile.refinish(*ends, neutral_highlights=False),
        }
        made = {name: np.clip(chain(x), 0.0, 1.0) for name, chain in chains.items()}
        far = x.min(axis=1) < BELOW_WHITE
        for name, colours in made.items():
            squared = np.mean((colours - expected) ** 2, axis=1)
            pairs[name].append(float(np.sqrt(squared.mean())))
            below[name].append(squared[far])
        moved = max(moved, float(255 * np.abs(made["refinish"] - made["refinish, bare"])[far].max(initial=0.0)))
        steps = max(steps, largest_step(chains["refinish"]))
        bare_steps = max(bare_steps, largest_step(chains["refinish, bare"]))
    values: dict[str, float] = {}
    for name, errors in pairs.items():
        values[f"{name}: RMSE median pair"] = float(np.median(errors))
        values[f"{name}: RMSE worst pair"] = float(np.max(errors))
        values[f"{name}, least code < 200: RMSE"] = float(np.sqrt(np.concatenate(below[name]).mean()))
    values["refinish / bare: worst pair"] = float(
        np.max(np.array(pairs["refinish"]) / np.array(pairs["refinish, bare"]))
    )
    values["refinish / bare, least code < 200"] = (
        values["refinish, least code < 200: RMSE"] / values["refinish, bare, least code < 200: RMSE"]
    )
    values["refinish, least code < 200: codes moved by white"] = moved
    values["refinish to white: codes per code"] = steps
    values["refinish to white, bare: codes per code"] = bare_steps
    return values


def largest_step(chain: Callable[[Array], Array]) -> float:
    """The largest change of a channel, in codes, along tints that rise to white code by code."""
    light = np.arange(190.0, 275.0)[:, None]
    ramps = [np.rint(np.minimum(light * np.array(tint) / 254, 255)) / 255 for tint in TINTS]
    made = np.split(255 * np.clip(chain(np.concatenate(ramps)), 0.0, 1.0), len(ramps))
    return float(max(np.abs(np.diff(ramp, axis=0)).max() for ramp in made))


def written(camera: FleetCamera, profile: CameraProfile) -> dict[str, float]:
    """Files of the rendering in daylight and of a refinish, as their readers evaluate them, against the truth."""
    values: dict[str, float] = {}
    raw = unseen(camera, 3, "daylight")
    raw = raw[camera.known(raw, "standard", "daylight")]
    render, truth = profile.render("standard/daylight"), camera.render(raw, "standard", "daylight")
    for size in (17, 33):
        lut = lf.bake(render, form="full", size=size)
        shaped = lf.bake(render, form="shaper", size=size)
        for name, file in (("CLF", lut), ("shaper", shaped)):
            values |= quantiles(f"file {name} {size}³, render", delta_e_2000(np.clip(file(raw), 0, 1), truth))
    target = "vivid/daylight"
    expected = camera.render(raw, "vivid", "daylight")
    both = whole(truth) & whole(expected) & camera.known(raw, "vivid", "daylight")
    refinish = profile.refinish("standard/daylight", target)
    values |= quantiles("refinish of styles", delta_e_2000(np.clip(refinish(truth[both]), 0, 1), expected[both]))
    for size in (33, 65):
        plain = lf.bake(refinish, form="plain", size=size)
        difference = delta_e_2000(np.clip(plain(truth[both]), 0, 1), expected[both])
        values |= quantiles(f"file plain {size}³, refinish of styles", difference)
    return values


def properties(camera: FleetCamera, profile: CameraProfile) -> dict[str, float]:
    """Neutrals, rising light and round trips, in codes: the worst of all settings."""
    neutral, falls, trips, true_falls = 0.0, 0.0, 0.0, 0.0
    levels = np.linspace(0.0, 1.0, 256)[1:, None] ** 2
    rng = np.random.default_rng(5)
    for style, balance in settings(profile):
        name, factors = f"{style}/{balance}", camera.balances[balance]
        render = profile.render(name)
        grey = levels / factors * factors.min()
        off = render(grey) - camera.render(grey, style, balance)
        neutral = max(neutral, float(255 * np.ptp(off, axis=1).max()))
        colours = camera.unseen(rng, 30, balance)
        rays = (levels[:, None] * colours / colours.max(axis=1, keepdims=True)).reshape(-1, 3)
        falls = max(falls, _fall(render(rays), len(levels)))
        true_falls = max(true_falls, _fall(camera.render(rays, style, balance), len(levels)))
        jpeg = camera.render(camera.unseen(rng, 500, balance), style, balance)
        jpeg = jpeg[whole(jpeg)]
        trips = max(trips, float(255 * np.quantile(np.abs(render(profile.linearize(name)(jpeg)) - jpeg), 0.999)))
    return {
        "neutral light: codes off neutral": neutral,
        "more light: codes darker": falls,
        "more light: codes darker, truth": true_falls,
        "round trip: codes, 99.9 %": trips,
    }


def _fall(encoded: Array, levels: int) -> float:
    """The largest fall of a channel, in codes, along rays of rising light (levels · n, 3)."""
    return float(-255 * np.diff(np.clip(encoded, 0.0, 1.0).reshape(levels, -1, 3), axis=0).min())


def matched(camera: FleetCamera, other: FleetCamera, folder: Path) -> dict[str, float]:
    """One camera's JPEG in the look of the other on settings that both know: the same surfaces in the same light."""
    profiles = [lf.load_profile(folder / f"{each.half} {each.name}.npz") for each in (camera, other)]
    errors = []
    for balance in LIGHTS:
        if not all(balance in profile.white_balances for profile in profiles):
            continue
        setting = f"standard/{balance}"
        raw, theirs = (each.unseen(np.random.default_rng(4), PER_SETTING, balance) for each in (camera, other))
        x, expected = camera.render(raw, "standard", balance), other.render(theirs, "standard", balance)
        near = camera.known(raw, "standard", balance) & other.known(theirs, "standard", balance)
        both = whole(x) & whole(expected) & near
        made = match(profiles[0], setting, profiles[1], setting)(x[both])
        errors.append(delta_e_2000(np.clip(made, 0.0, 1.0), expected[both]))
    return quantiles("match with the next camera", np.concatenate(errors))


COLUMNS: Mapping[str, str] = {
    "render: ΔE00 mean": "render", "render: ΔE00 95 %": "95 %", "render: ΔE00 99.9 %": "99.9 %",
    "render: ΔE00 max": "max", "render, kriging: ΔE00 mean": "kriging", "render, bright: ΔE00 mean": "bright",
    "render, saturated: ΔE00 mean": "saturated", "file CLF 17³, render: ΔE00 mean": "CLF 17³",
    "file CLF 33³, render: ΔE00 mean": "CLF 33³", "file plain 33³, refinish of styles: ΔE00 mean": "plain 33³",
    "linearize: RMSE": "linearize", "linearize, kriging: RMSE": "kriging", "linearize: ΔE00 mean": "its ΔE00",
    "refinish: RMSE median pair": "refinish", "refinish: RMSE worst pair": "worst pair",
    "refinish, bare: RMSE worst pair": "bare", "refinish / bare, least code < 200": "/ bare < 200",
    "refinish to white: codes per code": "to white", "neutral light: codes off neutral": "neutral",
    "more light: codes darker": "darker", "round trip: codes, 99.9 %": "trip",
    "render: held-out error / true": "held-out / true", "linearize: held-out error / true": "linearize",
    "match with the next camera: ΔE00 mean": "match", "vignetting: off by, EV": "vignetting",
    "calibration: CPU seconds": "seconds",
}  # fmt: skip
"""Figures of the tables, and the heads of their columns."""
GUIDE: tuple[str, ...] = (
    "render: ΔE00 mean", "render: ΔE00 95 %", "render: ΔE00 99.9 %", "render, kriging: ΔE00 mean",
    "render, bright: ΔE00 mean", "render, saturated: ΔE00 mean", "file CLF 17³, render: ΔE00 mean",
    "file CLF 33³, render: ΔE00 mean", "file plain 33³, refinish of styles: ΔE00 mean",
    "file plain 65³, refinish of styles: ΔE00 mean", "linearize: RMSE", "linearize, kriging: RMSE",
    "linearize, bright: RMSE", "refinish: RMSE median pair", "refinish: RMSE worst pair",
    "refinish, bare: RMSE worst pair", "refinish / bare, least code < 200", "refinish to white: codes per code",
    "match with the next camera: ΔE00 mean", "neutral light: codes off neutral", "more light: codes darker",
    "round trip: codes, 99.9 %", "render: held-out error / true", "linearize: held-out error / true",
    "vignetting: off by, EV",
)  # fmt: skip
"""Rows of the guide's table, per half as median (worst) of the cameras."""

Measured = dict[str, float]
HALVES: tuple[Half, ...] = ("choose", "report")


def as_figures(
    camera: FleetCamera, results: Mapping[str, "Future[Measured]"], folder: Path, done: dict[str, Measured]
) -> Figures:
    """The figures of a camera when they are measured, with its match to the next one of its half."""
    values = results[camera.name].result()
    done[camera.name] = values
    for name, value in values.items():
        yield Figure(f"{camera.name}, {name}", value, compared=is_error(name))


def is_error(name: str) -> bool:
    """Whether a figure is an error of the estimator: no time, no ratio to a true error, no figure of another method."""
    return not name.endswith(("seconds", "true", "truth")) and "kriging" not in name


def table(half: Half, rows: Mapping[str, Measured]) -> None:
    """Print a half: the worst rendering first, then medians."""
    heading(f"{half}: {len(rows)} cameras", *COLUMNS.values())
    first = next(iter(COLUMNS))
    for name, values in sorted(rows.items(), key=lambda entry: -entry[1].get(first, 0.0)):
        print_row(name, values)
    medians = {name: float(np.median([v[name] for v in rows.values() if name in v] or [np.nan])) for name in COLUMNS}
    print_row("median", medians)


def print_row(name: str, values: Measured) -> None:
    """Print a row of a table with three significant digits."""
    row(name, *(f"{values[column]:.3g}" if np.isfinite(values.get(column, np.nan)) else "–" for column in COLUMNS))


def guide_tables(files: Sequence[Path], cameras: Sequence[FleetCamera]) -> None:
    """Print the tables of the guide: of each half the median (worst) camera, a column for each file."""
    runs = [of_halves(json.loads(file.read_text(encoding="utf-8")), cameras) for file in files]
    heading("", *(f"{half}, {file.stem}" for half in HALVES for file in files))
    for name in GUIDE:
        row(name, *(_cell(run, half, name) for half in HALVES for run in runs))


def _cell(run: Measured, half: Half, name: str) -> str:
    median, worst = (run.get(f"fleet, {half}, {name}: {which}", np.nan) for which in ("median", "worst"))
    return f"{median:.3g} ({worst:.3g})" if np.isfinite(median) else "–"


def of_halves(run: Measured, cameras: Sequence[FleetCamera]) -> Measured:
    """The rows of the guide's table: of each half the median camera and the worst, from the figures of a run."""
    rows = {}
    for half, name in product(HALVES, GUIDE):
        values = [run.get(f"{each.name}, {name}", np.nan) for each in cameras if each.half == half]
        known = np.array([value for value in values if np.isfinite(value)])
        if not len(known):
            continue
        farthest = np.argmax(np.abs(np.log(np.maximum(known, 1e-9))))
        rows[f"fleet, {half}, {name}: median"] = float(np.median(known))
        rows[f"fleet, {half}, {name}: worst"] = float(known[farthest] if name.endswith("true") else known.max())
    return rows


def main() -> int:
    """Measure the cameras on both cores, and print their figures and tables."""
    parser = common.parser(__doc__)
    parser.add_argument("--half", choices=("choose", "report"), help="the cameras of one half")
    parser.add_argument("--tables", nargs="+", type=Path, default=[], metavar="FILE", help="print the guide's tables")
    arguments = parser.parse_args()
    data = common.real_data()
    if data is None:
        return 0
    cameras = fleet(data)
    if arguments.tables:
        guide_tables(arguments.tables, cameras)
        return 0
    taken = [
        each for each in cameras if arguments.half in (None, each.half) and common.chosen(each.name, arguments.only)
    ]
    os.environ |= dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), "1")  # of the processes to come
    done: dict[str, Measured] = {}
    with tempfile.TemporaryDirectory() as work, ProcessPoolExecutor(WORKERS, get_context("spawn")) as pool:
        folder = Path(work)
        results = {each.name: pool.submit(measure, each, folder) for each in taken}

        def match_figures(camera: FleetCamera, other: FleetCamera) -> Figures:
            for name, value in matched(camera, other, folder).items():
                done[camera.name][name] = value
                yield Figure(f"{camera.name}, {name}", value)

        def parts(_: Path) -> common.Parts:
            made = {each.name: partial(as_figures, each, results, folder, done) for each in taken}
            for half in ("choose", "report"):
                own = [each for each in taken if each.half == half]
                for camera, other in zip(own, [*own[1:], *own[:1]], strict=True):
                    if camera is not other:
                        made[f"{camera.name} to {other.name}"] = partial(match_figures, camera, other)
            return made

        status = common.measured(parts, arguments)
    if arguments.json:
        run = json.loads(arguments.json.read_text(encoding="utf-8"))
        text = json.dumps(run | of_halves(run, cameras), indent=1, ensure_ascii=False)
        arguments.json.write_text(text + "\n", encoding="utf-8")
    for half in ("choose", "report"):
        rows = {each.name: done[each.name] for each in taken if each.half == half and each.name in done}
        if rows:
            table(half, rows)
    return status


if __name__ == "__main__":
    sys.exit(main())
