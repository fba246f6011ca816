"""The camera profiles of kits, written and measured."""

from pathlib import Path

from lutforge.kits.dcp import fit_dng_profile, write_dcp
from lutforge.kits.icc import Variant, fit_icc_profile, write_icc
from lutforge.kits.kit import Look
from lutforge.kits.measure import error_of_profile
from lutforge.luts.verification import FileError


def write_icc_profiles(look: Look, folder: Path) -> dict[str, FileError]:
    """Write ICC profiles of the look, and of its colours alone. Returns the error of each, by file name."""
    errors = {}
    for variant in Variant:
        path = folder / f"{look.file_name}{variant.value}.icc"
        write_icc(fit_icc_profile(look, variant), path)
        errors[path.name] = error_of_profile(path, look, variant is Variant.COLOURS)
    return errors


def write_dng_profile(look: Look, folder: Path) -> dict[str, FileError]:
    """Write a DNG camera profile of the look. Returns its error, by file name."""
    path = folder / f"{look.file_name}.dcp"
    write_dcp(fit_dng_profile(look), path)
    return {path.name: error_of_profile(path, look)}
