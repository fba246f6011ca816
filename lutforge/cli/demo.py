"""`lutforge demo`: the whole way of the data on shots of a simulated camera, whose rendering is known."""

import sys
from collections.abc import Iterator
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import lutforge as lf
from lutforge import child_processes
from lutforge.cli.console import note, option, print_tables, progress_bar, say
from lutforge.reports.tables import Table, held_out_table

if TYPE_CHECKING:
    from lutforge.cli.demo_shots import DemoShots
    from lutforge.evaluation.figures import ErrorFigures
    from lutforge.pipeline.baked_files import BakedFile


def demo(
    output: Annotated[Path, option("The folder for everything it makes.", "-o", "--output")] = Path("demo"),
    size: Annotated[int, option("Nodes per axis of the lattices.")] = 33,
    verbose: Annotated[bool, option("Print the details of each stage, too.", "-v", "--verbose")] = False,
) -> None:
    """Photograph with a simulated camera, calibrate it, bake, write a config, grade, and compare with the truth."""
    from lutforge.cli.demo_shots import SHOTS, demo_shots
    from lutforge.pipeline.outputs import check_output
    from lutforge.pipeline.sampling import sample_shots
    from lutforge.reports.sheets import calibration_sheet

    check_output(output / "report.html")
    numbers = count()
    with progress_bar("photographing") as progress:
        shots = demo_shots(output / "shots", lambda name: progress(name, next(numbers) / (len(SHOTS) + 1)))
    say(
        f"1. Photograph: {len(shots.calibration)} RAW files with their JPEGs, by a simulated camera: {output / 'shots'}"
    )

    with progress_bar("sampling") as progress:
        sampled = sample_shots(shots.calibration, progress)
    sampled.samples.save(output / "samples.csv")
    say(f"2. Sample: {len(sampled.samples):,} colours that RAW and JPEG share: {output / 'samples.csv'}")
    for shot in sampled.shots if verbose else ():
        say(f"   {shot.summary}")

    with progress_bar("calibrating") as progress:
        profile = lf.calibrate(sampled.samples, lf.CalibrationOptions(size=size), progress)
    profile.save(output / "camera.npz")
    calibration_sheet(profile, "standard", output / "calibration.png")
    held_out = {name: style.errors.get("render_de00_mean") for name, style in profile.styles.items()}
    errors = ", ".join(f"{error:.2f} ({name})" for name, error in held_out.items() if error is not None)
    say(f"3. Calibrate: ΔE00 {errors} on shots left out of the fit; 1 is just visible: {output / 'camera.npz'}")
    note(*map(str, profile.diagnoses), *profile.notes)
    if verbose:
        print_tables(held_out_table(profile))

    _bake(profile, shots, output / "luts", verbose)
    say(f"5. Config: OpenColorIO, {_write_config(profile, output / 'ocio')}")
    graded = _grade(shots, output, verbose)

    say("7. Compare with the simulated camera itself, on colours that it was not calibrated from:")
    rows = [*_truth(profile, shots), graded]
    header = ("what", "n", "mean", "max", "RMSE", "mean ΔE00")
    print_tables(Table("   Error against the known truth (1 = full scale)", header, rows))

    with progress_bar("reporting") as progress:
        page = lf.report(profile, sampled, output / "report.html", progress=progress)
    say(f"8. Report: how good it is, what to shoot next, {len(page.pictures)} figures: {output / 'report.html'}")
    say(f"Everything is in {output}; look at {output / 'refinish.png'} first.")


def _bake(profile: "lf.CameraProfile", shots: "DemoShots", folder: Path, verbose: bool) -> None:
    """Bake LUT files for each kind of transform, and print where they are."""
    from lutforge.pipeline.baking import bake_files
    from lutforge.pipeline.transforms import TransformRequest

    jobs = (
        (TransformRequest("render", target=shots.target), ["render.clf"]),
        (TransformRequest("linearize", shots.source, space="acescg"), ["linearize_acescg.clf"]),
        (
            TransformRequest("refinish", shots.source, shots.target, shots.ev),
            ["refinish.clf", "refinish.resolve.cube", "refinish.cube"],
        ),
    )
    files: list[BakedFile] = []
    with progress_bar("baking") as progress:
        for index, (request, names) in enumerate(jobs):
            progress(request.kind, index / len(jobs))
            files += bake_files(profile, request, [folder / name for name in names])[0]

    say(f"4. Bake: {len(files)} LUT files for render, linearize and refinish, read back and compared: {folder}")
    for file in files if verbose else ():
        say(f"   {file.path}: {file.summary}; {file.error}")


def _write_config(profile: "lf.CameraProfile", folder: Path) -> str:
    """Write the OpenColorIO config; return, in words, where it is, and the verdict of OpenColorIO's program."""
    written = lf.write_config([profile], folder, replace=True)
    program = Path(sys.executable).with_name("ociocheck")
    if not program.exists():
        return f"checked: {written.path}"
    result = child_processes.run([str(program), "--iconfig", str(written.path)], 120)
    return f"ociocheck {'passed' if result.returncode == 0 else 'FAILED'}: {written.path}"


def _grade(shots: "DemoShots", output: Path, verbose: bool) -> tuple[str, ...]:
    """Correct the photograph with wrong settings by a LUT; return its errors, a row of the table."""
    from lutforge.evaluation.figures import error_figures
    from lutforge.images.read import read_image
    from lutforge.reports.sheets import refinish_sheet

    spoilt = shots.held_out.jpeg
    assert spoilt is not None
    (graded,) = lf.apply(output / "luts" / "refinish.clf", spoilt, output / "graded").done
    before, after, target = (read_image(path).pixels[..., :3] for path in (spoilt, graded.target, shots.right))
    titles = (
        f"as shot: {shots.source}, too dark",
        f"corrected: {shots.target}, {shots.ev:+g} EV",
        "as the camera would have made it",
    )
    refinish_sheet(before, after, target, output / "refinish.png", titles)

    usable = ((before > 0) & (before < 1) & (target > 0) & (target < 1)).all(axis=-1)
    say(f"6. Grade: a photograph with wrong white balance and exposure, corrected by one LUT: {graded.target}")
    if verbose:
        say(f"   {100 * (1 - usable.mean()):.1f} % of its pixels are clipped and are not counted below")
    figures = error_figures(after[usable].astype(float), target[usable].astype(float), display=True)
    return _cells("graded JPEG, 8 bit", figures)


def _cells(title: str, figures: "ErrorFigures") -> tuple[str, ...]:
    """A row of the table of errors."""
    numbers = (f"{value:.4f}" for value in (figures.mean, figures.maximum, figures.rmse))
    return (title, str(figures.count), *numbers, "–" if figures.de00_mean is None else f"{figures.de00_mean:.2f}")


def _truth(profile: "lf.CameraProfile", shots: "DemoShots") -> Iterator[tuple[str, ...]]:
    """Render, linearize and refinish on the colours of the held-out shot, against the camera's own functions."""
    from lutforge.evaluation.figures import error_figures

    raw = lf.sample(shots.held_out.dng).raw
    ev = shots.ev
    style, balance = shots.source.split("/")
    target_style, target_balance = shots.target.split("/")
    before = shots.camera.render(raw, style, balance)
    after = shots.camera.render(raw, target_style, target_balance, ev)
    usable = ((before > 0.002) & (before < 0.998) & (after > 0.002) & (after < 0.998)).all(axis=-1)
    for title, predicted, true in (
        (f"render {shots.source}", profile.render(shots.source)(raw), before),
        (f"render {shots.target}, {ev:+g} EV", profile.render(shots.target)(raw * 2**ev), after),
        (f"linearize {shots.source}", profile.linearize(shots.source)(before), raw),
        ("refinish", profile.refinish(shots.source, shots.target, ev)(before), after),
    ):
        yield _cells(title, error_figures(predicted[usable], true[usable], display=true is not raw))
