"""`lutforge demo`: the whole journey on shots of a simulated camera, whose truth is known."""

import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lutforge.cli.calibrate import print_held_out
from lutforge.cli.console import note, print_table, progress_bar, say

if TYPE_CHECKING:
    from lutforge.model.camera_profile import CameraProfile
    from lutforge.simulate.demo import DemoShots


def demo(
    output: Annotated[Path, typer.Option("-o", "--output", help="The folder for everything it makes.")] = Path("demo"),
    size: Annotated[int, typer.Option(help="Nodes per axis of the lattices.")] = 33,
) -> None:
    """Photograph with a simulated camera, calibrate it, bake, write a config, grade, and compare with the truth."""
    from lutforge.calibration.options import CalibrationOptions
    from lutforge.model.profile_file import save_profile
    from lutforge.pipeline.calibration import calibrate
    from lutforge.pipeline.reports import report as write_report
    from lutforge.pipeline.sampling import sample_shots
    from lutforge.report.sheets import calibration_sheet
    from lutforge.samples.table import write_samples
    from lutforge.simulate.demo import SHOTS, demo_shots

    say("1. Photograph: RAW (DNG) and JPEG files of a simulated Nikon D5100")
    with progress_bar("photographing") as report:
        taken = 0

        def count(name: str) -> None:
            nonlocal taken
            report(name, taken / (len(SHOTS) + 1))
            taken += 1

        shots = demo_shots(output / "shots", count)
    say(f"   {len(shots.calibration)} shots in {output / 'shots'}")

    say("2. Sample: colours that RAW and JPEG share")
    with progress_bar("sampling") as report:
        sampled = sample_shots(shots.calibration, report)
    for account in sampled.shots:
        say(f"   {account.summary}")
    write_samples(output / "samples.csv", sampled.samples)

    say("3. Calibrate")
    with progress_bar("calibrating") as report:
        profile = calibrate(sampled.samples, CalibrationOptions(size=size), report)
    for text in profile.notes:
        note(text)
    save_profile(profile, output / "camera.npz")
    calibration_sheet(profile, "standard", output / "calibration.png")
    print_held_out(profile)

    say("4. Bake: LUT files, each read back and compared with the model")
    _bake(profile, shots, output / "luts")

    say("5. Config: OpenColorIO")
    _config(profile, output / "ocio")

    say("6. Grade a photograph that went wrong: white balance, exposure and style")
    graded = _grade(shots, output)

    say("7. Compare with the simulated camera itself, on colours that it was not calibrated from")
    rows = [*_truth(profile, shots), graded]
    header = ("what", "n", "mean", "max", "RMSE", "mean ΔE00")
    print_table("Error against the known truth (1 = full scale)", header, [row.cells() for row in rows])
    say("8. Report")
    with progress_bar("reporting") as report:
        page = write_report(profile, sampled, output / "report.html", progress=report)
    say(f"   {output / 'report.html'}: {len(page.pictures)} figures")
    say(f"Everything is in {output}; look at {output / 'refinish.png'} first")


@dataclass(frozen=True)
class _Row:
    """A line of the table of errors against the truth."""

    what: str
    count: int
    mean: float
    maximum: float
    rmse: float
    de00: float | None

    def cells(self) -> tuple[str, ...]:
        numbers = (f"{value:.4f}" for value in (self.mean, self.maximum, self.rmse))
        return (self.what, str(self.count), *numbers, "–" if self.de00 is None else f"{self.de00:.2f}")


def _bake(profile: "CameraProfile", shots: "DemoShots", folder: Path) -> None:
    from lutforge.luts.bake import bake
    from lutforge.luts.verify import verify

    refinish = profile.refinish(shots.source, shots.target, shots.ev)
    jobs = (
        ("render", profile.render(shots.target), "render.clf", True),
        ("linearize", profile.linearize(shots.source, "acescg"), "linearize_acescg.clf", False),
        ("refinish", refinish, "refinish.clf", True),
        ("refinish", refinish, "refinish.resolve.cube", True),
        ("refinish", refinish, "refinish.cube", True),
    )
    for title, transform, name, display in jobs:
        path = folder / name
        lut = bake(transform, path, title=f"{profile.camera} {title}", display_referred=display)
        error = verify(path, transform, lut, display_referred=display)
        say(f"   {path}: {lut.summary}; {error}")


def _config(profile: "CameraProfile", folder: Path) -> None:
    from lutforge.ocio.check import check_config, load_config
    from lutforge.ocio.config import write_config

    path = write_config([profile], folder, replace=True)
    findings = check_config(load_config(path))
    for finding in findings:
        note(str(finding))
    verdict = "sound" if not findings else f"{len(findings)} finding{'s' * (len(findings) > 1)}"
    program = Path(sys.executable).with_name("ociocheck")
    if program.exists():
        result = subprocess.run(
            [program, "--iconfig", str(path)], capture_output=True, text=True, timeout=120, check=False
        )
        verdict += "; ociocheck: " + ("passed" if result.returncode == 0 else "FAILED")
    say(f"   {path}: {verdict}")


def _grade(shots: "DemoShots", output: Path) -> _Row:
    from lutforge.apply.grade import LutRecipe
    from lutforge.apply.image import apply_image
    from lutforge.evaluation.errors_table import error_figures
    from lutforge.images.read import read_image
    from lutforge.report.sheets import refinish_sheet

    spoilt = shots.held_out.jpeg
    assert spoilt is not None
    grade = LutRecipe(output / "luts" / "refinish.clf").grade(spoilt)
    applied = apply_image(grade, spoilt, output / "graded" / spoilt.name)
    before, after, wanted = (read_image(path).pixels[..., :3] for path in (spoilt, applied.target, shots.wanted))
    titles = (
        f"as shot: {shots.source}",
        f"graded: {shots.target}, {shots.ev:+g} EV",
        "as the camera would have made it",
    )
    refinish_sheet(before, after, wanted, output / "refinish.png", titles)
    usable = ((before > 0) & (before < 1) & (wanted > 0) & (wanted < 1)).all(axis=-1)
    figures = error_figures(after[usable].astype(float), wanted[usable].astype(float), display=True)
    say(f"   {applied.target}; {100 * (1 - usable.mean()):.1f} % of its pixels are clipped and are not counted")
    return _Row("graded JPEG, 8 bit", figures.count, figures.mean, figures.maximum, figures.rmse, figures.de00_mean)


def _truth(profile: "CameraProfile", shots: "DemoShots") -> list[_Row]:
    """Render, linearize and refinish on the colours of the held-out shot, against the camera's own functions."""
    from lutforge.evaluation.errors_table import error_figures
    from lutforge.pipeline.sampling import sample_shots

    raw = sample_shots([shots.held_out.dng]).samples.raw
    camera, rows = shots.camera, []
    source_style, source_balance = shots.source.split("/")
    target_style, target_balance = shots.target.split("/")
    before = camera.render(raw, source_style, source_balance)
    after = camera.render(raw, target_style, target_balance, shots.ev)
    cases = (
        (f"render {shots.source}", profile.render(shots.source)(raw), before, True),
        (
            f"render {shots.target}, {shots.ev:+g} EV",
            profile.render(shots.target)(raw * 2**shots.ev),
            after,
            True,
        ),
        (f"linearize {shots.source}", profile.linearize(shots.source)(before), raw, False),
        ("refinish", profile.refinish(shots.source, shots.target, shots.ev)(before), after, True),
    )
    for what, got, wanted, display in cases:
        usable = ((before > 0.002) & (before < 0.998) & (after > 0.002) & (after < 0.998)).all(axis=-1)
        figures = error_figures(got[usable], wanted[usable], display=display)
        rows.append(_Row(what, figures.count, figures.mean, figures.maximum, figures.rmse, figures.de00_mean))
    return rows
