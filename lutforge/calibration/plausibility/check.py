"""All checks of plausibility in order: what spoils the whole set comes before what concerns some of its shots."""

import numpy as np

from lutforge.arrays import Array
from lutforge.calibration.lattice.monochrome import is_monochrome
from lutforge.calibration.plausibility.renderings import mixed_shots
from lutforge.calibration.plausibility.setting_names import exchanged_names
from lutforge.calibration.plausibility.shifted_rows import shifted_rows
from lutforge.calibration.plausibility.toning import toned
from lutforge.calibration.plausibility.whole_set import Colours, fitted_chain, whole_set_cause
from lutforge.errors import CalibrationError
from lutforge.model.diagnosis import Diagnosis
from lutforge.samples.sample_set import SampleSet


def implausible(samples: SampleSet, multipliers: Array) -> tuple[Diagnosis, ...]:
    """What no camera makes in samples of one camera, by likely cause; empty for good ones.

    multipliers: (n, 3) of every sample, estimated where the files tell none. One cause is told per style: others may be
    what it brings about.
    """
    found: dict[str, Diagnosis] = {}
    for style in np.unique(samples.style):
        rows = samples.style == style
        cause = _of_style(samples.select(rows), multipliers[rows])
        if cause is not None:
            found.setdefault(cause.cause, cause)
    if found:
        return tuple(found.values())
    balances = {str(name): multipliers[samples.white_balance == name] for name in np.unique(samples.white_balance)}
    # Multipliers that vary are automatic, or of two sensors.
    steady = {
        name: np.median(rows, axis=0) for name, rows in balances.items() if np.ptp(np.log(rows), axis=0).max() < 0.1
    }
    names = exchanged_names(steady)
    return () if names is None else (names,)


def _of_style(samples: SampleSet, multipliers: Array) -> Diagnosis | None:
    known = bool(np.all(np.isfinite(samples.wb)))
    colours = Colours(samples.raw, samples.srgb, multipliers, samples.white_balance, known)
    rows = colours.usable()
    balanced = samples.raw * multipliers
    if rows.any() and is_monochrome(balanced[rows], samples.srgb[rows]):
        return None
    try:
        chain = fitted_chain(colours)
    except CalibrationError:
        return None
    return (
        toned(balanced[rows], samples.srgb[rows])
        or shifted_rows(chain, samples.raw, multipliers, samples.srgb, samples.shot)
        or (whole_set_cause(colours) if np.all(samples.raw_space == "") else None)  # what programs make may be anything
        or mixed_shots(
            chain, balanced[rows], samples.srgb[rows], multipliers[rows], samples.shot[rows],
            samples.white_balance[rows],
        )
    )  # fmt: skip
