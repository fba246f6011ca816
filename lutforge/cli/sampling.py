"""The command that turns shots into colour samples, and the words on shots that others print, too."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from lutforge.cli.console import argument, note, option, progress_bar, say
from lutforge.errors import SettingsError

if TYPE_CHECKING:
    from lutforge.pipeline.sampling import SampledShots

DevelopedFolder = Annotated[
    Path | None, option("A folder of pictures that another program developed, one a shot, same stem.")
]
DevelopedSpace = Annotated[
    str | None, option("The colour space of those pictures, such as prophoto.", "--developed-space")
]


def sample(
    shots: Annotated[list[Path], argument("RAW files, or folders of them.")],
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
    from lutforge.pipeline.file_kinds import TABLE_SUFFIXES
    from lutforge.pipeline.outputs import check_output, named_or_new
    from lutforge.pipeline.pairing import raw_substitute
    from lutforge.pipeline.sampling import sample_by_reference, sample_shots

    output = check_output(named_or_new(output, "samples.csv"), TABLE_SUFFIXES, shots)
    if chart and reference is not None:
        raise SettingsError("--chart is searched for in RAW shots; leave it out, or --reference")
    with progress_bar("sampling") as progress:
        if reference is not None:
            sampled = sample_by_reference(shots, reference, progress)
        else:
            sampled = sample_shots(shots, progress, raw_substitute(developed, developed_space), chart)
    print_shots(sampled)
    sampled.samples.save(output)
    say(f"{output}: {len(sampled.samples)} samples of {len(sampled.shots)} shot{'s' * (len(sampled.shots) != 1)}")


def print_shots(sampled: "SampledShots") -> None:
    """Print the summary of each shot, the notes that shots share, and the shots that were left out."""
    from lutforge.pipeline.sampling import file_notes

    for shot in sampled.shots:
        say(shot.summary)
    note(*file_notes(sampled.shots))
    for reason in sampled.left_out:
        note(f"left out: {reason}")
