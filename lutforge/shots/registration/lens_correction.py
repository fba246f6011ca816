"""What a camera corrected of its lens in the JPEG: distortion, and lateral chromatic aberration, where significant."""

from dataclasses import dataclass, replace

from lutforge.shots.geometry import Registration
from lutforge.shots.registration.colour_prediction import channel_roots
from lutforge.shots.registration.reduced_copies import RawLevel, ReducedJpeg
from lutforge.shots.registration.refinement import Fit, fit_channel, fit_on, refined

SIGNIFICANT = 30.0
"""Evidence for a distortion from which on it is believed: the 17 pictures of six cameras without one show up to 18."""
NON_RIGID = 0.18
"""Pixels of the coarsest copy by which parts of a non-rigidly distorted picture deviate from their place, in the mean:
0.28 or more with a keystone of 2 % of the width, 0.12 at most in pictures without one, 0.05 in photographs."""


def with_lens_correction(pyramid: RawLevel, jpeg: ReducedJpeg, coarse: Fit, place: Registration) -> Registration:
    """Add the lens corrections of the camera that are significant to a refined place, and what no lens explains.

    coarse: the fit of the place on the coarsest copy, which shows whether there is a distortion.
    """
    distorted = coarse.evidence(3) > SIGNIFICANT
    if distorted:
        fit = refined(pyramid, jpeg, coarse.place, 5)
        distorted = fit.evidence(3) > SIGNIFICANT
        place = fit.place if distorted else place

    colours = _fit_channels(pyramid, jpeg.coarsest, place)
    chromatic = colours.evidence > SIGNIFICANT
    if chromatic:
        for _ in range(2):  # the second on what the first removed
            place = _fit_channels(pyramid, jpeg.halved(max(jpeg.halvings - 1, 0)), place).place

    # Once more on the finest copy, with the distortion's centre if that is significant.
    residual = colours.residual
    if distorted or chromatic:
        fits = [fit_on(jpeg, pyramid, place, count) for count in ((5, 7) if distorted else (3,))]
        decentred = distorted and fits[-1].evidence(5) > SIGNIFICANT
        place = fits[-1 if decentred else 0].place
        residual = _fit_channels(pyramid, jpeg.coarsest, place).residual
    return replace(place, non_rigid=residual * jpeg.coarsest.factor if residual > NON_RIGID else 0.0)


@dataclass(frozen=True, eq=False)
class _ChannelFit:
    """A place with red and blue magnified as fitted, the evidence of that, and the residual of green, in pixels."""

    place: Registration
    evidence: float
    residual: float


def _fit_channels(pyramid: RawLevel, level: ReducedJpeg, place: Registration) -> _ChannelFit:
    """Fit the magnification of red and blue over green, which the JPEG shows of one size, on one copy of it.

    Each of the RAW's channels is registered by itself, on its prediction from the JPEG's colours.
    """
    scaled = place.reduced(level.factor)
    raw, local = pyramid.for_scale(scaled.scale).straightened(scaled, level)
    fits = [fit_channel(raw, level, local, channel) for channel in channel_roots(raw, level, local)]
    red, green, blue = (fit.place.scale for fit in fits)

    # Equal pictures leave no residual, so the estimated error is 0; a scale is known to a millionth at best.
    errors = [1e-12 + fit.covariance[0, 0] + fits[1].covariance[0, 0] for fit in fits]
    evidence = (red - green) ** 2 / errors[0] + (blue - green) ** 2 / errors[2]

    lens = place.distortion or raw.no_distortion
    lens = replace(lens, red=lens.red + red / green - 1, blue=lens.blue + blue / green - 1)
    return _ChannelFit(replace(place, distortion=lens), evidence, fits[1].residual)
