"""What a check of samples found: its likely cause, what speaks for it, and what to do."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Diagnosis:
    """What in a set of samples no camera makes. whole_set: it concerns all, so that no shot can be blamed."""

    cause: str
    evidence: str
    advice: str
    whole_set: bool = True

    def __str__(self) -> str:
        """All three in one line."""
        return f"{self.cause}: {self.evidence}; {self.advice}"


def told(diagnoses: tuple[Diagnosis, ...]) -> tuple[str, ...]:
    """Diagnoses in words, a line each, and how often such a one is wrong (`tests.benchmarks.plausibility`)."""
    return (
        *map(str, diagnoses),
        *(["of good sets of samples one in a hundred is told so wrongly"] if diagnoses else []),
    )
