"""Use case: a profile, and the samples that it was calibrated from → a page about it."""

from __future__ import annotations  # so that help() shows the names of types

from collections.abc import Sequence
from pathlib import Path

from lutforge.kits.kit import setting_of
from lutforge.model.camera_profile import CameraProfile, as_profile
from lutforge.model.provenance import Pictures
from lutforge.pipeline.outputs import Paths, check_output
from lutforge.pipeline.provenance import require_same_provenance
from lutforge.pipeline.sampling import SampledShots, gather_samples
from lutforge.progress import Progress, part, silent, with_compilation
from lutforge.reports.comparison import build_comparison
from lutforge.reports.page import Report, write_page
from lutforge.reports.report import build_report
from lutforge.samples.sample_set import SampleSet, with_setting_names


def report(
    profile: CameraProfile | str | Path,
    samples: SampledShots | SampleSet | Paths | None = None,
    output: str | Path | None = None,
    progress: Progress = silent,
) -> Report:
    """Build the report of a profile: curves, maps and tables; with samples its held-out errors and what to shoot next.

    Args:
        profile: a profile, or the path of its file.
        samples: those that it was calibrated from, or tables and shots; shots also get error maps.
        output: the page to write (.html).
        progress: called with the name of the present step, and the share that is done.

    Returns:
        The page as blocks of text, tables and pictures.

    Raises:
        ProfileError, SampleError, ShotError: a file cannot be read.
        CalibrationError: the samples hold none of the profile's styles.
        LutForgeError: nothing can be written there; that is raised before the work.
    """
    check_report_output(output)
    sampled = SampledShots(samples) if isinstance(samples, SampleSet) else samples
    if sampled is not None and not isinstance(sampled, SampledShots):
        sampled = gather_samples(sampled, progress)
    camera = as_profile(profile)
    if sampled is not None:
        require_same_provenance(camera, sampled.samples)
    share = 0.3 if sampled is None else 0.7
    with with_compilation(progress) as reporting:
        if sampled is None:
            page = build_report(camera, progress=part(reporting, 0.0, share))
        else:
            files = {} if isinstance(camera.provenance, Pictures) else sampled.files  # error maps need camera RAW
            named = with_setting_names(sampled.samples)
            page = build_report(camera, named, sampled.shots, files, part(reporting, 0.0, share))
    if output is not None:
        write_page(page, output, part(progress, share, 1.0))
    return page


def compare(
    first: CameraProfile | str | Path,
    second: CameraProfile | str | Path,
    output: str | Path,
    first_setting: str | None = None,
    second_setting: str | None = None,
    progress: Progress = silent,
) -> Report:
    """Write a page that shows two cameras, or two styles of one, side by side: a chart, ΔE00.

    first_setting, second_setting: STYLE/WB; by default the first style, under daylight or the first white balance.
    """
    check_report_output(output, [path for path in (first, second) if not isinstance(path, CameraProfile)])
    a = as_profile(first)
    b = as_profile(second)
    progress(f"{a.camera} and {b.camera}", 0.0)
    setting_a = first_setting or setting_of(a, next(iter(a.styles)))
    setting_b = second_setting or setting_of(b, next(iter(b.styles)))
    page = build_comparison(a, setting_a, b, setting_b)
    write_page(page, output, part(progress, 0.5, 1.0))
    return page


def check_report_output(output: str | Path | None, inputs: Sequence[str | Path] = ()) -> None:
    """Raise LutForgeError where the page cannot be written."""
    if output is not None:
        check_output(output, (".html", ".htm"), inputs)
