"""The commands that fit: a camera profile to samples, and a transfer of RAW between two cameras."""

from pathlib import Path
from typing import Annotated

import lutforge as lf
from lutforge.cli.console import ProfileOutput, argument, note, option, print_tables, progress_bar, say
from lutforge.cli.sampling import DevelopedFolder, DevelopedSpace, print_shots
from lutforge.errors import SettingsError
from lutforge.reports.tables import held_out_table


def calibrate(
    sources: Annotated[
        list[Path] | None, argument("Sample tables (.csv, .npz), RAW files, folders of RAW files.")
    ] = None,
    output: ProfileOutput = None,
    preset: Annotated[str, option("lutforge; or thesis: the published method.")] = "lutforge",
    size: Annotated[int, option("Nodes per axis of the lattices, 3 to 65.")] = 33,
    interpolation: Annotated[str, option("trilinear or tetrahedral: what will read the LUT.")] = "trilinear",
    uniform: Annotated[bool, option("Keep the node levels evenly spaced.", "--uniform")] = False,
    developed: DevelopedFolder = None,
    developed_space: DevelopedSpace = None,
    pairs: Annotated[
        tuple[Path, Path] | None, option("Instead of shots, two folders: the same frames before and after, same stems.")
    ] = None,
    from_space: Annotated[str, option("The colour space of the first folder of --pairs.", "--from-space")] = "srgb",
) -> None:
    """Calibrate a camera, and print the error on shots that were held out."""
    from lutforge.pipeline.file_kinds import PROFILE_SUFFIXES
    from lutforge.pipeline.outputs import check_output, named_or_new
    from lutforge.pipeline.pairing import raw_substitute, sample_pairs
    from lutforge.pipeline.sampling import gather_samples
    from lutforge.thesis.options import options_of_preset

    output = check_output(named_or_new(output, "camera.npz"), PROFILE_SUFFIXES, sources or ())
    options = options_of_preset(preset, size=size, interpolation=interpolation, nonuniform=not uniform)
    if pairs is not None and sources:
        raise SettingsError("give --pairs or shots, not both")
    with progress_bar("sampling") as progress:
        if pairs is not None:
            sampled = sample_pairs(*pairs, from_space, progress)
        else:
            sampled = gather_samples(sources or [], progress, raw_substitute(developed, developed_space))
    print_shots(sampled)
    with progress_bar("calibrating") as progress:
        profile = lf.calibrate(sampled.samples, options, progress)
    note(*map(str, profile.diagnoses), *profile.notes)
    print_tables(held_out_table(profile))
    profile.save(output)
    shots = "1 shot" if len(profile.shots) == 1 else f"{len(profile.shots)} shots"
    say(f"{output}: {profile.camera}, {len(sampled.samples)} samples of {shots}")
    say(f"styles: {', '.join(profile.styles)}; white balances: {', '.join(profile.white_balances)}")


def transfer(
    source: Annotated[Path, argument("The first camera's samples, RAW file or folder.")],
    target: Annotated[Path, argument("The other camera's, of the same charts.")],
    output: Annotated[Path, option("The transfer to write (.json).", "-o", "--output")],
) -> None:
    """Fit RAW → RAW between two cameras from charts that both photographed, for apply --as and bake match."""
    from lutforge.pipeline.calibration import write_transfer

    with progress_bar("sampling") as progress:
        common, fitted = write_transfer(source, target, output, progress, lambda sampled: note(*sampled.left_out))
    say(f"{output}: {fitted.source} to {fitted.target}, from {common} common colours")
    say(f"  held-out error, relative: {fitted.error:.2%}")
