"""A picture, graded where it is looked at."""

from lutforge.studio.look.view import LookView

__all__ = ["LookView"]
