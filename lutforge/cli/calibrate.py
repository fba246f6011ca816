"""`lutforge calibrate`: samples or RAW files → a camera profile."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lutforge.cli.console import (
    DevelopedFolder,
    DevelopedSpace,
    DeveloperName,
    ProfileOutput,
    note,
    print_table,
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
    list[Path] | None,
    typer.Argument(help="Sample tables (.csv, .parquet), RAW files, folders of RAW files.", show_default=False),
]
Pairs = Annotated[
    tuple[Path, Path] | None,
    typer.Option(help="Instead of shots, two folders: the same frames before and after, same stems."),
]
FromSpace = Annotated[str, typer.Option("--from-space", help="The colour space of the first folder of --pairs.")]
Model = Annotated[
    str, typer.Option(help="lattice; or rbf: fits response, matrix and gamut map as stages of their own, too.")
]
Preset = Annotated[str, typer.Option(help="lutforge; or thesis: the published method as written.")]
Size = Annotated[int | None, typer.Option(help="Nodes per axis of the lattices, 3 to 65; 33 unless given.")]
Tolerance = Annotated[
    float | None,
    typer.Option(
        help="Instead of a size: the smallest one (9 to 65) that renders held-out shots with this mean error, the "
        "norm of the RGB difference of encoded values 0 to 1 (0.0068 is one code of 255).",
    ),
]
ForReaders = Annotated[str, typer.Option(help="trilinear or tetrahedral: what will read the LUT.")]
STAGES = "Response, matrix and gamut map"
Inliers = Annotated[
    list[Path] | None,
    typer.Option(
        rich_help_panel=STAGES, help="Samples that response, matrix and white balances are fitted to, instead of all."
    ),
]
Beta = Annotated[
    float, typer.Option(rich_help_panel=STAGES, help="β, the saturation below which colours tell the response.")
]
Curves = Annotated[
    int, typer.Option(rich_help_panel=STAGES, help="Curves of EMoR that the response is made of, 1 to 15.")
]
Weighting = Annotated[
    float, typer.Option(rich_help_panel=STAGES, help="In the fit of the response: 0 weights samples equally, 1 tones.")
]
Centres = Annotated[int, typer.Option(rich_help_panel=STAGES, help="Centres of the gamut map, at most.")]
Rho = Annotated[
    float | None, typer.Option(rich_help_panel=STAGES, help="ρ, the gamut map's smoothness, if not by held-out shots.")
]
WithoutPairs = Annotated[
    list[str] | None,
    typer.Option(
        rich_help_panel=STAGES,
        help='"SHOT|SHOT": their exposure pairs do not tell the response (preset thesis); may repeat.',
    ),
]
Uniform = Annotated[bool, typer.Option("--uniform", help="Keep the node levels evenly spaced.")]
WithLearningCurve = Annotated[
    bool, typer.Option("--learning-curve", help="Show, too, how the error falls with more shots: are they enough?")
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
    for text in (*told(profile.diagnoses), *profile.notes):
        note(text)
    print_table(held_out_table(profile))
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
    print_table(Table(f"Error on held-out shots by the number of shots: {style}", header, rows))
    say(f"{style}: {curve.advice}")
