"""Good sets of samples of several cameras, what spoils them, and the words of the cause that is to be named."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from lutforge.arrays import Array
from lutforge.calibration.calibration_state import CalibrationState
from lutforge.calibration.matrix_and_response import fit_matrix_and_response
from lutforge.calibration.steps import complete_white_balances, diagnose, drop_outlier_shots, note_dark_end
from lutforge.colour.srgb import srgb_decode
from lutforge.samples.sample_set import SampleSet, concatenate
from lutforge.samples.table import read_samples
from lutforge.simulate.camera import SimulatedCamera, nikon_d5100, sigma_sd_merrill
from tests.cases.real_data import S40, read_published_pairs
from tests.cases.samples import photograph_patches, surfaces

Case = Callable[[SampleSet, np.random.Generator], SampleSet]


def d40(seed: int) -> SampleSet:
    """The published pairs, dealt to ten shots."""
    pairs, rng = read_published_pairs(), np.random.default_rng(seed)
    count = len(pairs.balanced)
    setting, shot = np.arange(count) % len(pairs.multipliers), rng.integers(0, 10, count)
    wb = np.array(list(pairs.multipliers.values()))[setting]
    samples = SampleSet.from_arrays(
        pairs.balanced / wb, pairs.encoded, camera="Nikon D40",
        white_balance=np.array(list(pairs.multipliers))[setting], shot=np.char.add("S", shot.astype(str)),
        patch=np.arange(count).astype(str), exposure_s=0.01, wb=wb,
    )  # fmt: skip
    return samples.select(np.argsort(shot, kind="stable"))


def s40(seed: int) -> SampleSet:
    """Five photographs, without a tenth of their samples."""
    samples = read_samples(S40)
    return samples.select(np.random.default_rng(seed).random(len(samples)) > 0.1)


def simulated(camera: SimulatedCamera, seed: int, style: str = "standard", shots: int = 10) -> SampleSet:
    """Shots of surfaces of their own, under lights and at exposures drawn at random."""
    rng, parts = np.random.default_rng(seed), []
    balances = list(camera.white_balances)
    for shot in range(shots):
        light, stop = balances[rng.integers(len(balances))], (-4.0, -3.0, -2.0, -1.0, 0.0, 0.5)[rng.integers(6)]
        taken = photograph_patches(
            camera, surfaces(80, 100 * seed + shot), styles=(style,), balances=(light,), stops=(stop,),
            seed=1000 * seed + shot,
        )  # fmt: skip
        parts.append(replace(taken, shot=np.char.add(f"{style}{shot} ", taken.shot)))
    return concatenate(parts)


def _srgb(change: Callable[[Array], Array]) -> Case:
    return lambda samples, rng: replace(samples, srgb=np.clip(change(samples.srgb), 0.0, 1.0))


def _raw(change: Callable[[Array, Array], Array]) -> Case:
    return lambda samples, rng: replace(samples, raw=np.clip(change(samples.raw, samples.wb), -0.05, 1.0))


def brightened(samples: SampleSet, factor: Array) -> Array:
    """JPEG values (n, 3) developed brighter by factors, (n,) or of each channel (n, 3).

    By the simulated camera, else by the curve that the samples tell.
    """
    factor = factor.reshape(len(samples), -1)
    for camera in (nikon_d5100(), sigma_sd_merrill()):
        if camera.name == samples.camera[0]:
            return camera.render(samples.raw * samples.wb * factor, "standard", np.ones(3))
    response = fit_matrix_and_response(samples.raw * samples.wb, samples.srgb).response
    return response.encode(response.linearize(samples.srgb) * factor)


def _one_brightened(samples: SampleSet, rng: np.random.Generator) -> SampleSet:
    one = samples.shot == rng.choice(np.unique(samples.shot))
    brighter = brightened(samples, np.full(len(samples), 2**0.5))
    return replace(samples, srgb=np.where(one[:, None], brighter, samples.srgb))


def livelier(encoded: Array) -> Array:
    """Another style: more saturation and contrast."""
    grey = (encoded @ [0.25, 0.5, 0.25])[:, None]
    lively = np.clip(grey + 1.25 * (encoded - grey), 0.0, 1.0)
    return np.asarray(lively + 0.12 * lively * (1 - lively) * (2 * lively - 1))


def _other_style(share: float) -> Case:
    def change(samples: SampleSet, rng: np.random.Generator) -> SampleSet:
        names = rng.permutation(np.unique(samples.shot))
        rows = np.isin(samples.shot, names[: max(1, round(share * len(names)))])
        return replace(samples, srgb=np.where(rows[:, None], livelier(samples.srgb), samples.srgb))

    return change


def _other_sensor(samples: SampleSet, rng: np.random.Generator) -> SampleSet:
    """Four shots of another sensor, or on real cameras of this one with a matrix before it."""
    names = rng.permutation(np.unique(samples.shot))
    rows = np.isin(samples.shot, names[: max(1, round(0.3 * len(names)))])
    mixing = np.array([[0.82, 0.18, 0.0], [0.06, 0.88, 0.06], [0.0, 0.18, 0.82]])
    raw, wb = samples.raw.copy(), samples.wb.copy()
    raw[rows] = samples.raw[rows] @ mixing.T
    neutral = (1.0 / samples.wb[rows]) @ mixing.T
    wb[rows] = neutral[:, 1:2] / neutral
    return replace(samples, raw=raw, wb=wb)


def _slipped(samples: SampleSet, rng: np.random.Generator) -> SampleSet:
    srgb, rows = samples.srgb.copy(), np.flatnonzero(samples.shot == rng.choice(np.unique(samples.shot)))
    srgb[rows] = np.roll(srgb[rows], int(rng.integers(1, 4)), axis=0)
    return replace(samples, srgb=srgb)


BLACK = 600.0 / 15520.0
CASES: dict[str, tuple[str, Case]] = {
    "red and blue of the JPEG swapped": ("blue of the JPEG", _srgb(lambda srgb: srgb[:, ::-1])),
    "JPEG values linear": ("linear", _srgb(srgb_decode)),
    "RAW scaled by 1/4": ("white level", _raw(lambda raw, wb: raw / 4)),
    "green counted twice": ("counted twice", _raw(lambda raw, wb: raw * [1, 2, 1])),
    "one in ten shots of another style": ("saturation", _other_style(0.1)),
    "a third of the shots of another sensor": ("saturation", _other_sensor),
    "sepia": ("toned", _srgb(lambda srgb: (srgb @ [0.3, 0.59, 0.11])[:, None] * [1.07, 0.95, 0.75])),
    "rows shifted within a shot": ("rows", _slipped),
    "RAW white-balanced already": ("already", _raw(lambda raw, wb: raw * wb)),
    "black level left in": ("left in", _raw(lambda raw, wb: raw * (1 - BLACK) + BLACK)),
    "black level taken twice": ("more than the black", _raw(lambda raw, wb: (raw - BLACK) / (1 - BLACK))),
    "black level 700 for 600": ("black level", _raw(lambda raw, wb: raw - 100.0 / 14920.0)),
    "one JPEG brightened by 0.5 EV": ("exposure", _one_brightened),
}  # fmt: skip
"""What is done to good samples, and words of the cause that is to be named."""


def diagnosed(samples: SampleSet) -> tuple[str, ...]:
    """The diagnoses of samples, and the notes on their shots and their dark end."""
    state = complete_white_balances(CalibrationState(samples, samples.wb))
    estimated = len(state.notes)
    for step in (diagnose, drop_outlier_shots, note_dark_end):
        state = step(state)
    return (*map(str, state.diagnoses), *state.notes[estimated:])
