"""`lutforge inspect`: what a file is, and what it can be used for."""

from pathlib import Path
from typing import Annotated

import typer

from lutforge.cli.console import for_each, print_table, say


def inspect(
    files: Annotated[list[Path], typer.Argument(help="RAW files or profiles (.npz).", show_default=False)],
) -> None:
    """Show camera, settings, preview and use of RAW files, and the contents of profiles."""
    for_each(files, _show)


def _show(file: Path) -> None:
    (_profile if file.suffix.lower() == ".npz" else _shot)(file)


def _shot(file: Path) -> None:
    from lutforge.shots.read import read_shot

    shot = read_shot(file)
    data, place = shot.metadata, shot.registration
    multipliers = "unknown" if data.multipliers is None else ", ".join(f"{value:.4f}" for value in data.multipliers)
    height, width = shot.jpeg.shape[:2]
    rows = [
        ("camera", data.camera),
        ("picture style", data.style),
        ("white balance", f"{data.white_balance}, multipliers {multipliers}"),
        ("exposure", f"{data.exposure_s:.5g} s, ISO {data.iso:g}"),
        ("JPEG", f"{width} × {height}, {shot.jpeg_source}"),
        (
            "registration",
            f"{place.scale:.4f} RAW pixels per JPEG pixel, offset {place.offset_x:.1f}, {place.offset_y:.1f}, "
            f"correlation {place.correlation:.3f}",
        ),
        ("use", "a RAW/JPEG pair: sample, calibrate, evaluate"),
        *(("note", text) for text in data.notes),
    ]
    print_table(str(file), ("", ""), rows)


def _profile(file: Path) -> None:
    from lutforge.cli.calibrate import print_held_out
    from lutforge.model.profile_file import load_profile

    profile = load_profile(file)
    rows = [("camera", profile.camera), ("shots", str(len(profile.shots)))]
    for name, balance in profile.white_balances.items():
        r, g, b = balance.multipliers
        kelvin = f", {balance.kelvin:.0f} K" if balance.kelvin is not None else ""
        spread = f", varies by {balance.spread:.0%} from shot to shot" if balance.spread > 0.005 else ""
        rows.append(("white balance", f"{name}: {r:.4f}, {g:.4f}, {b:.4f}{kelvin}{spread}"))
    for name, style in profile.styles.items():
        parts = [
            f"{direction} lattice {' × '.join(map(str, lattice.size))}"
            for direction, lattice in (("render", style.render), ("linearize", style.linearize))
            if lattice is not None
        ]
        parts += [f"physical model for {', '.join(model.white_balances)}" for model in style.physical]
        rows.append(("style", f"{name}: {'; '.join(parts)}"))
    rows += [("note", text) for text in profile.notes]
    print_table(str(file), ("", ""), rows)
    print_held_out(profile)
    say("use: bake, config, apply, evaluate")
