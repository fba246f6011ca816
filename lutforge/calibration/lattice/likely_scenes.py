"""Scenes that a camera is likely to see, and what its fitted rendering makes of them: what samples tell of the inverse.

Near the edge of its gamut a camera takes wide ranges of scenes to few codes. There the rendering is a gentle function,
which runs on safely beyond the samples, and its inverse a steep one, which does not. So the lattice that linearizes is
fitted to the samples and, between and beyond them, to scenes that the lattice that renders has taken to codes. Where
several scenes make one code, the fit has their mean, weighted by how likely they are.

Neutral light is always likely, up to where the camera clips, and samples rarely reach there: without it both lattices
follow guesses of their own near white, which part by up to 2 codes (D40) or 7 (S40) at code 254.

The logarithms of natural scenes' responses are nearly normally distributed (Ruderman, Cronin & Chiao 1998,
https://doi.org/10.1364/JOSAA.15.002036). Likely are the calibration's own scenes, and around them what a kernel of the
shape of their covariance makes of them.
"""

import numpy as np

from lutforge.arrays import Array
from lutforge.calibration.lattice.continuation import OFFSET
from lutforge.model.gamut_map import from_even
from lutforge.model.highlights import CLIPPED
from lutforge.model.lattice import Lattice
from lutforge.sobol import sobol


def likely_scenes(balanced: Array, count: int) -> Array:
    """Draw at most `count` scenes around those of the samples, Tw E (n, 3), the same ones every time, (m, 3) below 1.

    Student's t with three degrees of freedom has the tails of a prior that is broad, and half the samples' standard
    deviation is about Silverman's width of a kernel for 150 samples, as many as a chart has.
    """
    rng, width, freedom, darkest = np.random.default_rng(0), 0.5, 3.0, 1e-4
    seen = np.log(np.maximum(balanced, darkest))
    shape = np.linalg.cholesky(np.cov(seen.T) + 1e-6 * np.eye(3))
    normal = rng.standard_normal((2 * count, 3)) @ shape.T
    step = width * normal / np.sqrt(rng.chisquare(freedom, (2 * count, 1)) / freedom)
    drawn = np.exp(seen[rng.integers(0, len(seen), len(step))] + step)
    return np.asarray(drawn[np.all(drawn < 1.0, axis=1)][:count])


def neutral_scenes(count: int) -> Array:
    """Return neutral light (count, 3) from black to saturation, even to the eye.

    Red and blue are tinted by up to a tenth.
    """
    level, red, blue = sobol(count, seed=0).T
    light = 1.0 + 0.1 * np.stack([2.0 * red - 1.0, np.zeros(count), 2.0 * blue - 1.0], axis=1)
    return np.asarray(from_even(level, OFFSET)[:, None] * light / light.max(axis=1, keepdims=True))


def rendered_scenes(render: Lattice, balanced: Array, count: int) -> tuple[Array, Array]:
    """Return codes (m, 3) that a rendering makes of likely and of neutral scenes, and these scenes (m, 3).

    None of them clips. balanced: the samples' scenes (n, 3).
    """
    scenes = np.concatenate([likely_scenes(balanced, count), neutral_scenes(count // 4)])
    encoded = render(scenes)
    whole = np.all((encoded > CLIPPED) & (encoded < 1.0 - CLIPPED), axis=1)
    return np.asarray(encoded[whole]), scenes[whole]
