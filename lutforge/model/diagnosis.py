"""The diagnosis of implausible samples: likely cause, evidence, advice."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Diagnosis:
    """A likely cause of samples that no camera makes. whole_set: it concerns all shots, so that none can be blamed."""

    cause: str
    evidence: str
    advice: str
    whole_set: bool = True

    def __str__(self) -> str:
        """All three in one line."""
        return f"{self.cause}: {self.evidence}; {self.advice}"


def told(diagnoses: tuple[Diagnosis, ...]) -> tuple[str, ...]:
    """Diagnoses in words, a line each, and the rate of false alarms (`tests.benchmarks.plausibility`)."""
    return (
        *map(str, diagnoses),
        *(["one good set of samples in a hundred gets such a line by mistake"] if diagnoses else []),
    )
