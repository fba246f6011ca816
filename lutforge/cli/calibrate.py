"""`lutforge calibrate`: samples or RAW files → a camera profile."""

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from lutforge.cli.console import (
    DevelopedFolder,
    DevelopedSpace,
    DeveloperName,
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
from lutforge.model.diagnosis import told
from lutforge.report.tables import Table, held_out_table

if TYPE_CHECKING:
    from lutforge.calibration.options import CalibrationOptions
    from lutforge.model.camera_profile import CameraProfile
    from lutforge.pipeline.sampling import SampledShots
    from lutforge.samples.sample_set import SampleSet


_stage_option = partial(option, rich_help_panel="Response, matrix and gamut map")


def calibrate(
    sources: Annotated[
        list[Path] | None, argument("Sample tables (.csv, .parquet), RAW files, folders of RAW files.")
    ] = None,
    output: ProfileOutput = None,
    model: Annotated[
        str, option("lattice; or rbf: fits response, matrix and gamut map as stages of their own, too.")
    ] = "lattice",
    preset: Annotated[str, option("lutforge; or thesis: the published method as written.")] = "lutforge",
    size: Annotated[int | None, option("Nodes per axis of the lattices, 3 to 65; 33 unless given.")] = None,
    tolerance: Annotated[
        float | None,
        option(
            "Instead of a size: the smallest one (9 to 65) that renders held-out shots with this mean error, the "
            "norm of the RGB difference of encoded values 0 to 1 (0.0068 is one code of 255)."
        ),
    ] = None,
    interpolation: Annotated[str, option("trilinear or tetrahedral: what will read the LUT.")] = "trilinear",
    inliers: Annotated[
        list[Path] | None,
        _stage_option("Samples that response, matrix and white balances are fitted to, instead of all."),
    ] = None,
    beta: Annotated[float, _stage_option("β, the saturation below which colours tell the response.")] = 0.3,
    curves: Annotated[int, _stage_option("Curves of EMoR that the response is made of, 1 to 15.")] = 15,
    weighting: Annotated[float, _stage_option("In the fit of the response: 0 weights samples equally, 1 tones.")] = 0.5,
    centres: Annotated[int, _stage_option("Centres of the gamut map, at most.")] = 4000,
    rho: Annotated[float | None, _stage_option("ρ, the gamut map's smoothness, if not by held-out shots.")] = None,
    without_pair: Annotated[
        list[str] | None,
        _stage_option('"SHOT|SHOT": their exposure pairs do not tell the response (preset thesis); may repeat.'),
    ] = None,
    uniform: Annotated[bool, option("Keep the node levels evenly spaced.", "--uniform")] = False,
    learning_curve: Annotated[
        bool, option("Show, too, how the error falls with more shots: are they enough?", "--learning-curve")
    ] = False,
    developer: DeveloperName = None,
    developed: DevelopedFolder = None,
    developed_space: DevelopedSpace = None,
    pairs: Annotated[
        tuple[Path, Path] | None, option("Instead of shots, two folders: the same frames before and after, same stems.")
    ] = None,
    from_space: Annotated[str, option("The colour space of the first folder of --pairs.", "--from-space")] = "srgb",
) -> None:
    """Calibrate a camera, and print the error on shots that were held out."""
    from lutforge.calibration.options import PhysicalOptions
    from lutforge.pipeline.calibration import calibration_options, pair_of_shots
    from lutforge.pipeline.outputs import PROFILE_SUFFIXES, check_output, named_or_new

    output = check_output(named_or_new(output, "camera.npz"), PROFILE_SUFFIXES, [*(sources or ()), *(inliers or ())])
    physical = PhysicalOptions(beta, curves, weighting, centres, rho, tuple(map(pair_of_shots, without_pair or ())))
    options = calibration_options(model, preset, size, tolerance, interpolation, not uniform, physical)
    samples = _sampled(sources or [], pairs, from_space, (developer, developed, developed_space)).samples
    profile = _fitted(samples, options, tolerance, inliers)
    print_tables(held_out_table(profile))
    profile.save(output)
    shots = "1 shot" if len(profile.shots) == 1 else f"{len(profile.shots)} shots"
    say(f"{output}: {profile.camera}, {len(samples)} samples of {shots}")
    if learning_curve:
        _tell_learning_curves(samples)
    say(f"styles: {', '.join(profile.styles)}; white balances: {', '.join(profile.white_balances)}")


def _sampled(
    sources: list[Path],
    pairs: tuple[Path, Path] | None,
    from_space: str,
    substitute: tuple[str | None, Path | None, str | None],
) -> "SampledShots":
    """Take the samples of pairs, or of sources; substitute: what stands in for RAW, if anything."""
    from lutforge.pipeline.kernels import compile_ahead
    from lutforge.pipeline.sampling import gather_samples

    if pairs is not None and sources:
        raise SettingsError("give --pairs or shots, not both")
    compile_ahead()
    with progress_bar("sampling") as progress:
        if pairs is None and substitute == (None, None, None):
            return gather_samples(sources, progress, tell)
        from lutforge.pipeline.raw_substitutes import raw_substitute, sample_pairs  # loads what decodes RAW files

        if pairs is None:
            return gather_samples(sources, progress, tell, raw_substitute(*substitute))
        tell(sampled := sample_pairs(*pairs, from_space, progress))
        return sampled


def _fitted(
    samples: "SampleSet", options: "CalibrationOptions", tolerance: float | None, inliers: list[Path] | None
) -> "CameraProfile":
    """Fit a profile, of the smallest size within the tolerance where there is one, its stages to inliers alone."""
    from lutforge.pipeline.calibration import calibrate as fit
    from lutforge.pipeline.calibration import calibrate_stages, smallest_size

    if tolerance is not None:
        with progress_bar("choosing a size") as progress:
            options = replace(options, size=smallest_size(samples, tolerance, options, progress))
        say(f"{options.size} nodes per axis are the fewest that reach a mean error of {tolerance:g} on held-out shots")
    with progress_bar("calibrating") as progress:
        stages = calibrate_stages(inliers, options) if inliers else None
        profile = fit(samples, options, progress, stages=stages)
    note(*told(profile.diagnoses), *profile.notes)
    return profile


def _tell_learning_curves(samples: "SampleSet") -> None:
    """The error of each style on held-out shots against the number of shots, as a table and one sentence."""
    from lutforge.pipeline.calibration import learning_curves

    with progress_bar("learning curve") as progress:
        curves = learning_curves(samples, progress)
    header = ("shots", "samples", "render mean", "± 1 σ", "linearize mean")
    for style, curve in curves.items():
        rows = [
            (f"{at.shots}", f"{at.samples:.0f}", *(f"{value:.4f}" for value in (at.render, at.spread, at.linearize)))
            for at in curve.points
        ]
        print_tables(Table(f"Error on held-out shots by the number of shots: {style}", header, rows))
        say(f"{style}: {curve.advice}")
