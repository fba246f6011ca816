"""`lutforge sample`: RAW files → samples.csv."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from lutforge.cli.console import DevelopedFolder, DevelopedSpace, Shots, note, option, progress_bar, say
from lutforge.errors import SettingsError

if TYPE_CHECKING:
    from lutforge.pipeline.sampling import SampledShots


def sample(
    shots: Shots,
    output: Annotated[
        Path | None, option("A .csv or .npz table.", "-o", "--output", show_default="samples.csv, if it is new")
    ] = None,
    reference: Annotated[
        Path | None,
        option("For JPEGs of a camera without RAW: another camera's RAW files of the same scenes, a folder."),
    ] = None,
    chart: Annotated[
        str, option("The shots show this chart: classic, classic2014 or sg. Its patches are sampled, too.")
    ] = "",
    developed: DevelopedFolder = None,
    developed_space: DevelopedSpace = None,
) -> None:
    """Turn RAW files (with their embedded preview, or a JPEG beside them) into a table of colour samples."""
    from lutforge.pipeline.outputs import TABLE_SUFFIXES, check_output, named_or_new
    from lutforge.pipeline.sampling import raw_substitute, sample_by_reference, sample_shots
    from lutforge.samples.table import write_samples

    output = check_output(named_or_new(output, "samples.csv"), TABLE_SUFFIXES, shots)
    if chart and reference is not None:
        raise SettingsError("--chart is searched for in RAW shots; leave it out, or --reference")
    with progress_bar("sampling") as progress:
        if reference is not None:
            sampled = sample_by_reference(shots, reference, progress)
        else:
            sampled = sample_shots(shots, progress, raw_substitute(developed, developed_space), chart)
    tell(sampled)
    write_samples(output, sampled.samples)
    say(f"{output}: {len(sampled.samples)} samples of {len(sampled.shots)} shot{'s' * (len(sampled.shots) != 1)}")


def tell(sampled: "SampledShots") -> None:
    """Print the account of each shot, the notes that shots share, and what was left out."""
    from lutforge.pipeline.sampling import file_notes

    for shot in sampled.shots:
        say(shot.summary)
    note(*file_notes(sampled.shots))
    for reason in sampled.left_out:
        note(f"left out: {reason}")
