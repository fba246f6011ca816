"""What is measured of a camera of the fleet: every job of its profile against the truth.

ΔE00 of a linearization is that of its light as linear sRGB through the camera's true matrix; RMSE is of balanced RAW.
"bare" is the refinish without its care for white.
"""

import time
from collections.abc import Callable
from itertools import permutations
from pathlib import Path

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses
from numpy.typing import NDArray

import lutforge as lf
from lutforge.arrays import Array, Mask
from lutforge.colour.srgb import delta_e_2000, srgb_encode
from lutforge.evaluation.expected_difference import expected_difference
from lutforge.evaluation.next_shots import known_colours
from lutforge.kits.icc import fit_icc_profile
from lutforge.kits.kit import look_of
from lutforge.model.camera_profile import CameraProfile, match
from lutforge.model.profile import DIRECTIONS
from lutforge.solvers.gauss_newton import gauss_newton
from tests.benchmarks.common import HALF_CODE
from tests.benchmarks.fleet_cameras import LIGHTS, STYLES, FleetCamera
from tests.benchmarks.fleet_lens import distortion_error
from tests.benchmarks.plain_kriging import kriging

PER_SETTING = 1000
"""Colours that each setting is asked for; as many for each pair of settings."""
BRIGHT, SATURATED = 230 / 255, 0.6
"""A bright colour has a code above this; of a saturated one the least code is less than 1 − this of the largest."""
BELOW_WHITE = 200 / 255
"""Colours whose least code is below this are none of white's."""
TINTS = ((254, 254, 254), (254, 250, 245), (245, 250, 254), (250, 254, 250), (254, 248, 254), (254, 234, 214))


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
    values |= stated_errors(camera, profile)
    values |= known_and_asked_for(camera, profile, samples)
    values |= refinished(camera, profile)
    values |= written(camera, profile)
    values |= in_programs(camera, profile)
    values |= properties(camera, profile)
    values |= distortion_error(camera, folder)
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
    balances, others = settings(profile), {}
    for style in STYLES:
        rows = (samples.style == style) & whole(samples.srgb) & np.all(samples.raw < 0.999, axis=1)
        gains = np.array([profile.multipliers(f"{style}/{balance}") for balance in samples.white_balance[rows]])
        others[style] = kriging(samples.raw[rows] * gains, samples.srgb[rows])
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
    return values


def known_and_asked_for(camera: FleetCamera, profile: CameraProfile, samples: lf.SampleSet) -> dict[str, float]:
    """The errors of rendered colours that count as known, and of those that are asked for in the next shots."""
    errors, asked_for = [], []
    for style in STYLES:
        model = profile.styles[style].models[0]
        expects = expected_difference(model)
        of_style = samples.select((samples.style == style) & whole(samples.srgb))
        known = known_colours(profile, style, of_style.srgb)
        for _, balance in (setting for setting in settings(profile) if setting[0] == style):
            name = f"{style}/{balance}"
            raw = unseen(camera, 1, balance)
            raw = raw[camera.known(raw, style, balance)]
            made = np.clip(profile.render(name)(raw), 0.0, 1.0)
            errors.append(delta_e_2000(made, camera.render(raw, style, balance)))
            linear = np.minimum(raw * profile.multipliers(name), 1.0) @ model.matrix.T
            asked_for.append(known.asks_for(expects(linear)) if expects is not None else np.zeros(len(raw), dtype=bool))
    error, asked = np.concatenate(errors), np.concatenate(asked_for)
    values = {"next shots, known: ΔE00 mean": float(error[~asked].mean())}
    if asked.any():
        values["next shots, asked for: ΔE00 mean"] = float(error[asked].mean())
        values["next shots: known error / asked-for error"] = float(error[~asked].mean() / error[asked].mean())
    return values


def stated_errors(camera: FleetCamera, profile: CameraProfile) -> dict[str, float]:
    """What the profile states of its own errors, over the true ones on colours that no fit saw.

    Held-out errors are also compared with those on unseen samples, whose codes are off by themselves.
    """
    rng = np.random.default_rng([6, camera.seed])
    ratios: dict[str, list[float]] = {}
    expected, true = list[Array](), list[Array]()
    for style in STYLES:
        model = profile.styles[style].models[0]
        expects = expected_difference(model)
        distances: dict[str, list[Array]] = {}
        for _, balance in (setting for setting in settings(profile) if setting[0] == style):
            name, factors = f"{style}/{balance}", camera.balances[balance]
            raw = unseen(camera, 1, balance)
            truth = camera.render(raw, style, balance)
            inside = camera.known(raw, style, balance) & whole(truth) & np.all(raw * factors < 1.0, axis=1)
            raw, truth = raw[inside], truth[inside]
            for of, (x, y) in (("true", (raw, truth)), ("samples", camera.sampled(rng, raw, style, balance))):
                made = np.clip(profile.render(name)(x), 0.0, 1.0) - y
                found = (profile.linearize(name)(y) - x) * factors
                distances.setdefault(f"render, {of}", []).append(np.linalg.norm(made, axis=1))
                distances.setdefault(f"linearize, {of}", []).append(np.linalg.norm(found, axis=1))

            if expects is not None:
                expected.append(expects(raw * factors @ model.matrix.T))
                true.append(delta_e_2000(np.clip(profile.render(name)(raw), 0.0, 1.0), truth))

        for direction in DIRECTIONS:
            stated = profile.styles[style].errors.get(f"{direction}_mean")
            if stated is None:
                continue
            for of, words in (("true", "true"), ("samples", "that of unseen samples")):
                ratio = float(stated / np.concatenate(distances[f"{direction}, {of}"]).mean())
                ratios.setdefault(f"{direction}: held-out error / {words}", []).append(ratio)

    values = {name: float(np.mean(of_styles)) for name, of_styles in ratios.items()}
    if expected:
        values |= by_quarter(np.concatenate(expected), np.concatenate(true))
    return values


def by_quarter(expected: Array, true: Array) -> dict[str, float]:
    """The mean expected ΔE00 of a rendering over the true one, where the expected is least and where it is most.

    Both are (n,).
    """
    low, high = np.quantile(expected, (0.25, 0.75))
    parts = {"surest quarter": expected <= low, "least sure quarter": expected >= high}
    return {
        f"render: expected error / true, {name}": float(expected[rows].mean() / true[rows].mean())
        for name, rows in parts.items()
    }


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
    moved, steps, bare_steps, true_steps = 0.0, 0.0, 0.0, 0.0
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
        true_steps = max(true_steps, largest_step(true_refinish(camera, source, target, profile.linearize(ends[0]))))
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
    values["refinish to white, truth: codes per code"] = true_steps
    return values


def tints_to_white() -> list[Array]:
    """Encoded colours (85, 3) of some tints, which rise to white code by code."""
    light = np.arange(190.0, 275.0)[:, None]
    return [np.rint(np.minimum(light * np.array(tint) / 254, 255)) / 255 for tint in TINTS]


def largest_step(chain: Callable[[Array], Array]) -> float:
    """The largest change of a channel, in codes, along tints that rise to white; NaN where no two codes are known."""
    ramps = tints_to_white()
    made = np.split(255 * np.clip(chain(np.concatenate(ramps)), 0.0, 1.0), len(ramps))
    steps = np.concatenate([np.abs(np.diff(ramp, axis=0)).ravel() for ramp in made])
    return float(np.nanmax(steps, initial=0.0))


def true_refinish(
    camera: FleetCamera, source: tuple[str, str], target: tuple[str, str], start: Callable[[Array], Array]
) -> Callable[[Array], Array]:
    """What the camera itself makes of the light that it renders to a code; NaN where it makes no such code.

    start: a linearization, from which the light is searched for. Clipped codes have many lights: NaN as well.
    """
    factors = camera.balances[source[1]]

    def chain(codes: Array) -> Array:
        root = np.sqrt(np.clip(start(codes) * factors, 1e-6, 1.0))  # of balanced RAW: near to perceptually uniform

        def shown(at: Array) -> Array:
            return camera.render(np.clip(at**2, 0.0, 1.0) / factors, *source)

        def residuals(at: Array, which: NDArray[np.intp]) -> tuple[Array, Array]:
            made, step = shown(at), 1e-4
            slopes = np.stack([(shown(at + step * axis) - made) / step for axis in np.eye(3)], axis=2)
            return made - codes[which], slopes

        found = gauss_newton(residuals, root, lower=0.0, upper=1.0, tolerance=1e-9)
        raw = found.value**2 / factors
        known = whole(codes) & (np.abs(camera.render(raw, *source) - codes).max(axis=1) < HALF_CODE)
        return np.where(known[:, None], camera.render(raw, *target), np.nan)

    return chain


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


def in_programs(camera: FleetCamera, profile: CameraProfile) -> dict[str, float]:
    """The view and the look of a config, as OpenColorIO evaluates them, and the kits' ICC, against the truth."""
    raw = unseen(camera, 3, "daylight")
    raw = raw[camera.known(raw, "standard", "daylight") & camera.known(raw, "vivid", "daylight")]
    truth, expected = (camera.render(raw, style, "daylight") for style in STYLES)
    config = lf.build_config([profile])
    name = profile.camera
    view = OCIO.DisplayViewTransform(src=f"{name} RAW unbalanced", display="sRGB - Display", view=f"{name} standard")
    space = f"{name} JPEG standard daylight"
    look = OCIO.LookTransform(src=space, dst=space, looks=f"{name} JPEG standard daylight → vivid daylight")

    def through(transform: OCIO.Transform, x: Array) -> Array:
        processor = config.getProcessor(transform, OCIO.TRANSFORM_DIR_FORWARD).getDefaultCPUProcessor()
        pixels = np.ascontiguousarray(x, dtype=np.float32)
        processor.applyRGB(pixels)
        return np.clip(pixels.astype(np.float64), 0.0, 1.0)

    values = quantiles("config's view", delta_e_2000(through(view, raw), truth))
    both = whole(truth) & whole(expected)
    values |= quantiles("config's look of styles", delta_e_2000(through(look, truth[both]), expected[both]))

    icc = fit_icc_profile(look_of(profile, "standard"))
    balanced = np.minimum(raw * profile.multipliers("standard/daylight"), 1.0)
    return values | quantiles("ICC, render", delta_e_2000(np.clip(icc(balanced), 0.0, 1.0), truth))


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
