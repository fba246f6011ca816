"""Scenes that a camera is likely to see, and what its fitted rendering makes of them: what samples tell of the inverse.

Near the edge of its gamut a camera takes wide ranges of scenes to few codes. There the rendering is a gentle function,
which runs on safely beyond the samples, and its inverse a steep one, which does not. So the lattice that linearizes is
fitted to the samples and, between and beyond them, to scenes that the lattice that renders has taken to codes. Where
several scenes make one code, the fit has their mean, weighted by how likely they are.

The logarithms of natural scenes' responses are nearly normally distributed (Ruderman, Cronin & Chiao 1998,
https://doi.org/10.1364/JOSAA.15.002036). Likely are the calibration's own scenes, and around them what a kernel of the
shape of their covariance makes of them.
"""

import numpy as np

from lutforge.arrays import Array
from lutforge.model.highlights import CLIPPED
from lutforge.model.lattice import Lattice


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


def rendered_scenes(render: Lattice, balanced: Array, count: int) -> tuple[Array, Array]:
    """Return codes (m, 3) that a rendering makes of likely scenes, and these scenes (m, 3); none that clips.

    balanced: the samples' scenes (n, 3).
    """
    scenes = likely_scenes(balanced, count)
    encoded = render(scenes)
    whole = np.all((encoded > CLIPPED) & (encoded < 1.0 - CLIPPED), axis=1)
    return np.asarray(encoded[whole]), scenes[whole]
