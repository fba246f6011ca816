"""Scenes that a camera is likely to see, rendered by the fitted lattice, as further samples for the linearization.

Near the edge of its gamut a camera takes wide ranges of scenes to few codes. There the rendering is a gentle function,
which extrapolates well beyond the samples; its inverse is steep and does not. So the lattice that linearizes is fitted
to the samples and to pairs of a likely scene and the code that the lattice that renders gives it. Where several scenes
have one code, the fit takes their mean, weighted by their probability.

Neutral light is always likely, up to where the camera clips, and samples rarely reach there. Without it the two
lattices have different prior means near white, which differ by up to 2 codes (D40) or 7 (S40) at code 254.

The logarithms of the cone responses to natural scenes are nearly normally distributed (Ruderman, Cronin & Chiao 1998,
https://doi.org/10.1364/JOSAA.15.002036). So the density of likely scenes is a kernel density estimate in log RAW: the
scenes of the calibration, each with a kernel whose shape is their covariance.
"""

import numpy as np

from lutforge.arrays import Array
from lutforge.calibration.lattice.continuation import OFFSET
from lutforge.model.gamut_map import from_even
from lutforge.model.highlights import CLIPPED
from lutforge.model.lattice import Lattice
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
    return np.asarray(from_even(level, OFFSET)[:, None] * light / light.max(axis=1, keepdims=True))


def rendered_scenes(render: Lattice, balanced: Array, count: int) -> tuple[Array, Array]:
    """Return the codes (m, 3) of likely and of neutral scenes under a rendering, and these scenes (m, 3).

    Scenes that clip are left out. balanced: the samples' scenes (n, 3).
    """
    scenes = np.concatenate([likely_scenes(balanced, count), neutral_scenes(count // 4)])
    encoded = render(scenes)
    whole = np.all((encoded > CLIPPED) & (encoded < 1.0 - CLIPPED), axis=1)
    return np.asarray(encoded[whole]), scenes[whole]
