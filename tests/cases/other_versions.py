"""Other versions of OpenColorIO, OpenImageIO and Blender, and a reader of CLF, each in an environment of its own.

`python -m tests.cases.other_versions`, or `make other-versions`, installs them in the user's cache; tests skip those
that are missing.
"""

import shutil
import subprocess
import sys
import venv
from pathlib import Path

import platformdirs
import pytest

OPENCOLORIO = ("2.2.1", "2.3.2", "2.4.2", "2.5.2", "2.6.0")
OPENIMAGEIO = ("3.0.3.1",)
BLENDER = ("4.2.0",)
CLF_READER = "0.2.0"
SYSTEM = Path("/usr/bin")
"""Where Debian has OpenColorIO 2.1 (python3-pyopencolorio) and oiiotool 2.4 (openimageio-tools)."""


def folder(package: str, version: str) -> Path:
    """The environment of one version."""
    return platformdirs.user_cache_path("lutforge") / "other versions" / f"{package}-{version}"


def python_with_opencolorio(version: str) -> Path:
    """A Python that imports this version of PyOpenColorIO, "2.1" for the distribution's. Skips where it is missing."""
    python = SYSTEM / "python3" if version == "2.1" else folder("opencolorio", version) / "bin" / "python"
    script = "import PyOpenColorIO, sys; sys.exit(not PyOpenColorIO.__version__.startswith(sys.argv[1]))"
    if not python.exists() or subprocess.run([python, "-c", script, version], capture_output=True).returncode:
        pytest.skip(f"OpenColorIO {version} is not installed: make other-versions, for 2.1 python3-pyopencolorio")
    return python


def python_with_clf_reader() -> Path:
    """A Python that imports colour_clf_io. Skips where it is missing."""
    place = folder("colour-clf-io", CLF_READER)
    if not (place / "installed").exists():
        pytest.skip(f"colour-clf-io {CLF_READER} is not installed: make other-versions")
    return place / "bin" / "python"


def oiiotool(version: str) -> Path:
    """This version of oiiotool, "2.4" the distribution's, "" that of this Python. Skips where it is missing."""
    places = {"2.4": SYSTEM / "oiiotool", "": Path(sys.executable).with_name("oiiotool")}
    tool = places.get(version, folder("openimageio", version) / "bin" / "oiiotool")
    if not tool.exists():
        pytest.skip(f"oiiotool {version} is not installed: make other-versions, for 2.4 openimageio-tools")
    output = subprocess.run([tool, "--version"], capture_output=True, text=True).stdout.strip()
    if not output.startswith(version):
        pytest.skip(f"oiiotool {version} is not installed, but {output}")
    return tool


def blender(version: str) -> list[str]:
    """The words that run a script in Blender: "3.4", the program, or a version of its Python module. Skips without."""
    program = shutil.which("blender")
    if version == "3.4" and program is not None:
        return [program, "--background", "--factory-startup", "--python-exit-code", "3", "--python"]
    python = folder("bpy", version) / "bin" / "python"
    if not python.exists():
        pytest.skip(f"Blender {version} is not installed: make other-versions, for 3.4 Debian's blender")
    return [str(python)]


def install() -> None:
    """Install what is missing; a version without a wheel for this Python is named and left out."""
    needed = {"opencolorio": OPENCOLORIO, "openimageio": OPENIMAGEIO, "bpy": BLENDER, "colour-clf-io": (CLF_READER,)}
    for package, versions in needed.items():
        for version in versions:
            place = folder(package, version)
            if (place / "installed").exists():
                continue
            venv.create(place, with_pip=True, clear=True)
            # The older ones were built against NumPy 1.
            command = [str(place / "bin" / "python"), "-m", "pip", "install", "--quiet", "--only-binary", ":all:"]
            run = subprocess.run([*command, f"{package}=={version}", "numpy<2"], capture_output=True, text=True)
            if run.returncode:
                print(f"{package} {version}: {run.stderr.strip().splitlines()[-1]}", file=sys.stderr)
                continue
            (place / "installed").touch()
            print(f"{package} {version}: {place}")


if __name__ == "__main__":
    install()
