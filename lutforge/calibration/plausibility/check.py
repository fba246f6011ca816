"""All checks of plausibility in order: those of the whole set come before those of single shots."""

import numpy as np

from lutforge.arrays import Array
from lutforge.calibration.lattice.monochrome import is_monochrome
from lutforge.calibration.plausibility.renderings import mixed_shots
from lutforge.calibration.plausibility.setting_names import wrong_names
from lutforge.calibration.plausibility.shifted_rows import shifted_rows
from lutforge.calibration.plausibility.toning import toned
from lutforge.calibration.plausibility.whole_set import Colours, fitted_chain, whole_set_cause
from lutforge.errors import CalibrationError
from lutforge.model.diagnosis import Diagnosis
from lutforge.samples.sample_set import SampleSet


def implausible(samples: SampleSet, multipliers: Array) -> tuple[Diagnosis, ...]:
    """Diagnose the samples of one camera; return an empty tuple where a camera can have made them.

    multipliers: (n, 3), the white balance of every sample, estimated where the files do not state it. At most one cause
    is named per style, because further ones may be consequences of the first.
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
    # Multipliers that vary under one name are automatic, or come from two sensors.
    steady = {
        name: np.median(rows, axis=0) for name, rows in balances.items() if np.ptp(np.log(rows), axis=0).max() < 0.1
    }
    names = wrong_names(steady)
    return () if names is None else (names,)


def _of_style(samples: SampleSet, multipliers: Array) -> Diagnosis | None:
    """Diagnose the samples of one style; None where they are plausible, black and white, or too few."""
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
        or (whole_set_cause(colours) if np.all(samples.raw_space == "") else None)  # programs may render anything
        or mixed_shots(
            chain, balanced[rows], samples.srgb[rows], multipliers[rows], samples.shot[rows],
            samples.white_balance[rows],
        )
    )  # fmt: skip
