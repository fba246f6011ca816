"""LutForge beside what else brings a camera's look into a RAW developer.

    python -m tests.benchmarks.field [--keep DIR] [--json FILE]

Prints a table of real photographs of a Canon PowerShot S40, each left out in turn: mean ΔE00 of flat tiles between the
camera's JPEG and what a program or a model makes of the RAW file.

darktable and RawTherapee run as they are installed, with their defaults; camera-match and darktable_lut_generator are
those of `pip install -e .[bench]`. What is missing is left out, with a line that says so. `--keep DIR` keeps samples,
the programs' default pictures and darktable_lut_generator's cubes, each of which takes it minutes, between runs.
LUTFORGE_TEST_DATA names the folder of real data.
"""

import argparse
import json
import os
import shutil
import struct
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

import lutforge as lf
from lutforge.arrays import Array
from lutforge.child_processes import run_command
from lutforge.colour.srgb import delta_e_2000
from lutforge.errors import LutForgeError
from lutforge.images.raw import read_raw
from lutforge.kits.darktable import NEUTRAL_SETTINGS
from lutforge.kits.kit import look_of
from lutforge.pipeline.kit_checks import KitCheck, compare_with_jpeg
from lutforge.pipeline.kits import write_kit
from tests.benchmarks import common, lattices
from tests.benchmarks.common import heading, row

SETTING = "standard/auto"
SIDECAR = """<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">
<rdf:Description rdf:about="" xmlns:darktable="http://darktable.sf.net/" darktable:xmp_version="4"
darktable:raw_params="0" darktable:history_end="{}"><darktable:history><rdf:Seq>{}</rdf:Seq></darktable:history>
</rdf:Description></rdf:RDF></x:xmpmeta>
"""
STEP = """<rdf:li darktable:num="{}" darktable:operation="{}" darktable:enabled="1" darktable:modversion="{}"
darktable:params="{}" darktable:multi_name="" darktable:multi_priority="0"/>"""


@dataclass(frozen=True, eq=False)
class LeftOut:
    """One photograph left out: `raw` is predicted by what was made from the `others`.

    train, test: their samples, and its own; keep: a folder that is kept between runs.
    """

    raw: Path
    others: tuple[Path, ...]
    train: lf.SampleSet
    test: lf.SampleSet
    keep: Path

    @cache  # noqa: B019 - for the minutes of one run
    def profile(self) -> lf.CameraProfile:
        """Calibrated from the others."""
        return lf.calibrate(self.train)

    def kept(self, name: str) -> Path:
        """The path of a file about this photograph that is kept between runs."""
        return self.keep / f"{name}-{self.raw.stem}"


def darktable_default(shot: LeftOut) -> KitCheck:
    """darktable as it is installed: its scene-referred workflow."""

    def command(output: Path) -> list[str]:
        own = ["--core", "--configdir", str(output.parent / "config"), "--library", ":memory:"]
        depth = ["--conf", "plugins/imageio/format/tiff/bpp=16"]
        return ["darktable-cli", str(shot.raw), str(output), "--icc-type", "SRGB", *own, *depth]

    return default_picture(shot, "darktable", command)


def rawtherapee_default(shot: LeftOut) -> KitCheck:
    """RawTherapee as it is installed: a curve that is matched to the embedded JPEG of this very photograph.

    Its correction of the lens is off: the camera's JPEG has none, and tiles should lie where they lie there.
    """

    def command(output: Path) -> list[str]:
        as_taken = output.parent / "as_taken.pp3"
        as_taken.write_text("[LensProfile]\nLcMode=none\n", encoding="utf-8")
        choices = ["-d", "-p", str(as_taken), "-t", "-b16", "-Y"]
        return ["rawtherapee-cli", "-o", str(output), *choices, "-c", str(shot.raw)]

    return default_picture(shot, "RawTherapee", command)


def default_picture(shot: LeftOut, program: str, command: Callable[[Path], list[str]]) -> KitCheck:
    """What a program makes by a command, which takes the path of the TIFF to write."""
    picture = shot.kept(f"{program}-default").with_suffix(".tif")
    if not picture.exists():
        with tempfile.TemporaryDirectory() as folder:
            output = Path(folder) / "developed.tif"
            run_command(command(output), program, shot.raw, output)
            shutil.move(output, picture)
    return compare_with_jpeg(shot.raw, picture)


def darktable_lut_generator(shot: LeftOut) -> KitCheck:
    """Its cube of 9³ nodes, its own choice, in the place of ours in the kit for darktable."""
    cube = shot.kept("darktable-lut-generator").with_suffix(".cube")
    if not cube.exists():
        with tempfile.TemporaryDirectory() as folder:
            pairs, settings = Path(folder) / "pairs", Path(folder) / "config"
            pairs.mkdir()
            settings.mkdir()
            for other in shot.others:
                preview = read_raw(other).preview
                if preview is not None:
                    (pairs / f"{other.stem}.jpg").write_bytes(preview)
                    shutil.copy(other, pairs / f"{other.stem}.raw")  # it does not know the suffix .crw
            # Its manual asks for darktable without a workflow; tetrahedra are what the kit asks darktable for.
            rows = (f"{key}={value}\n" for key, value in NEUTRAL_SETTINGS.items())
            (settings / "darktablerc").write_text("".join(rows), encoding="utf-8")
            options = ["--path_config_dir", str(settings), "--interpolation", "tetrahedral"]
            # It aligns pictures of one size only: the JPEGs are 640 pixels wide. Its manual names the least number of
            # samples, with which a cube takes minutes; its default takes several times as long.
            options += ["--resize", "640", "--n_samples", "10000"]
            program = str(Path(sys.executable).with_name("darktable_lut_generator"))
            made = Path(folder) / "made.cube"
            subprocess.run([program, *options, str(pairs), str(made)], check=True, capture_output=True, timeout=3600)
            shutil.move(made, cube)
    with tempfile.TemporaryDirectory() as folder:
        module = ("lut3d", 1, struct.pack("<512sii", cube.name.encode(), 1, 0))  # Adobe RGB, tetrahedral interpolation
        place = {"plugins/darkroom/lut3d/def_path": str(cube.parent)}
        return compare_with_jpeg(shot.raw, by_darktable(shot.raw, Path(folder), [module], "SRGB", place))


def by_darktable(
    raw: Path, folder: Path, steps: list[tuple[str, int, bytes]], space: str, settings: dict[str, str] | None = None
) -> Path:
    """What darktable makes of a RAW file by modules: name, version and parameters of each."""
    output, sidecar = folder / "developed.tif", folder / "steps.xmp"
    entries = (STEP.format(at, name, version, data.hex()) for at, (name, version, data) in enumerate(steps))
    sidecar.write_text(SIDECAR.format(len(steps), "".join(entries)), encoding="utf-8")
    words = [word for pair in {**NEUTRAL_SETTINGS, **(settings or {})}.items() for word in ("--conf", "=".join(pair))]
    own = ["--icc-type", space, "--core", "--configdir", f"{folder}/config", "--library", ":memory:", *words]
    run_command(["darktable-cli", str(raw), str(sidecar), str(output), *own], "darktable", raw, output)
    return output


def on_raw(shot: LeftOut, predict: Callable[[Array], Array]) -> float:
    """Mean ΔE00 of what a function makes of balanced RAW samples."""
    rendered = predict(shot.test.raw * shot.test.wb)
    return float(delta_e_2000(np.clip(rendered, 0.0, 1.0), shot.test.srgb).mean())


def camera_match(shot: LeftOut) -> float:
    """camera-match's LUT3D of 17³ nodes, at which it is best on published pairs; from RAW to JPEG on samples."""
    return on_raw(shot, lattices.camera_match(17)(shot.train.raw * shot.train.wb, shot.train.srgb))


def kit(shot: LeftOut, program: str, preset: str = "") -> KitCheck:
    """What a program shows with the kit of the others' RAW files. preset: what is behind the look's name."""
    look = f"{look_of(shot.profile(), SETTING).file_name}{preset}"
    with tempfile.TemporaryDirectory() as folder:
        script = write_kit(shot.profile(), SETTING, Path(folder) / "kit", program) / "develop.sh"
        output = Path(folder) / "developed.tif"
        run_command([str(script), str(shot.raw), str(output), look], program, shot.raw, output)
        return compare_with_jpeg(shot.raw, output)


METHODS: dict[str, Callable[[LeftOut], KitCheck | float]] = {
    "darktable, its default": darktable_default,
    "RawTherapee, its default with the auto-matched curve": rawtherapee_default,
    "darktable_lut_generator 0.1.5, 9³, in darktable": darktable_lut_generator,
    "camera-match 0.2.0, 17³, on RAW": camera_match,
    "LutForge, its model on RAW": lambda shot: on_raw(shot, look_of(shot.profile(), SETTING).render),
    "LutForge, kit for darktable, `.icc`": lambda shot: kit(shot, "darktable"),
    "LutForge, kit for RawTherapee, `.icc`": lambda shot: kit(shot, "rawtherapee", " icc"),
    "LutForge, kit for RawTherapee, `.dcp`": lambda shot: kit(shot, "rawtherapee"),
}


def photographs_table(shots: list[LeftOut]) -> dict[str, float]:
    """Print mean ΔE00 by method and photograph, NaN where a method could not run, and return the figures by name."""
    names = [shot.raw.stem.partition("_")[2] for shot in shots]
    figures: dict[str, float] = {}
    heading("mean ΔE00 to the camera's JPEG", *names, "mean", "8-bit codes")
    notes = []
    for name, measure in METHODS.items():
        values, codes = [], []
        for shot in shots:
            try:
                check = measure(shot)
            except (LutForgeError, ImportError, OSError, subprocess.SubprocessError) as error:
                check = np.nan
                notes.append(f"{name}, {shot.raw.stem}: {str(error).splitlines()[0]}")
            values.append(check.mean if isinstance(check, KitCheck) else check)
            codes.append(check.codes if isinstance(check, KitCheck) else np.nan)
        measured = {
            **dict(zip(names, values, strict=True)),
            "mean": float(np.mean(values)),
            "codes": float(np.mean(codes)),
        }
        figures |= {f"{name}: {of}": float(value) for of, value in measured.items() if np.isfinite(value)}
        row(name, *values, float(np.mean(values)), float(np.mean(codes)), places=2)
    print("", *notes, sep="\n")
    return figures


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--keep", type=Path, help="where samples, default pictures and peers' cubes are kept")
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    arguments, data = parser.parse_args(), common.real_data()
    with common.kept(arguments.keep) as keep, tempfile.TemporaryDirectory() as settings:
        if data is None:
            return 2
        os.environ["RT_SETTINGS"] = settings  # RawTherapee's own defaults, not the user's
        files = {path.stem: path for path in sorted((data / "canon_powershot_s40").glob("CRW_*.CRW"))}
        samples = common.s40(data, keep)
        shots = [
            LeftOut(files[name], tuple(path for path in files.values() if path.stem != name), others, shot, keep)
            for name, others, shot in common.left_out(samples)
        ]
        figures = photographs_table(shots)
        if arguments.json:
            arguments.json.write_text(json.dumps(figures, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
