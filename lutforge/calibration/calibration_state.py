"""The samples of one camera on their way to a profile, and the corrections that were applied to them."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from lutforge.arrays import Array, Mask
from lutforge.calibration.checks import LEAST_TO_CHECK
from lutforge.calibration.lattice.monochrome import is_monochrome
from lutforge.calibration.matrix_and_response import (
    MatrixAndResponse,
    MatrixAndResponseFit,
    fit_matrix_and_response,
    with_matrix_of_all,
)
from lutforge.calibration.options import BETA, CURVES
from lutforge.calibration.style import unclipped
from lutforge.errors import CalibrationError
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.profile import Diagnosis
from lutforge.model.provenance import OwnRaw, Provenance
from lutforge.model.vignetting import Vignetting
from lutforge.samples.sample_set import SampleSet


class FittedBases:
    """The bases that were fitted so far, by style: each is fitted when it is first asked for, and then kept."""

    def __init__(self) -> None:
        self._bases: dict[str, MatrixAndResponseFit] = {}

    def base(self, style: str, fit: Callable[[], MatrixAndResponseFit]) -> MatrixAndResponseFit:
        """The base of a style, by `fit` where there is none yet."""
        if style not in self._bases:
            self._bases[style] = fit()
        return self._bases[style]

    def of_styles(self, is_kept: Callable[[str], bool]) -> "FittedBases":
        """The bases of the styles of which a function is true."""
        bases = FittedBases()
        bases._bases = {style: base for style, base in self._bases.items() if is_kept(style)}
        return bases


@dataclass(frozen=True, eq=False)
class CalibrationState:
    """Samples of one camera on their way to a profile, and the corrections that were applied to them.

    multipliers: Tw (n, 3) of the samples, with the gains of settings; beta, curves: as in `CalibrationOptions`; given:
    a profile whose responses, matrices and white balances hold as they are, or None. provenance: what the RAW of the
    samples was: own, or a reference camera's. notes: what a user should know. fitted_bases: to the present samples.

    The base of a style is its matrix and response: of colours that a gamut map leaves alone (`base_of_unsaturated`),
    of all its colours (`bases_of_all_colours`), or that of a given profile (`given_bases`).
    """

    samples: SampleSet
    multipliers: Array
    beta: float = BETA
    curves: int = CURVES
    given: CameraProfile | None = None
    provenance: Provenance = field(default_factory=OwnRaw)
    vignettings: tuple[Vignetting, ...] = ()
    diagnoses: tuple[Diagnosis, ...] = ()
    notes: tuple[str, ...] = ()
    fitted_bases: FittedBases = field(default_factory=FittedBases)

    @property
    def balanced(self) -> Array:
        """White-balanced RAW Tw E, (n, 3)."""
        return np.asarray(self.samples.raw * self.multipliers)

    @property
    def unclipped(self) -> Mask:
        """The samples that fits may take, a mask (n,)."""
        return unclipped(self.samples, self.multipliers)

    @property
    def styles(self) -> list[str]:
        """The names of the picture styles with unclipped samples."""
        return [str(name) for name in np.unique(self.samples.style[self.unclipped])]

    @property
    def coloured_styles(self) -> list[str]:
        """The names of the picture styles with unclipped samples that are not black and white."""
        return [style for style in self.styles if not is_monochrome(*self.unclipped_colours(style))]

    def rows(self, style: str) -> Mask:
        """The unclipped samples of a style, a mask (n,)."""
        return np.asarray(self.unclipped & (self.samples.style == style))

    def unclipped_colours(self, style: str) -> tuple[Array, Array]:
        """White-balanced RAW and JPEG values of the unclipped samples of a style, each (m, 3)."""
        rows = self.rows(style)
        return self.balanced[rows], self.samples.srgb[rows]

    def base_of_unsaturated(self, style: str) -> MatrixAndResponseFit:
        """The base of a style by the colours that a gamut map leaves alone. Raises CalibrationError."""

        def fit() -> MatrixAndResponseFit:
            balanced, encoded = self.unclipped_colours(style)
            saturates = self.samples.is_own_raw
            return fit_matrix_and_response(balanced, encoded, self.beta, self.curves, saturates=saturates)

        return self.fitted_bases.base(style, fit)

    def bases_of_all_colours(self) -> dict[str, MatrixAndResponse]:
        """The base of each style with colours and samples enough to check, its matrix fitted to saturated colours, too.

        A style whose base cannot be fitted is left out.
        """
        bases = dict[str, MatrixAndResponse]()
        for style in self.styles:
            balanced, encoded = self.unclipped_colours(style)
            if len(encoded) < LEAST_TO_CHECK or is_monochrome(balanced, encoded):
                continue
            try:
                bases[style] = with_matrix_of_all(self.base_of_unsaturated(style), balanced, encoded)
            except (CalibrationError, np.linalg.LinAlgError):
                continue
        return bases

    @property
    def given_bases(self) -> dict[str, MatrixAndResponse]:
        """The bases that hold whatever the samples are, by style; those of other styles are to be fitted."""
        if self.given is None:
            return {}
        return {
            name: MatrixAndResponse(style.models[0].matrix, style.models[0].response)
            for name, style in self.given.styles.items()
            if style.models
        }

    def with_samples(self, samples: SampleSet, multipliers: Array, notes: Iterable[str] = ()) -> "CalibrationState":
        """The state with other samples or white balances; bases stay of styles whose unclipped samples are the same."""
        changed = replace(self, samples=samples, multipliers=multipliers, notes=(*self.notes, *notes))

        def has_same_colours(style: str) -> bool:
            (balanced, encoded), (new_balanced, new_encoded) = (
                state.unclipped_colours(style) for state in (self, changed)
            )
            return np.array_equal(balanced, new_balanced) and np.array_equal(encoded, new_encoded)

        return replace(changed, fitted_bases=self.fitted_bases.of_styles(has_same_colours))

    def select(self, rows: Mask, notes: Iterable[str] = ()) -> "CalibrationState":
        """The state of some of its samples, a mask (n,)."""
        return self.with_samples(self.samples.select(rows), self.multipliers[rows], notes)
