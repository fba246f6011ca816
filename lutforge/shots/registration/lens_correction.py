"""The lens corrections of a camera in its JPEG: distortion, and lateral chromatic aberration, where significant."""

from dataclasses import dataclass, replace

from lutforge.shots.geometry import Registration, Unknowns
from lutforge.shots.registration.colour_prediction import channel_roots
from lutforge.shots.registration.reduced_copies import RawLevel, ReducedJpeg
from lutforge.shots.registration.refinement import Fit, fit_channel, fit_on, refined

SIGNIFICANT = 30.0
"""Evidence for a distortion from which on it is believed: the 17 pictures of six cameras without one show up to 18."""
NON_RIGID = 0.18
"""Pixels of the coarsest copy by which parts of a non-rigidly distorted picture deviate from their place, in the mean:
0.28 or more with a keystone of 2 % of the width, 0.12 at most in pictures without one, 0.05 in photographs."""


def with_lens_correction(
    finest_raw: RawLevel, jpeg: ReducedJpeg, coarse: Fit, registration: Registration
) -> Registration:
    """Add to a refined registration the lens corrections that are significant, and the residual that no lens explains.

    coarse: its fit on the coarsest copy, which shows whether there is a distortion.
    """
    distorted = coarse.evidence(Unknowns.DISTORTION) > SIGNIFICANT
    if distorted:
        fit = refined(finest_raw, jpeg, coarse.registration, Unknowns.DISTORTION)
        distorted = fit.evidence(Unknowns.DISTORTION) > SIGNIFICANT
        registration = fit.registration if distorted else registration

    colours = _fit_channels(finest_raw, jpeg.coarsest, registration)
    chromatic = colours.evidence > SIGNIFICANT
    if chromatic:
        for _ in range(2):  # the second on what the first removed
            registration = _fit_channels(finest_raw, jpeg.halved(max(jpeg.halvings - 1, 0)), registration).registration

    # Once more on the finest copy, with the distortion's centre if that is significant.
    residual = colours.residual
    if distorted or chromatic:
        all_unknowns = (Unknowns.DISTORTION, Unknowns.CENTRE) if distorted else (Unknowns.PLACE,)
        fits = [fit_on(jpeg, finest_raw, registration, unknowns) for unknowns in all_unknowns]
        decentred = distorted and fits[-1].evidence(Unknowns.CENTRE) > SIGNIFICANT
        registration = fits[-1 if decentred else 0].registration
        residual = _fit_channels(finest_raw, jpeg.coarsest, registration).residual
    return replace(registration, non_rigid=residual * jpeg.coarsest.factor if residual > NON_RIGID else 0.0)


@dataclass(frozen=True, eq=False)
class _ChannelFit:
    """A registration with red and blue magnified as fitted.

    evidence: of the magnification; residual: of green, in pixels.
    """

    registration: Registration
    evidence: float
    residual: float


def _fit_channels(finest_raw: RawLevel, level: ReducedJpeg, registration: Registration) -> _ChannelFit:
    """Fit the magnification of red and blue over green, which the JPEG shows of one size, on one copy of it.

    Each of the RAW's channels is registered by itself, on its prediction from the JPEG's colours.
    """
    scaled = registration.reduced(level.factor)
    raw, local = finest_raw.for_scale(scaled.scale).straightened(scaled, level)
    fits = [fit_channel(raw, level, local, channel) for channel in channel_roots(raw, level, local)]
    red, green, blue = (fit.registration.scale for fit in fits)

    # Equal pictures leave no residual, so the estimated error is 0; a scale is known to a millionth at best.
    errors = [1e-12 + fit.covariance[0, 0] + fits[1].covariance[0, 0] for fit in fits]
    evidence = (red - green) ** 2 / errors[0] + (blue - green) ** 2 / errors[2]

    lens = registration.distortion or raw.no_distortion
    lens = replace(lens, red=lens.red + red / green - 1, blue=lens.blue + blue / green - 1)
    return _ChannelFit(replace(registration, distortion=lens), evidence, fits[1].residual)
