"""The fits, a file per stage, named like the stage in lutforge.model."""
