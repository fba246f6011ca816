"""`lutforge calibrate`: samples or RAW files → a camera profile."""

from pathlib import Path
from typing import Annotated, Any

from lutforge.cli.console import (
    DevelopedFolder,
    DevelopedSpace,
    ProfileOutput,
    argument,
    note,
    option,
    print_tables,
    progress_bar,
    say,
)
from lutforge.cli.sample import tell
from lutforge.errors import SettingsError
from lutforge.report.tables import held_out_table


def calibrate(
    sources: Annotated[
        list[Path] | None, argument("Sample tables (.csv, .npz), RAW files, folders of RAW files.")
    ] = None,
    output: ProfileOutput = None,
    model: Annotated[
        str, option("lattice; or rbf: fits response, matrix and gamut map as stages of their own, too.")
    ] = "lattice",
    preset: Annotated[str, option("lutforge; or thesis: the published method as written.")] = "lutforge",
    size: Annotated[int | None, option("Nodes per axis of the lattices, 3 to 65; 33 unless given.")] = None,
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
    from lutforge.calibration.options import CalibrationOptions
    from lutforge.pipeline.calibration import calibrate as fit
    from lutforge.pipeline.outputs import PROFILE_SUFFIXES, check_output, named_or_new
    from lutforge.pipeline.sampling import gather_samples, raw_substitute, sample_pairs

    output = check_output(named_or_new(output, "camera.npz"), PROFILE_SUFFIXES, sources or ())
    words: dict[str, Any] = {
        "model": model,
        "preset": preset,
        "interpolation": interpolation,
        "nonuniform": not uniform,
    }
    options = CalibrationOptions(**words | ({} if size is None else {"size": size}))
    if pairs is not None and sources:
        raise SettingsError("give --pairs or shots, not both")
    with progress_bar("sampling") as progress:
        if pairs is not None:
            sampled = sample_pairs(*pairs, from_space, progress)
        else:
            sampled = gather_samples(sources or [], progress, raw_substitute(developed, developed_space))
    tell(sampled)
    with progress_bar("calibrating") as progress:
        profile = fit(sampled.samples, options, progress)
    note(*map(str, profile.diagnoses), *profile.notes)
    print_tables(held_out_table(profile))
    profile.save(output)
    shots = "1 shot" if len(profile.shots) == 1 else f"{len(profile.shots)} shots"
    say(f"{output}: {profile.camera}, {len(sampled.samples)} samples of {shots}")
    say(f"styles: {', '.join(profile.styles)}; white balances: {', '.join(profile.white_balances)}")
