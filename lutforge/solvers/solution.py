"""The result of an iterative solver: values, status, residual, iterations."""

from dataclasses import dataclass
from enum import Enum

from lutforge.arrays import Array


class Status(Enum):
    """How a solver ended, in words that may stand in a message."""

    CONVERGED = "it converged"
    LIMIT = "it reached its limit of iterations"
    SINGULAR = "the equations do not determine every unknown"


@dataclass(frozen=True, eq=False)
class Solution:
    """The values that a solver found.

    value: the unknowns; residual: the norm of what the solution leaves over, in the unit that the solver's docstring
    names; iterations: how many it took. A caller looks at `status` before it uses `value`.
    """

    value: Array
    status: Status
    residual: float
    iterations: int

    @property
    def converged(self) -> bool:
        """True where the solver reached its tolerance."""
        return self.status is Status.CONVERGED
