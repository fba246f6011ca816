"""`lutforge identify`: which camera, style and white balance rendered a picture whose EXIF is gone."""

import json
from pathlib import Path
from typing import Annotated

from lutforge.cli.console import AsJson, argument, for_each, note, option, say


def identify(
    images: Annotated[list[Path], argument("Pictures that do not tell their camera.")],
    profiles: Annotated[list[Path], option("A folder of camera profiles, or a profile; may repeat.", "--profiles")],
    as_json: AsJson = False,
) -> None:
    """Tell by its pixels which camera, style and white balance rendered a picture, or that they do not tell."""
    from lutforge.pipeline.identification import identify as told_by
    from lutforge.pipeline.identification import known_cameras

    cameras = known_cameras(profiles)
    note(*cameras.left_out)
    records: list[dict[str, object]] = []

    def show(image: Path) -> None:
        judgement = told_by(image, cameras)
        if as_json:
            records.append({"image": str(image), **judgement.as_json()})
            return
        for number, line in enumerate(judgement.lines()):
            say(f"{image}: {line}" if number == 0 else f"  {line}")

    try:
        for_each("identifying", images, show)
    finally:
        if as_json:
            print(json.dumps(records, indent=2))
