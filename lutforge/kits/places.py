"""Where programs look for camera profiles, presets and LUTs, on Linux, macOS and Windows."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Machine:
    """The facts that decide where files go. system: `sys.platform`; environment: variables; home: the user's folder."""

    system: str
    environment: Mapping[str, str]
    home: Path

    def variable(self, name: str, default: Path) -> Path:
        """The folder in an environment variable, if that holds an absolute path, else the default."""
        value = Path(self.environment.get(name, ""))
        return value if value.is_absolute() else default

    @property
    def settings(self) -> Path:
        """The folder of settings, for programs that follow the conventions of Linux."""
        if self.system == "win32":
            return self.variable("LOCALAPPDATA", self.home / "AppData" / "Local")
        return self.variable("XDG_CONFIG_HOME", self.home / ".config")

    @property
    def application_support(self) -> Path:
        """The folder of settings, for programs that follow the conventions of each system."""
        if self.system == "darwin":
            return self.home / "Library" / "Application Support"
        if self.system == "win32":
            return self.variable("APPDATA", self.home / "AppData" / "Roaming")
        return self.settings


@dataclass(frozen=True)
class Place:
    """A program's folder on a machine.

    commands: names of the program's executables, and settings: its folder; either shows that it is installed; None
    where it has no folder on this system. folders: the subfolders of `settings`, by suffix of the files that go there;
    whole: the subfolders that receive all of the kit's folder `ocio`. use: what the user does after the installation.

    has_folder: False for a program that looks for files nowhere, on no system. LutForge then keeps them in a folder of
    its own, from which the user chooses them in the program's window.
    """

    commands: tuple[str, ...]
    settings: Path | None
    folders: Mapping[str, str]
    use: str
    whole: tuple[str, ...] = ()
    has_folder: bool = True


def place_of(program: str, machine: Machine) -> Place:
    """The place of a kit's program; of an unknown program one without a folder."""
    system, home, support = machine.system, machine.home, machine.application_support
    match program:
        case "darktable":
            # https://docs.darktable.org/usermanual/stable/en/special-topics/program-invocation/darktable/, --configdir
            settings = machine.settings
            folders = {".icc": "color/in", ".dtstyle": "styles/LutForge", ".xmp": "styles/LutForge"}
            use = (
                "lighttable → history stack → load sidecar file: the .xmp; or styles → import: the .dtstyle, which can "
                "then be applied to many photographs"
            )
            return Place(("darktable", "darktable-cli"), settings / "darktable", folders, use)
        case "rawtherapee" | "art":
            # https://rawpedia.rawtherapee.com/File_Paths; both take their folder from a variable, too.
            name, variable = ("RawTherapee", "RT_SETTINGS") if program == "rawtherapee" else ("ART", "ART_SETTINGS")
            default = support / name / "config" if system == "darwin" else machine.settings / name
            folders = dict.fromkeys((".pp3", ".dcp", ".icc"), "profiles/LutForge")
            use = "the processing profile is in the list of profiles, under LutForge"
            if program == "art":
                use = "Color Management → Input Profile → Custom: the .dcp or the .icc"
            commands = (name, f"{name}-cli", name.lower(), f"{name.lower()}-cli")
            return Place(commands, machine.variable(variable, default), folders, use)
        case "lightroom":
            # https://helpx.adobe.com/camera-raw/kb/camera-raw-plug-in-installer.html
            adobe = None if system == "linux" else support / "Adobe" / "CameraRaw"
            return Place((), adobe, {".dcp": "CameraProfiles"}, "start the program again, and choose the profile")
        case "captureone":
            colorsync = home / "Library" / "ColorSync" if system == "darwin" else None
            return Place((), colorsync, {".icc": "Profiles"}, "Base Characteristics → ICC Profile → Show All → Other")
        case "resolve":
            program_data = machine.variable("PROGRAMDATA", Path("C:/ProgramData"))
            folders_of_systems = {
                "darwin": Path("/Library/Application Support/Blackmagic Design/DaVinci Resolve"),
                "win32": program_data / "Blackmagic Design" / "DaVinci Resolve" / "Support",
            }
            on_linux = machine.variable("XDG_DATA_HOME", home / ".local" / "share") / "DaVinciResolve"
            resolve = folders_of_systems.get(system, on_linux)
            return Place(("resolve",), resolve, {".cube": "LUT/LutForge"}, "Project settings → Update lists")
        case "nuke":
            return Place(("nuke",), home / ".nuke", {".clf": "LutForge"}, "a node OCIOFileTransform with the file")
        case "blender":
            # Blender prefers a folder "colormanagement" in the user's datafiles of its version to its own.
            below = {"darwin": "Blender", "win32": "Blender Foundation/Blender"}
            folder = support / below.get(system, "blender")
            versions = sorted(path.name for path in folder.glob("[0-9]*.[0-9]*") if path.is_dir())
            use = "start Blender again: it shows every file by this config, until it is taken away"
            return Place((), folder, {}, use, tuple(f"{version}/datafiles/colormanagement" for version in versions))
        case _:
            return Place((), None, {}, "chosen in the program's window", has_folder=False)
