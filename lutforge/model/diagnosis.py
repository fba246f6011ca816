"""The diagnosis of implausible samples: likely cause, evidence, advice."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Diagnosis:
    """A likely cause of samples that no camera makes; it concerns all shots, so that none can be blamed."""

    cause: str
    evidence: str
    advice: str

    def __str__(self) -> str:
        """All three in one line."""
        return f"{self.cause}: {self.evidence}; {self.advice}"


def told(diagnoses: tuple[Diagnosis, ...]) -> tuple[str, ...]:
    """Diagnoses in words, a line each."""
    return tuple(map(str, diagnoses))
