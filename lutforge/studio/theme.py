"""The page's looks: neutral greys, in which colours can be judged, dark or light; sizes that grow with the window."""

from typing import Any

_COMMON: dict[str, Any] = {
    "typography": {"fontFamily": "system-ui, sans-serif", "fontSize": 13, "h3": {"fontSize": "0.95rem"}},
    "shape": {"borderRadius": 4},
    "components": {
        "MuiButton": {
            "styleOverrides": {"root": {"textTransform": "none", "transition": "none"}},
            "defaultProps": {"disableElevation": True},
        },
        "MuiToggleButton": {
            "styleOverrides": {"root": {"textTransform": "none", "color": "inherit", "whiteSpace": "nowrap"}},
        },
        "MuiInputLabel": {
            "styleOverrides": {
                "root": {"transition": "none", "color": "inherit"},
                # On the border of its field at any size of letters; the toolkit's own 9 px are for letters of 16.
                "outlined": {"&.MuiInputLabel-shrink": {"transform": "translate(14px, -0.5625rem) scale(0.75)"}},
            },
        },
        # Inherited from the page, which changes its theme at once, where each control takes its own time.
        **{name: {"styleOverrides": {"root": {"color": "inherit"}}} for name in ("MuiTypography", "MuiInputBase")},
        "MuiSlider": {"styleOverrides": {"thumb": {"transition": "none"}, "track": {"transition": "none"}}},
        "MuiLinearProgress": {"defaultProps": {"aria-label": "Busy"}},
        "MuiAppBar": {
            "styleOverrides": {
                "root": {
                    "backgroundColor": "#1c1c1c", "backgroundImage": "none", "color": "#e6e6e6", "boxShadow": "none",
                    "borderBottom": "1px solid #4a4a4a",
                },
            },
        },
        "MuiDrawer": {"styleOverrides": {"paper": {"width": "max(280px, 17rem) !important"}}},
        "MuiStepLabel": {
            "styleOverrides": {
                "label": {"color": "#e6e6e6 !important"},
                "iconContainer": {"& .MuiIcon-root": {"color": "#e6e6e6 !important"}},
            },
        },
    },
}  # fmt: skip


def _palette(ink: str, quiet: str, faint: str, back: str, paper: str, error: str) -> dict[str, Any]:
    return {
        **_COMMON,
        "palette": {
            "primary": {"main": ink, "contrastText": back},
            "text": {"primary": ink, "secondary": quiet, "disabled": faint},
            "background": {"default": back, "paper": paper},
            "error": {"main": error},
        },
    }


THEME = {
    "dark": _palette("#e6e6e6", "#bdbdbd", "#a0a0a0", "#1c1c1c", "#262626", "#ff8a80"),
    "light": _palette("#1c1c1c", "#454545", "#666666", "#e8e8e8", "#f5f5f5", "#a11a0e"),
}

CSS = """
html { font-size: clamp(16px, 0.7vw, 26px) !important; }
body { background: #262626; color: #e6e6e6; font-family: system-ui, sans-serif; }
#first { position: fixed; inset: 0; z-index: -1; padding: 1.1rem 1.5rem; }
#first b { font-size: 1.4rem; display: block; margin-bottom: 1.5rem; }
"""

BESIDE = """
.sidebar { padding-top: 0.5rem; }
nav { width: max(290px, 17.6rem) !important; }
main.main { width: calc(100% - max(290px, 17.6rem)) !important; }
"""
"""The page beside its controls, whose width grows with the letters."""

TEMPLATE = """
{% extends "base.html" %}
{% block js_resources %}
{{ (bokeh_js or "")
   | replace('<script type="text/javascript" src', '<script defer type="text/javascript" src')
   | replace('Bokeh.set_log_level("info");', '') }}
{% endblock %}
{% block loader %}
<div id="first" aria-hidden="true"><b>LutForge studio</b>Opening …</div>
<div id="loader"><div class="spinner"></div><div id="loader-error"></div></div>
{% endblock %}
"""
"""The page as served: its scripts wait, so that something is painted before they are read."""
