"""`lutforge calibrate`: samples or RAW files → a camera profile."""

from dataclasses import replace
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
    from lutforge.evaluation.learning_curve import LearningCurve
    from lutforge.pipeline.sampling import SampledShots
    from lutforge.samples.sample_set import SampleSet


OptionalSources = Annotated[
    list[Path] | None, argument("Sample tables (.csv, .parquet), RAW files, folders of RAW files.")
]
Pairs = Annotated[
    tuple[Path, Path] | None, option("Instead of shots, two folders: the same frames before and after, same stems.")
]
FromSpace = Annotated[str, option("The colour space of the first folder of --pairs.", "--from-space")]
Model = Annotated[str, option("lattice; or rbf: fits response, matrix and gamut map as stages of their own, too.")]
Preset = Annotated[str, option("lutforge; or thesis: the published method as written.")]
Size = Annotated[int | None, option("Nodes per axis of the lattices, 3 to 65; 33 unless given.")]
Tolerance = Annotated[
    float | None,
    option(
        "Instead of a size: the smallest one (9 to 65) that renders held-out shots with this mean error, the "
        "norm of the RGB difference of encoded values 0 to 1 (0.0068 is one code of 255)."
    ),
]
ForReaders = Annotated[str, option("trilinear or tetrahedral: what will read the LUT.")]
STAGES = "Response, matrix and gamut map"
Inliers = Annotated[
    list[Path] | None,
    option("Samples that response, matrix and white balances are fitted to, instead of all.", rich_help_panel=STAGES),
]
Beta = Annotated[float, option("β, the saturation below which colours tell the response.", rich_help_panel=STAGES)]
Curves = Annotated[int, option("Curves of EMoR that the response is made of, 1 to 15.", rich_help_panel=STAGES)]
Weighting = Annotated[
    float, option("In the fit of the response: 0 weights samples equally, 1 tones.", rich_help_panel=STAGES)
]
Centres = Annotated[int, option("Centres of the gamut map, at most.", rich_help_panel=STAGES)]
Rho = Annotated[
    float | None, option("ρ, the gamut map's smoothness, if not by held-out shots.", rich_help_panel=STAGES)
]
WithoutPairs = Annotated[
    list[str] | None,
    option(
        '"SHOT|SHOT": their exposure pairs do not tell the response (preset thesis); may repeat.',
        rich_help_panel=STAGES,
    ),
]
Uniform = Annotated[bool, option("Keep the node levels evenly spaced.", "--uniform")]
WithLearningCurve = Annotated[
    bool, option("Show, too, how the error falls with more shots: are they enough?", "--learning-curve")
]


def calibrate(
    sources: OptionalSources = None,
    output: ProfileOutput = Path("camera.npz"),
    model: Model = "lattice",
    preset: Preset = "lutforge",
    size: Size = None,
    tolerance: Tolerance = None,
    interpolation: ForReaders = "trilinear",
    inliers: Inliers = None,
    beta: Beta = 0.3,
    curves: Curves = 15,
    weighting: Weighting = 0.5,
    centres: Centres = 4000,
    rho: Rho = None,
    without_pair: WithoutPairs = None,
    uniform: Uniform = False,
    learning_curve: WithLearningCurve = False,
    developer: DeveloperName = None,
    developed: DevelopedFolder = None,
    developed_space: DevelopedSpace = None,
    pairs: Pairs = None,
    from_space: FromSpace = "srgb",
) -> None:
    """Calibrate a camera, and print the error on shots that were held out."""
    from lutforge.calibration.options import PhysicalOptions
    from lutforge.pipeline.calibration import calibrate as fit
    from lutforge.pipeline.calibration import calibrate_stages, calibration_options, pair_of_shots, smallest_size
    from lutforge.pipeline.kernels import compile_ahead
    from lutforge.pipeline.outputs import PROFILE_SUFFIXES, check_output

    check_output(output, PROFILE_SUFFIXES, [*(sources or ()), *(inliers or ())])
    physical = PhysicalOptions(beta, curves, weighting, centres, rho, tuple(map(pair_of_shots, without_pair or ())))
    options = calibration_options(model, preset, size, tolerance, interpolation, not uniform, physical)
    if pairs is not None and sources:
        raise SettingsError("give --pairs or shots, not both")
    compile_ahead()
    sampled = _sampled(sources or [], pairs, from_space, (developer, developed, developed_space))
    samples = sampled.samples
    if tolerance is not None:
        with progress_bar("choosing a size") as progress:
            options = replace(options, size=smallest_size(samples, tolerance, options, progress))
        say(f"{options.size} nodes per axis are the fewest that reach a mean error of {tolerance:g} on held-out shots")
    with progress_bar("calibrating") as progress:
        stages = calibrate_stages(inliers, options) if inliers else None
        profile = fit(samples, options, progress, stages=stages)
    note(*told(profile.diagnoses), *profile.notes)
    print_tables(held_out_table(profile))
    profile.save(output)
    shots = "1 shot" if len(profile.shots) == 1 else f"{len(profile.shots)} shots"
    say(f"{output}: {profile.camera}, {len(samples)} samples of {shots}")
    if learning_curve:
        _measure_learning_curves(samples)
    say(f"styles: {', '.join(profile.styles)}; white balances: {', '.join(profile.white_balances)}")


def _sampled(
    sources: list[Path],
    pairs: tuple[Path, Path] | None,
    from_space: str,
    substitute: tuple[str | None, Path | None, str | None],
) -> "SampledShots":
    """Take the samples of pairs, or of sources; substitute: what stands in for RAW, if anything."""
    from lutforge.pipeline.sampling import gather_samples

    with progress_bar("sampling") as progress:
        if pairs is None and substitute == (None, None, None):
            return gather_samples(sources, progress, tell)
        from lutforge.pipeline.raw_substitutes import raw_substitute, sample_pairs  # loads what decodes RAW files

        if pairs is None:
            return gather_samples(sources, progress, tell, raw_substitute(*substitute))
        tell(sampled := sample_pairs(*pairs, from_space, progress))
        return sampled


def _measure_learning_curves(samples: "SampleSet") -> None:
    from lutforge.pipeline.calibration import learning_curves

    with progress_bar("learning curve") as progress:
        curves = learning_curves(samples, progress)
    for name, curve in curves.items():
        print_learning_curve(name, curve)


def print_learning_curve(style: str, curve: "LearningCurve") -> None:
    """A style's error on held-out shots against the number of shots, as a table and one sentence."""
    rows = [
        (
            str(point.shots),
            f"{point.samples:.0f}",
            f"{point.render:.4f}",
            f"{point.spread:.4f}",
            f"{point.linearize:.4f}",
        )
        for point in curve.points
    ]
    header = ("shots", "samples", "render mean", "± 1 σ", "linearize mean")
    print_tables(Table(f"Error on held-out shots by the number of shots: {style}", header, rows))
    say(f"{style}: {curve.advice}")
