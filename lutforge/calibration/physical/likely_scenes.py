"""Scenes that a camera is likely to see, which the fitted model renders as further samples for its inverse.

Near the edge of its gamut a camera takes wide ranges of scenes to few codes. There the rendering is a gentle function,
which extrapolates well beyond the samples; its inverse is steep and does not. So h⁻¹ is fitted to the samples and to
pairs of a likely scene and the code that the rendering gives it. Neutral light is always likely, up to where the camera
clips, and samples rarely reach there.

The logarithms of the cone responses to natural scenes are nearly normally distributed (Ruderman, Cronin & Chiao 1998,
https://doi.org/10.1364/JOSAA.15.002036). So the density of likely scenes is a kernel density estimate in log RAW: the
scenes of the calibration, each with a kernel whose shape is their covariance.
"""

import numpy as np

from lutforge.arrays import Array
from lutforge.model.gamut_map import from_even
from lutforge.sobol import sobol


def likely_scenes(balanced: Array, count: int) -> Array:
    """Draw at most `count` scenes (m, 3) below 1 around those of the samples, Tw E (n, 3), the same ones every time.

    The kernel is Student's t with three degrees of freedom, because a broad prior has wide tails. Its width, half the
    samples' standard deviation, is about that of Silverman's rule for 150 samples, as many as a chart has.
    """
    rng, width, freedom, darkest = np.random.default_rng(0), 0.5, 3.0, 1e-4
    seen = np.log(np.maximum(balanced, darkest))
    shape = np.linalg.cholesky(np.cov(seen.T) + 1e-6 * np.eye(3))
    normal = rng.standard_normal((2 * count, 3)) @ shape.T
    step = width * normal / np.sqrt(rng.chisquare(freedom, (2 * count, 1)) / freedom)
    drawn = np.exp(seen[rng.integers(0, len(seen), len(step))] + step)
    return np.asarray(drawn[np.all(drawn < 1.0, axis=1)][:count])


def neutral_scenes(count: int) -> Array:
    """Return near-neutral light (count, 3) from black to saturation, at perceptually even steps.

    Red and blue differ from green by up to a tenth.
    """
    level, red, blue = sobol(count, seed=0).T
    light = 1.0 + 0.1 * np.stack([2.0 * red - 1.0, np.zeros(count), 2.0 * blue - 1.0], axis=1)
    return np.asarray(from_even(level, 0.005)[:, None] * light / light.max(axis=1, keepdims=True))
