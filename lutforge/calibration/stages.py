"""Response, matrix and white balances: what stands before gamut map and lattice; fitted, or taken from a profile."""

from dataclasses import dataclass

import numpy as np

from lutforge.arrays import Array, Mask
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.physical.matrix_and_response import MatrixAndResponse
from lutforge.calibration.physical.physical_model import CameraStages, GamutMaps, fit_gamut_maps, fit_stages
from lutforge.calibration.style_data import style_data, unclipped
from lutforge.errors import CalibrationError
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.gamut_map import identity_gamut_map
from lutforge.model.profile_data import PhysicalModel, PictureStyle
from lutforge.samples.sample_set import SampleSet


@dataclass(frozen=True, eq=False)
class Stages(CameraStages):
    """The stages of one camera, for all its samples. usable: (n,) those that a gamut map can be fitted to."""

    usable: Mask

    def maps(self, samples: SampleSet, options: CalibrationOptions) -> dict[str, GamutMaps]:
        """Fit h and h⁻¹ of each style that has samples. Raises CalibrationError."""
        balances = tuple(str(name) for name in np.unique(samples.white_balance))
        nugget, maps = options.physical.nugget, {}
        for name, response in self.responses.items():
            rows = self.usable & (samples.style == name)
            if rows.any():
                maps[name] = fit_gamut_maps(
                    samples.raw[rows] * self.multipliers[rows], samples.srgb[rows], samples.shot[rows], self.matrix,
                    response, balances, (nugget, nugget), options.preset, options.physical.centres,
                )  # fmt: skip
        return maps

    def styles(self, white_balances: tuple[str, ...]) -> dict[str, PictureStyle]:
        """The styles as a profile has them, with gamut maps that change nothing."""
        none = identity_gamut_map()
        return {
            name: PictureStyle(physical=(PhysicalModel(white_balances, self.matrix, response, none, none),))
            for name, response in self.responses.items()
        }


def fit_camera_stages(samples: SampleSet, multipliers: Array, options: CalibrationOptions) -> Stages:
    """Fit f of every style, Ts and the unknown Tw of samples of one camera; black-and-white styles are left out.

    multipliers: (n, 3), guesses where the samples tell none. Raises CalibrationError.
    """
    without = [name for name, style in style_data(samples, multipliers)[0].items() if style.monochrome]
    usable = unclipped(samples, multipliers) & ~np.isin(samples.style, without)
    if not usable.any():
        raise CalibrationError(
            f'style "{without[0]}" is black and white: its JPEGs hold no colour to fit the physical model to: '
            'use the "lattice" model, or add shots in another style'
        )
    inside, known = samples.select(usable), np.all(np.isfinite(samples.wb), axis=1)
    stages = fit_stages(inside, multipliers[usable], known[usable], options.preset, options.physical)
    completed = multipliers.copy()
    completed[usable] = stages.multipliers
    automatic = np.where(samples.white_balance == "auto", np.char.add("auto\x00", samples.shot), samples.white_balance)
    for setting in np.unique(automatic[~known]):
        fitted = ~known & (automatic == setting) & usable
        if fitted.any():
            completed[~known & (automatic == setting)] = completed[fitted][0]
    return Stages(stages.matrix, completed, stages.responses, usable)


def stages_of(profile: CameraProfile, samples: SampleSet, multipliers: Array) -> Stages:
    """Take the stages of a profile for samples with multipliers Tw (n, 3). Raises CalibrationError: it has none."""
    models = {name: style.physical[0] for name, style in profile.styles.items() if style.physical}
    responses = {name: model.response for name, model in models.items()}
    usable = unclipped(samples, multipliers) & np.isin(samples.style, list(responses))
    if not usable.any():
        raise CalibrationError(
            f"the given response and matrix are of the styles {', '.join(responses) or 'none'}; the samples are of "
            f"{', '.join(np.unique(samples.style))}"
        )
    return Stages(next(iter(models.values())).matrix, multipliers, responses, usable)


def base_of(profile: CameraProfile, style: str) -> MatrixAndResponse | None:
    """Return the matrix and response of a style as what a lattice follows; None where the profile has none."""
    physical = profile.styles[style].physical if style in profile.styles else ()
    if not physical:
        return None
    return MatrixAndResponse(physical[0].matrix, physical[0].response)
