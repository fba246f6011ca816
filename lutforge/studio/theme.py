"""The looks of the page: neutral greys, in which colours can be judged."""

from typing import Any

from lutforge.studio.ui import HERE


def _root(**style: Any) -> dict[str, Any]:
    return {"styleOverrides": {"root": style}}


# On the border of its field at any size of letters; the toolkit's own 9 px are for letters of 16.
OUTLINED = {"&.MuiInputLabel-shrink": {"transform": "translate(14px, -0.5625rem) scale(0.75)"}}
BAR = {"boxShadow": "none", "borderBottom": "1px solid #4a4a4a", "backgroundImage": "none"}
PRESENT = {"backgroundColor": "#3d3d3d", "borderRadius": "4px", "boxShadow": "inset 0 -3px #e6e6e6"}
"""The step that is seen, in the bar of all."""
LIGHT_TEXT = {"color": "#e6e6e6 !important"}
THEME = {
    "typography": {"fontFamily": "system-ui, sans-serif", "fontSize": 13, "h3": {"fontSize": "0.95rem"}},
    "shape": {"borderRadius": 4},
    "components": {
        "MuiButton": {**_root(textTransform="none", transition="none"), "defaultProps": {"disableElevation": True}},
        "MuiToggleButton": _root(textTransform="none", color="inherit", whiteSpace="nowrap"),
        "MuiInputLabel": {"styleOverrides": {"root": {"transition": "none", "color": "inherit"}, "outlined": OUTLINED}},
        "MuiFormLabel": _root(
            **{"& > strong": {"cursor": "text", "textDecoration": "underline dotted", "whiteSpace": "nowrap"}}
        ),
        "MuiSelect": {"styleOverrides": {"select": {"whiteSpace": "normal"}}},  # long choices wrap, and are not cut
        "MuiSlider": {"styleOverrides": {"thumb": {"transition": "none"}, "track": {"transition": "none"}}},
        "MuiLinearProgress": {"defaultProps": {"aria-label": "Busy"}},
        "MuiAppBar": _root(backgroundColor="#1c1c1c", color="#e6e6e6", **BAR),
        "MuiDrawer": {"styleOverrides": {"paper": {"width": "max(280px, 17rem) !important"}}},
        "MuiStepButton": _root(**{'&[aria-selected="true"]': PRESENT}),
        "MuiStepLabel": {"styleOverrides": {"label": LIGHT_TEXT, "iconContainer": {"& .MuiIcon-root": LIGHT_TEXT}}},
    },
    "palette": {
        "primary": {"main": "#e6e6e6", "contrastText": "#1c1c1c"},
        "text": {"primary": "#e6e6e6", "secondary": "#bdbdbd", "disabled": "#a0a0a0"},
        "background": {"default": "#1c1c1c", "paper": "#262626"},
        "error": {"main": "#ff8a80"},
    },
}

CSS = (HERE / "page.css").read_text(encoding="utf-8")

BESIDE = """
.sidebar { padding-top: 0.5rem; }
nav { width: max(290px, 17.6rem) !important; }
main.main { width: calc(100% - max(290px, 17.6rem)) !important; }
"""
"""The page beside its controls, whose width grows with the letters."""

TEMPLATE = (HERE / "page.html").read_text(encoding="utf-8")
"""The page as served: its scripts wait, so that something is painted before they are read."""
