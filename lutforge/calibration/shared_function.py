"""The smooth function of colour that the shots of a style share, fitted together with a change of each shot.

What JPEG values differ by from those that the base renders of their RAW is a cubic polynomial of the rendered colour,
the same for all shots. To it a shot adds a change: of tone and of what differs from grey, or of hue alone. The
polynomial is fitted by least squares with robust weights, which are those of residuals to the polynomial and to a
change of each shot. Then the change of any group of shots is the solution of a few equations, from sums that are made
once.

Letters of the sums here: n samples, c channels, s shots, f functions of the polynomial, k and l such functions of a
channel (three times as many), q and r numbers of a change.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.spatial import cKDTree

from lutforge.arrays import Array, Mask
from lutforge.solvers.robust_weights import RobustWeights, cauchy

CODE = 1.0 / 255.0
"""Standard deviation of the noise of JPEG values."""
CHANGE_SPREAD = 0.3
"""Standard deviation of the prior of the numbers of a change, in encoded values."""
FUNCTION_PENALTY = 0.1 * (CODE / CHANGE_SPREAD) ** 2
"""Penalty of the coefficients of the polynomial: its prior is wider than that of a change."""
POWERS = [(i, j, k) for i in range(4) for j in range(4) for k in range(4) if i + j + k <= 3]
"""The powers of red, green and blue in each function of the polynomial."""
TONES = 3
"""The count of numbers of a change that are of the tone of a channel, or of all channels alike."""
MATRIX_TERMS = 6
"""The count of those of a matrix (2, 3) on what differs from grey; they are the last."""
ROBUST_WEIGHTS = RobustWeights(cauchy, multiple=3.0, least=CODE)
REWEIGHTING_ROUNDS = 6
"""Rounds of reweighting."""
POLYNOMIAL_RIDGE = 1e-9
"""Share added to the equations of the polynomial: the shots' changes may explain as much as it does."""


def change_basis(rendered: Array, *, tinted: bool) -> Array:
    """The values that each number of a change adds to encoded colours (n, 3), (n, 3, q): tones, a matrix on chroma.

    tinted: each channel has a tone of its own, so that greys may be tinted; else all have the same.
    """
    mean = rendered.mean(axis=1)
    middle = mean * (1.0 - mean)
    tones = np.stack([middle * (2.0 * mean - 1.0) ** power for power in range(TONES)], axis=1)
    chroma = rendered[:, [0, 2]] - mean[:, None]
    # i is a power, or red or blue, whose chroma moves each channel c by number o of the change.
    channels = np.eye(3) if tinted else np.ones((3, 1))
    parts = np.einsum("ni,co->ncio", tones, channels), np.einsum("ni,co->ncio", chroma, np.eye(3))
    return np.concatenate([part.reshape(len(rendered), 3, -1) for part in parts], axis=2)


def turn_basis(rendered: Array) -> Array:
    """How encoded colours (n, 3) move as hues turn about the axis of greys, by a radian from red to green: (n, 3, 1).

    A change of this one number is found more surely than one of all: little else makes shots differ by it.
    """
    red, green, blue = rendered.T
    turned = np.stack([blue - green, red - blue, green - red], axis=1)
    return np.asarray(turned[..., None] / np.sqrt(3.0))


ChangeBasis = Callable[[Array], Array]
"""What each number of a change adds to encoded colours: (n, 3) → (n, 3, q)."""


def _polynomials(rendered: Array) -> Array:
    """Cubic polynomials of encoded colours (n, 3), (n, 20)."""
    red, green, blue = (2.0 * rendered - 1.0).T
    return np.stack([red**i * green**j * blue**k for i, j, k in POWERS], axis=1)


@dataclass(frozen=True, eq=False)
class ComparedColours:
    """The colours of the shots that are compared.

    rendered: (n, 3) as the base renders them; encoded: (n, 3) as the camera did; rows_of_shots: the samples of each
    shot; change: the basis of what a shot may change; basis: (n, 3, q) its values for the colours.
    """

    rendered: Array
    encoded: Array
    rows_of_shots: Sequence[NDArray[np.intp]]
    change: ChangeBasis
    basis: Array

    @classmethod
    def of(
        cls, rendered: Array, encoded: Array, rows_of_shots: Sequence[NDArray[np.intp]], change: ChangeBasis
    ) -> "ComparedColours":
        """The colours with the values of the basis of changes."""
        clipped = np.clip(rendered, 0.0, 1.0)
        return cls(clipped, encoded, rows_of_shots, change, change(clipped))

    def by_hue(self) -> "ComparedColours":
        """The same shots, compared by a turn of hue as the only change of a shot."""
        return replace(self, change=turn_basis, basis=turn_basis(self.rendered))

    @property
    def prior(self) -> Array:
        """The penalty (q, q) of the numbers of a change."""
        return (CODE / CHANGE_SPREAD) ** 2 * np.eye(self.basis.shape[2])

    def rows(self, group: Mask) -> NDArray[np.intp]:
        """The samples of a group of shots (s,)."""
        return np.concatenate([self.rows_of_shots[place] for place in np.flatnonzero(group).tolist()])

    def common(self, group: Mask, distance: float, least: int) -> tuple["ComparedColours", Mask]:
        """The colours that both a group of shots (s,) and the others show, and a mask (s,) of shots that have enough.

        distance: the largest one, of rendered values, from a colour to one of the other side; least: colours of a shot.
        """
        in_group = self.by_shot(group.astype(np.float64)) > 0
        is_common = np.zeros(len(in_group), dtype=np.bool_)
        for side in (in_group, ~in_group):
            nearest = cKDTree(self.rendered[~side]).query(self.rendered[side], distance_upper_bound=distance)[0]
            is_common[side] = np.isfinite(nearest)
        enough = np.array([np.count_nonzero(is_common[rows]) >= least for rows in self.rows_of_shots])
        parts = [
            rows[is_common[rows]] for rows, has_enough in zip(self.rows_of_shots, enough, strict=True) if has_enough
        ]
        rows = np.concatenate([*parts, np.zeros(0, dtype=np.intp)])
        ends_of_shots = np.cumsum([len(part) for part in parts])
        rows_of_shots = np.split(np.arange(len(rows)), ends_of_shots[:-1])
        return replace(
            self,
            rendered=self.rendered[rows],
            encoded=self.encoded[rows],
            basis=self.basis[rows],
            rows_of_shots=rows_of_shots,
        ), enough

    def by_shot(self, values: Array) -> Array:
        """Values by shot (s,), repeated for the samples (n,)."""
        return np.repeat(values, [len(rows) for rows in self.rows_of_shots])


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """The normal equations of the polynomial and the changes, with the samples weighted in one way.

    orthonormal: (f, n) functions of the polynomial of which the weighted squares are 1 and the weighted products 0;
    residual: (n, 3) to the polynomial alone; of a change of each shot: normal: (s, q, q) its products with itself;
    cross: (s, k, q) with the polynomial; right: (s, q) with the residual.
    """

    colours: ComparedColours
    orthonormal: Array
    residual: Array
    normal: Array
    cross: Array
    right: Array

    @classmethod
    def of(cls, colours: ComparedColours, weight: Array) -> "NormalEquations":
        """The equations of samples that count by weights (n,)."""
        functions = _polynomials(colours.rendered)
        weighted_functions = functions * weight[:, None]
        normal_of_functions = weighted_functions.T @ functions + FUNCTION_PENALTY * np.eye(len(POWERS))
        orthonormal = solve_triangular(np.linalg.cholesky(normal_of_functions), functions.T, lower=True)
        difference = colours.encoded - colours.rendered
        residual = difference - orthonormal.T @ (orthonormal * weight @ difference)

        normal, cross, right = [], [], []
        for rows in colours.rows_of_shots:
            basis = colours.basis[rows]
            weighted = basis * weight[rows, None, None]
            normal.append(np.einsum("ncq,ncr->qr", weighted, basis))
            right.append(np.einsum("ncq,nc->q", weighted, residual[rows]))
            cross.append(np.einsum("fn,ncq->cfq", orthonormal[:, rows], weighted).reshape(-1, basis.shape[2]))
        return cls(colours, orthonormal, residual, np.array(normal), np.array(cross), np.array(right))

    def explained_by_each_shot(self) -> Array:
        """The part of the residuals (n, 3) that a change of each shot by itself explains.

        The changes are eliminated from the equations, which leaves those of the polynomial (k, k).
        """
        inverse = np.linalg.inv(self.normal + self.colours.prior)
        reduced = np.einsum("skq,sqr->skr", self.cross, inverse)
        of_polynomial = (1.0 + POLYNOMIAL_RIDGE) * np.eye(self.cross.shape[1]) - np.einsum(
            "skr,slr->kl", reduced, self.cross
        )
        polynomial = np.linalg.solve(of_polynomial, np.einsum("skr,sr->k", reduced, self.right))
        changes = np.einsum("sqr,sr->sq", inverse, self.right + np.einsum("skq,k->sq", self.cross, polynomial))

        shared = np.einsum("skq,sq->k", self.cross, changes).reshape(3, -1)
        by_shot = zip(self.colours.rows_of_shots, changes, strict=True)
        explained = np.concatenate([self.colours.basis[rows] @ change for rows, change in by_shot])
        return np.asarray(explained - (shared @ self.orthonormal).T)


@dataclass(frozen=True, eq=False)
class FittedChanges:
    """The changes of some groups of shots against all others, fitted together.

    The numbers of a group are added to it, and taken from the shots of no group. signs: (m, s) 1 of the group, −1 of
    the others; numbers: (m, q); inverse: (m q, m q) of their normal matrix; error_saved: the sum of squares by which a
    fit with the changes is better.
    """

    signs: Array
    numbers: Array
    inverse: Array
    error_saved: float


@dataclass(frozen=True, eq=False)
class SharedFunctionFit:
    """The robust fit of the function that shots share.

    weight: (n,) of the samples; equations: of the last round; noise: the variance of the samples where each shot has a
    change of its own.
    """

    colours: ComparedColours
    equations: NormalEquations
    weight: Array
    noise: float

    def fitted_changes(self, *groups: Mask) -> FittedChanges:
        """The changes of groups of shots, each (s,), against the others."""
        signs = np.where(groups, 1.0, -1.0)
        cross = self._products_with_polynomial(signs)
        right = (signs @ self.equations.right).ravel()
        normal = np.einsum("is,js,sqr->iqjr", signs, signs, self.equations.normal).reshape(cross.shape[1], -1)
        prior = np.kron(np.eye(len(signs)), self.colours.prior)
        inverse = np.linalg.inv(normal + prior - cross.T @ cross)
        numbers = inverse @ right
        return FittedChanges(signs, numbers.reshape(len(signs), -1), inverse, float(right @ numbers))

    def error_saved(self, *groups: Mask) -> float:
        """The sum of squares that changes of groups, each (s,), save, less what their numbers save by chance.

        That is twice the noise a number (Akaike 1974, https://doi.org/10.1109/TAC.1974.1100705).
        """
        changes = self.fitted_changes(*groups)
        return changes.error_saved - 2.0 * changes.numbers.size * self.noise

    def difference_in_codes(self, error_saved: float, group: Mask, others: Mask) -> float:
        """The difference of two groups of shots (s,) whose change saves an error: root mean square, in codes."""
        weights = [max(float(self.weight[self.colours.rows(shots)].sum()), 1.0) for shots in (group, others)]
        return 255.0 * float(np.sqrt(max(error_saved, 0.0) / 3.0 * (1.0 / weights[0] + 1.0 / weights[1])))

    def scores(self, changes: FittedChanges, hue_groups: int) -> Array:
        """The derivatives (m q, g) of the squares by changes, summed over each group of similar hue of each shot."""
        colours, orthonormal = self.colours, self.equations.orthonormal
        cross = self._products_with_polynomial(changes.signs)
        of_samples = np.stack([colours.by_shot(sign) for sign in changes.signs])
        basis = np.concatenate([sign[:, None, None] * colours.basis for sign in of_samples], axis=2)
        numbers = changes.numbers.ravel()
        shared = (cross @ numbers).reshape(3, -1)
        residual = self.equations.residual - basis @ numbers + (shared @ orthonormal).T

        # Each number of the changes, less what the polynomial explains of it
        explained = np.einsum("cfq,fn->ncq", cross.reshape(3, -1, len(numbers)), orthonormal)
        scores = np.einsum("n,ncq,nc->nq", self.weight, basis - explained, residual)

        red, green, blue = colours.rendered.T
        hue = np.arctan2(blue - green, red - green)
        groups = [
            group for rows in colours.rows_of_shots for group in np.array_split(rows[np.argsort(hue[rows])], hue_groups)
        ]
        return np.stack([scores[group].sum(axis=0) for group in groups], axis=1)

    def _products_with_polynomial(self, signs: Array) -> Array:
        """The products of the polynomial with changes of shots by signs (m, s): (k, m q)."""
        return np.concatenate([np.tensordot(sign, self.equations.cross, 1) for sign in signs], axis=1)


def fit_shared_function(colours: ComparedColours) -> SharedFunctionFit:
    """Fit the function that the shots share, with weights that do not count a shot's change as an error."""
    weight = np.ones(len(colours.rendered))
    for _ in range(REWEIGHTING_ROUNDS):
        equations = NormalEquations.of(colours, weight)
        residual = equations.residual - equations.explained_by_each_shot()
        weight = ROBUST_WEIGHTS(np.linalg.norm(residual, axis=1))
    freedom = 3.0 * (float(weight.sum()) - len(POWERS)) - equations.right.size
    noise = float((weight[:, None] * residual**2).sum()) / max(freedom, 1.0)
    return SharedFunctionFit(colours, equations, weight, noise)
