"""The commands that make profiles and report on them, from files to pages; each imports its use case when it runs."""

import json
import signal
import sys
from collections.abc import Iterable
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import lutforge as lf
from lutforge.boundary import require_file
from lutforge.cli.console import Profile, argument, for_each, note, option, print_tables, progress_bar, say
from lutforge.errors import LutForgeError, ProfileError, SettingsError
from lutforge.reports.tables import TITLES, Table, error_table, held_out_table, more_tables, response_table

if TYPE_CHECKING:
    from lutforge.pipeline.response import FittedResponse
    from lutforge.pipeline.sampling import SampledShots

ProfileOutput = Annotated[
    Path | None, option("The profile to write (.npz).", "-o", "--output", show_default="camera.npz, if it is new")
]
DevelopedFolder = Annotated[
    Path | None, option("A folder of pictures that another program developed, one a shot, same stem.")
]
DevelopedSpace = Annotated[
    str | None, option("The colour space of those pictures, such as prophoto.", "--developed-space")
]


def inspect(
    files: Annotated[list[Path], argument("RAW files, pictures, sample tables, profiles, LUTs, and folders of them.")],
    scene: Annotated[
        Path | None,
        option("Compare shots with a profile's rendering: what the camera did beyond it, in stops.", metavar="PROFILE"),
    ] = None,
) -> None:
    """Show what files are: a shot's or picture's camera and settings, what a profile, table or LUT holds."""
    from lutforge.pipeline import inspection

    if scene is not None:
        from lutforge.pipeline.evaluation import inspect_scene

        with progress_bar("sampling") as progress:
            table, notes = inspect_scene(scene, files, progress)
        print_tables(table)
        note(*notes)
        return

    def show(file: Path) -> None:
        content = inspection.inspect(file)
        say(*content.lines)
        if content.rows:
            print_tables(Table(str(file), ("", ""), content.rows))
        if content.profile is not None:
            print_tables(held_out_table(content.profile))

    for_each("inspecting", [file for path in files for file in inspection.files_to_inspect(path)], show)


def check(luts: Annotated[list[Path], argument("LUT files of any origin.")]) -> None:
    """Show what LUT files hold, which programs read them, and which misread them."""
    from lutforge.pipeline import inspection

    for_each("checking", luts, lambda path: say(*inspection.check(path)))


def sample(
    shots: Annotated[list[Path], argument("RAW files, or folders of them.")],
    output: Annotated[
        Path | None, option("A .csv or .npz table.", "-o", "--output", show_default="samples.csv, if it is new")
    ] = None,
    reference: Annotated[
        Path | None,
        option("For JPEGs of a camera without RAW: another camera's RAW files of the same scenes, a folder."),
    ] = None,
    chart: Annotated[
        str, option("The shots show this chart: classic, classic2014 or sg. Its patches are sampled, too.")
    ] = "",
    developed: DevelopedFolder = None,
    developed_space: DevelopedSpace = None,
) -> None:
    """Turn RAW files (with their embedded preview, or a JPEG beside them) into a table of colour samples."""
    from lutforge.pipeline.outputs import TABLE_SUFFIXES, check_output, named_or_new
    from lutforge.pipeline.pairing import raw_substitute
    from lutforge.pipeline.sampling import sample_by_reference, sample_shots

    output = check_output(named_or_new(output, "samples.csv"), TABLE_SUFFIXES, shots)
    if chart and reference is not None:
        raise SettingsError("--chart is searched for in RAW shots; leave it out, or --reference")
    with progress_bar("sampling") as progress:
        if reference is not None:
            sampled = sample_by_reference(shots, reference, progress)
        else:
            sampled = sample_shots(shots, progress, raw_substitute(developed, developed_space), chart)
    print_shots(sampled)
    sampled.samples.save(output)
    say(f"{output}: {len(sampled.samples)} samples of {len(sampled.shots)} shot{'s' * (len(sampled.shots) != 1)}")


def print_shots(sampled: "SampledShots") -> None:
    """Print the summary of each shot, the notes that shots share, and the shots that were left out."""
    from lutforge.pipeline.sampling import file_notes

    for shot in sampled.shots:
        say(shot.summary)
    note(*file_notes(sampled.shots))
    for reason in sampled.left_out:
        note(f"left out: {reason}")


def calibrate(
    sources: Annotated[
        list[Path] | None, argument("Sample tables (.csv, .npz), RAW files, folders of RAW files.")
    ] = None,
    output: ProfileOutput = None,
    preset: Annotated[str, option("lutforge; or thesis: the published method.")] = "lutforge",
    size: Annotated[int, option("Nodes per axis of the lattices, 3 to 65.")] = 33,
    interpolation: Annotated[str, option("trilinear or tetrahedral: what will read the LUT.")] = "trilinear",
    uniform: Annotated[bool, option("Keep the node levels evenly spaced.", "--uniform")] = False,
    developed: DevelopedFolder = None,
    developed_space: DevelopedSpace = None,
    pairs: Annotated[
        tuple[Path, Path] | None, option("Instead of shots, two folders: the same frames before and after, same stems.")
    ] = None,
    from_space: Annotated[str, option("The colour space of the first folder of --pairs.", "--from-space")] = "srgb",
) -> None:
    """Calibrate a camera, and print the error on shots that were held out."""
    from lutforge.pipeline.outputs import PROFILE_SUFFIXES, check_output, named_or_new
    from lutforge.pipeline.pairing import raw_substitute, sample_pairs
    from lutforge.pipeline.sampling import gather_samples
    from lutforge.thesis.options import options_of_preset

    output = check_output(named_or_new(output, "camera.npz"), PROFILE_SUFFIXES, sources or ())
    options = options_of_preset(preset, size=size, interpolation=interpolation, nonuniform=not uniform)
    if pairs is not None and sources:
        raise SettingsError("give --pairs or shots, not both")
    with progress_bar("sampling") as progress:
        if pairs is not None:
            sampled = sample_pairs(*pairs, from_space, progress)
        else:
            sampled = gather_samples(sources or [], progress, raw_substitute(developed, developed_space))
    print_shots(sampled)
    with progress_bar("calibrating") as progress:
        profile = lf.calibrate(sampled.samples, options, progress)
    note(*map(str, profile.diagnoses), *profile.notes)
    print_tables(held_out_table(profile))
    profile.save(output)
    shots = "1 shot" if len(profile.shots) == 1 else f"{len(profile.shots)} shots"
    say(f"{output}: {profile.camera}, {len(sampled.samples)} samples of {shots}")
    say(f"styles: {', '.join(profile.styles)}; white balances: {', '.join(profile.white_balances)}")


def response(
    bracket: Annotated[list[Path], argument("Pictures of one still scene, or a folder of them.")],
    output: ProfileOutput = None,
    times: Annotated[str | None, option("Exposure times in the order of the files, such as 1/60,1/30,1/15.")] = None,
    camera: Annotated[str, option("The camera's name, where the files do not state it.")] = "",
    all_colours: Annotated[
        bool, option("Count saturated colours, too: for a scene without neutral ones.", "--all-colours")
    ] = False,
    chart: Annotated[
        str | None,
        option(
            "The scene shows this chart: classic, classic2014, sg, spyder24 or spyder48. "
            "The whole rendering is calibrated on its colours."
        ),
    ] = None,
    light: Annotated[str | None, option("The light on the chart: 5500K, D55, A, LED-B3 …", show_default="D50")] = None,
    corners: Annotated[
        str | None, option('The chart\'s outer corners in pixels, clockwise from the first patch: "x,y x,y x,y x,y".')
    ] = None,
) -> None:
    """Find the response of a camera without RAW from one scene at several exposures, and how exact these were."""
    from lutforge.pipeline.outputs import named_or_new
    from lutforge.pipeline.response_request import ResponseRequest

    output = named_or_new(output, "camera.npz")
    request = ResponseRequest(
        files=tuple(bracket),
        times=times or "",
        camera=camera,
        all_colours=all_colours,
        chart=chart or "",
        light=light or "",
        corners=corners or "",
    )
    if request.is_one_picture:
        with progress_bar("response") as progress:
            approximate = request.approximate(output, progress)
        profile = approximate.profile
        selector = f"{next(iter(profile.styles))}/{next(iter(profile.white_balances))}"
        say(f"{output}: {profile.camera}, {selector}", *approximate.notes)
        say(f"next: lutforge bake {output} linearize --from {selector} --space aces2065-1 -o input.clf")
        return

    with progress_bar("response") as progress:
        fitted = request.fit(output, progress)
    _print_response(fitted, output, searched=corners is None)


def _print_response(fitted: "FittedResponse", output: Path, searched: bool) -> None:
    """Print a fitted response, the errors of the exposures, and the next command. searched: for a chart."""
    from lutforge.model.provenance import Chart

    fit = fitted.fit
    profile = fitted.profile
    exposures = fitted.exposure_s
    samples = fitted.samples
    (selector,) = (f"{style}/{balance}" for style in profile.styles for balance in profile.white_balances)
    least = min(exposures.values())
    error = fit.exposure_error
    on_error, on_range = fit.statements
    columns: dict[str, Iterable[str]] = {
        "shot": exposures,
        "stated, relative": [f"{time / least:.4g}" for time in exposures.values()],
        "true / stated": [f"{error[name]:.3f}" if name in error else "–" for name in exposures],
    }
    if samples is not None and isinstance(profile.provenance, Chart):
        say(f"{output}: {profile.camera}, {selector}, of the {profile.provenance.lit}")
        used = {name: str(len(rows)) for name, rows in samples.by_shot()}
        columns = {
            "shot": exposures,
            "chart": ["found" if name in fitted.found else "" for name in exposures],
            "patches used": [used.get(name, "0") for name in exposures],
        } | columns
        columns["white beside the chart"] = [f"{fitted.level[name]:.3g}" for name in exposures]
    else:
        say(f"{output}: {profile.camera}, {selector}", on_error)
        print_tables(response_table(fit))
    print_tables(Table("Exposures", list(columns), list(zip(*columns.values(), strict=True))))

    if samples is None:
        say(on_range)
    elif searched and (missed := ", ".join(name for name in exposures if name not in fitted.found)):
        note(f"the chart was not found in {missed}: its place in the nearest exposure was taken; see --corners")
    say(fit.verdict.words)
    if not fit.verdict.fixed:
        note("fix exposure mode, white balance and picture style, and switch off what adapts to the scene (HDR, DRO)")

    options = "-o linear.cube"
    if samples is not None:
        note(*profile.notes)
        print_tables(held_out_table(profile))
        options = "--space aces2065-1 -o input.clf"
    say(f"next: lutforge bake {output} linearize --from {selector} {options}")


def transfer(
    source: Annotated[Path, argument("The first camera's samples, RAW file or folder.")],
    target: Annotated[Path, argument("The other camera's, of the same charts.")],
    output: Annotated[Path, option("The transfer to write (.json).", "-o", "--output")],
) -> None:
    """Fit RAW → RAW between two cameras from charts that both photographed, for apply --as and bake match."""
    from lutforge.pipeline.calibration import write_transfer

    with progress_bar("sampling") as progress:
        common, fitted = write_transfer(source, target, output, progress, lambda sampled: note(*sampled.left_out))
    say(f"{output}: {fitted.source} to {fitted.target}, from {common} common colours")
    say(f"  held-out error, relative: {fitted.error:.2%}")


def evaluate(
    profile: Profile,
    sources: Annotated[list[Path], argument("Sample tables (.csv, .npz), RAW files, folders of RAW files.")],
    tables: Annotated[
        bool,
        option(
            "All methods of the thesis's tables, with times: radial basis functions, uniform and nonuniform "
            "lattices of 13, 17 and 24 nodes. Takes a minute or more.",
            "--tables",
        ),
    ] = False,
    as_json: Annotated[bool, option("Print everything as JSON, for programs.", "--json")] = False,
) -> None:
    """Print the errors of a profile on samples, beside plain baselines.

    A shot that the profile was calibrated from is left out and predicted by a refit without it; any other is predicted
    by the profile as it is. Printed are the error of both directions, the RMSE of RAW, the linearization error over
    exposure pairs, and the error of refinishing between settings of one scene, where the shots show these.
    """
    from lutforge.pipeline.sampling import gather_samples

    camera = lf.load_profile(profile)
    with progress_bar("sampling") as progress:
        sampled = gather_samples(sources, progress)
    if not as_json:
        print_shots(sampled)
    with progress_bar("evaluating") as progress:
        evaluation = lf.evaluate(camera, sampled.samples, progress, tables=tables)
    note(*evaluation.notes)
    if as_json:
        json.dump(evaluation.as_json(), sys.stdout, indent=1, ensure_ascii=False, allow_nan=False)
        sys.stdout.write("\n")
        return
    for direction, title in TITLES.items():
        rows = [row for row in evaluation.rows if row.direction == direction]
        print_tables(error_table(f"{title}: error (1 = full scale)", rows))
    print_tables(*more_tables(evaluation))


def report(
    profile: Profile,
    sources: Annotated[
        list[Path] | None, argument("What it was calibrated from: sample tables, RAW files, folders.")
    ] = None,
    output: Annotated[Path, option("The page to write (.html).", "-o", "--output")] = Path("report.html"),
) -> None:
    """Write a report that needs no network: curves, maps and tables of a profile.

    With samples, the errors held out by shot and what to shoot next; with RAW files, error maps of real shots too.
    """
    from lutforge.pipeline.reports import check_report_output
    from lutforge.pipeline.sampling import gather_samples

    check_report_output(output, [profile, *(sources or [])])
    camera = lf.load_profile(profile)
    sampled = None
    if sources:
        with progress_bar("sampling") as progress:
            sampled = gather_samples(sources, progress)
        print_shots(sampled)
    with progress_bar("reporting") as progress:
        page = lf.report(camera, sampled, output, progress)
    say(f"{output}: {len(page.pictures)} figures, {output.stat().st_size / 1e6:.1f} MB")


def compare(
    first: Profile,
    second: Annotated[Path | None, argument("Another profile (.npz).", show_default="the first")] = None,
    output: Annotated[Path, option("The page to write (.html).", "-o", "--output")] = Path("compare.html"),
    first_setting: Annotated[
        str | None, option("STYLE/WB of the first profile; unless given, the first in it.", "--from")
    ] = None,
    second_setting: Annotated[
        str | None, option("STYLE/WB of the second; unless given, the first in it.", "--to")
    ] = None,
) -> None:
    """Show what two cameras, or two styles of one, make of the same light: a chart, ΔE00."""
    from lutforge.pipeline.reports import compare as write_comparison

    with progress_bar("comparing") as progress:
        page = write_comparison(first, second or first, output, first_setting, second_setting, progress)
    say(f"{output}: {page.title}")
    say(*page.lead)


def import_nus(
    folders: Annotated[list[Path], argument("Folders that hold raw2jpg_transform.txt.")],
    output: ProfileOutput = None,
    camera: Annotated[str, option("The camera's name; needed where their folder is not nus_MAKE_MODEL.")] = "",
    style: Annotated[str, option("The picture style that the folders are of.")] = "standard",
) -> None:
    """Read the thesis authors' model folders (response, matrix, white balances, gamut map) into a profile."""
    from lutforge.pipeline.outputs import PROFILE_SUFFIXES, check_output, named_or_new

    output = check_output(named_or_new(output, "camera.npz"), PROFILE_SUFFIXES)
    profile = lf.import_published(folders, camera, style.lower())
    profile.save(output)
    centres = sum(len(model.gamut_map.centres) for model in profile.styles[style.lower()].models)
    say(f"{output}: {profile.camera}, style {style.lower()}, {centres} control points")
    say(f"white balances: {', '.join(profile.white_balances)}")


def export_nus(
    profile: Profile,
    output: Annotated[Path, option("The folder to write.", "-o", "--output")],
    style: Annotated[str | None, option("The picture style, where there are several.")] = None,
) -> None:
    """Write a profile's camera models as the thesis authors' text files, a folder each, which import-nus reads."""
    from lutforge.model.published_model import export_published

    camera = lf.load_profile(profile)
    name = (style or (next(iter(camera.styles)) if len(camera.styles) == 1 else "")).lower()
    if name not in camera.styles:
        raise ProfileError(f"{camera.camera} has the styles {', '.join(camera.styles)}; name one with --style")
    for folder in export_published(camera, name, output):
        say(f"{folder}")


def studio(
    sources: Annotated[
        list[Path] | None, argument("A sample table, shots or folders of them, a profile, a workspace.")
    ] = None,
    port: Annotated[int, option("The port of the page; 0 for any that is free.", min=0, max=65535)] = 5006,
    address: Annotated[str, option("Where to listen; other than 127.0.0.1 others may connect.")] = "127.0.0.1",
    folder: Annotated[
        list[Path] | None,
        option("A folder that may be read and written; may repeat. By default the inputs' and this one."),
    ] = None,
    show: Annotated[bool, option("Open the page in a browser.", "--show/--no-browser")] = True,
) -> None:
    """Look at samples, mark outliers, fit models and preview refinishing in the browser; stop it with Ctrl+C."""
    if find_spec("panel") is None:
        raise LutForgeError("the studio needs Panel: pip install 'lutforge[studio]'")
    from lutforge.studio.opening import Folders
    from lutforge.studio.server import serve

    inputs = tuple(path.resolve() for path in sources or [])
    for path in inputs:
        if not path.is_dir():
            require_file(path, "a sample table, shot, profile or workspace")
    folders = folder or [Path.cwd(), *(path if path.is_dir() else path.parent for path in inputs)]
    signal.signal(signal.SIGINT, signal.default_int_handler)  # the server ends by its KeyboardInterrupt
    serve(Folders(folders), inputs, address, port, show, lambda url: say(f"LutForge studio: {url}"))
