"""`lutforge demo`: the whole journey on shots of a simulated camera, whose truth is known."""

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
    from lutforge.evaluation.figures import ErrorFigures
    from lutforge.simulate.photograph import DemoShots


def demo(
    output: Annotated[Path, option("The folder for everything it makes.", "-o", "--output")] = Path("demo"),
    size: Annotated[int, option("Nodes per axis of the lattices.")] = 33,
) -> None:
    """Photograph with a simulated camera, calibrate it, bake, write a config, grade, and compare with the truth."""
    from lutforge.pipeline.baking import TransformRequest, bake_files
    from lutforge.pipeline.outputs import check_output
    from lutforge.pipeline.sampling import sample_shots
    from lutforge.reports.matplotlib_figure import calibration_sheet
    from lutforge.samples.table import write_samples
    from lutforge.simulate.photograph import SHOTS, demo_shots

    check_output(output / "report.html")
    say("1. Photograph: RAW (DNG) and JPEG files of a simulated Nikon D5100")
    taken = count()
    with progress_bar("photographing") as progress:
        shots = demo_shots(output / "shots", lambda name: progress(name, next(taken) / (len(SHOTS) + 1)))
    say(f"   {len(shots.calibration)} shots in {output / 'shots'}")

    say("2. Sample: colours that RAW and JPEG share")
    with progress_bar("sampling") as progress:
        sampled = sample_shots(shots.calibration, progress)
    for account in sampled.shots:
        say(f"   {account.summary}")
    write_samples(output / "samples.csv", sampled.samples)

    say("3. Calibrate")
    with progress_bar("calibrating") as progress:
        profile = lf.calibrate(sampled.samples, lf.CalibrationOptions(size=size), progress)
    note(*map(str, profile.diagnoses), *profile.notes)
    profile.save(output / "camera.npz")
    calibration_sheet(profile, "standard", output / "calibration.png")
    print_tables(held_out_table(profile))

    say("4. Bake: LUT files, each read back and compared with the model")
    refinish = TransformRequest("refinish", shots.source, shots.target, shots.ev)
    for request, names in (
        (TransformRequest("render", target=shots.target), ["render.clf"]),
        (TransformRequest("linearize", shots.source, space="acescg"), ["linearize_acescg.clf"]),
        (refinish, ["refinish.clf", "refinish.resolve.cube", "refinish.cube"]),
    ):
        for file in bake_files(profile, request, [output / "luts" / name for name in names])[0]:
            say(f"   {file.path}: {file.summary}; {file.error}")

    say("5. Config: OpenColorIO")
    written = lf.write_config([profile], output / "ocio", replace=True)
    verdict = "sound"
    program = Path(sys.executable).with_name("ociocheck")
    if program.exists():
        result = child_processes.run([str(program), "--iconfig", str(written.path)], 120)
        verdict += "; ociocheck: " + ("passed" if result.returncode == 0 else "FAILED")
    say(f"   {written.path}: {verdict}")

    say("6. Grade a photograph that went wrong: white balance, exposure and style")
    graded = _grade(shots, output)

    say("7. Compare with the simulated camera itself, on colours that it was not calibrated from")
    rows = [*_truth(profile, shots), graded]
    header = ("what", "n", "mean", "max", "RMSE", "mean ΔE00")
    print_tables(Table("Error against the known truth (1 = full scale)", header, rows))
    say("8. Report")
    with progress_bar("reporting") as progress:
        page = lf.report(profile, sampled, output / "report.html", progress=progress)
    say(f"   {output / 'report.html'}: {len(page.pictures)} figures")
    say(f"Everything is in {output}; look at {output / 'refinish.png'} first")


def _grade(shots: "DemoShots", output: Path) -> tuple[str, ...]:
    from lutforge.evaluation.figures import error_figures
    from lutforge.images.read import read_image
    from lutforge.reports.matplotlib_figure import refinish_sheet

    spoilt = shots.held_out.jpeg
    assert spoilt is not None
    (applied,) = lf.apply(output / "luts" / "refinish.clf", spoilt, output / "graded").done
    before, after, wanted = (read_image(path).pixels[..., :3] for path in (spoilt, applied.target, shots.wanted))
    graded = f"graded: {shots.target}, {shots.ev:+g} EV"
    titles = (f"as shot: {shots.source}", graded, "as the camera would have made it")
    refinish_sheet(before, after, wanted, output / "refinish.png", titles)
    usable = ((before > 0) & (before < 1) & (wanted > 0) & (wanted < 1)).all(axis=-1)
    say(f"   {applied.target}; {100 * (1 - usable.mean()):.1f} % of its pixels are clipped and are not counted")
    figures = error_figures(after[usable].astype(float), wanted[usable].astype(float), display=True)
    return _cells("graded JPEG, 8 bit", figures)


def _cells(what: str, figures: "ErrorFigures") -> tuple[str, ...]:
    numbers = (f"{value:.4f}" for value in (figures.mean, figures.maximum, figures.rmse))
    return (what, str(figures.count), *numbers, "–" if figures.de00_mean is None else f"{figures.de00_mean:.2f}")


def _truth(profile: "lf.CameraProfile", shots: "DemoShots") -> Iterator[tuple[str, ...]]:
    """Render, linearize and refinish on the colours of the held-out shot, against the camera's own functions."""
    from lutforge.evaluation.figures import error_figures

    raw, camera, ev = lf.sample(shots.held_out.dng).raw, shots.camera, shots.ev
    (style, balance), (wanted_style, wanted_balance) = shots.source.split("/"), shots.target.split("/")
    before, after = camera.render(raw, style, balance), camera.render(raw, wanted_style, wanted_balance, ev)
    usable = ((before > 0.002) & (before < 0.998) & (after > 0.002) & (after < 0.998)).all(axis=-1)
    for what, got, wanted in (
        (f"render {shots.source}", profile.render(shots.source)(raw), before),
        (f"render {shots.target}, {ev:+g} EV", profile.render(shots.target)(raw * 2**ev), after),
        (f"linearize {shots.source}", profile.linearize(shots.source)(before), raw),
        ("refinish", profile.refinish(shots.source, shots.target, ev)(before), after),
    ):
        yield _cells(what, error_figures(got[usable], wanted[usable], display=wanted is not raw))
