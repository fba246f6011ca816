"""What keeps the worst colours of a round trip from coming back: folds of the render, or nodes that are too few.

    python -m tests.benchmarks.round_trip_floor [number of unseen cameras] [name of a camera …]

Printed per rendering, for the render as it was fitted and for the one without folds: the share of its range that folds;
the change from the model, mean and largest, encoded; and for linearizations of ever more nodes, made exactly, without
any fit, the round trip's mean and largest RGB norm. Where the render folds no inverse is continuous, and no number of
nodes brings the largest error down; without folds it falls with the nodes, and is kinks of the render that lie between
them: a fit of both (`config_round_trips.py`) brings these down.
"""

import sys
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

import lutforge as lf
from lutforge.model.lattice import grid
from lutforge.ocio.cameras import name_cameras
from lutforge.ocio.exact_inverse import exact_inverse
from lutforge.ocio.layered_levels import even_levels, layered
from lutforge.ocio.lut_files import compact
from lutforge.ocio.made_colours import MadeColours, spread
from lutforge.ocio.mutual_inverses import foldless
from lutforge.ocio.pair_descent import linearization_lut
from lutforge.ocio.preimage import Render, as_render
from lutforge.ocio.renderings import Rendering, renderings
from lutforge.ocio.round_trip import measure
from lutforge.ocio.unfolding import folded_share
from tests.benchmarks.config_round_trips import unseen_ones

Array = NDArray[np.float64]

NODES = (33, 49, 65)


def rows(rendering: Rendering) -> Iterator[str]:
    """Two rows of the table."""
    assert rendering.render is not None
    assert rendering.linearize is not None
    own = compact(lf.bake(rendering.linearize))
    fitted = as_render(compact(lf.bake(rendering.render)))
    without, beyond = foldless(fitted, rendering.support)
    raw = spread(1 << 14, seed=41)
    for what, render, runs_on in (("as fitted", fitted, fitted), ("without folds", without, beyond)):
        change = np.linalg.norm(render(raw) - fitted(raw), axis=1)
        trips = "".join(f"{mean:9.5f}{largest:7.3f}" for mean, largest in exactly(render, runs_on, own))
        yield f"  {what:16s}{folded_share(render):8.2%}{change.mean():9.4f}{change.max():7.3f}{trips}"


def exactly(render: Render, runs_on: Render, own: lf.Lut) -> Iterator[tuple[float, float]]:
    """The round trip through exact inverses of ever more nodes."""
    pool = MadeColours.of(render, 1 << 13, 5)
    for size in NODES:
        levels = layered(even_levels(pool, size - 2))
        codes = grid(levels).reshape(-1, 3)
        inner = grid(pool.knots(levels)).reshape(-1, 3)
        back = exact_inverse(pool, runs_on, inner, codes, own(codes)).reshape(size, size, size, 3)
        trip = measure(render.lut, linearization_lut(own, pool, levels, back), count=1 << 13)
        yield trip.mean, trip.maximum


def main() -> None:
    """Print the table."""
    words = sys.argv[1:]
    count = next((int(word) for word in words if word.isdigit()), 0)
    wanted = [word for word in words if not word.isdigit()]
    heads = "".join(f"{f'{size}³':>9s}{'max':>7s}" for size in NODES)
    print(f"{'':18s}{'folds':>8s}{'change':>9s}{'max':>7s}{heads}")
    for name, made in unseen_ones(count):
        if wanted and not any(word in name for word in wanted):
            continue
        for rendering in renderings(name_cameras([made()])):
            print(f"{name}: {rendering.style}")
            for line in rows(rendering):
                print(line, flush=True)


if __name__ == "__main__":
    main()
