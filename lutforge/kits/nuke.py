"""Nuke: a CLF from ACEScg to ACEScg and a node that reads it."""

from dataclasses import dataclass
from pathlib import Path

from lutforge.kits.kit import Kit, Look, Source
from lutforge.luts.bake import bake


@dataclass(frozen=True)
class NukeKit(Kit):
    """An OCIOFileTransform between ACEScg and ACEScg."""

    program: str = "nuke"
    title: str = "Nuke"
    source: Source = "any"
    tried: str = "the CLF in OpenColorIO; Nuke itself was not run"

    def write(self, look: Look, folder: Path) -> list[str]:
        """Write the CLF and the node."""
        name = f"{look.file_name} acescg.clf"
        bake(look.within("acescg"), folder / name, display_referred=False, title=look.title)
        node = (
            "OCIOFileTransform {\n"
            f' file "\\[file dirname \\[value root.name]]/{name}"\n'
            " interpolation tetrahedral\n"
            f' label "{look.title.translate(str.maketrans("", "", chr(34) + chr(92) + "[]{}"))}"\n'
            "}\n"
        )
        (folder / "look.nk").write_text(node, encoding="utf-8", newline="\n")
        return [
            f'Lay "{name}" beside your script, and paste look.nk into the node graph.',
            "The node takes and gives scene-linear ACEScg, as an ACES project's working space is.",
        ]
