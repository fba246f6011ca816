"""The exact inverse of a baked render: the RAW that the camera renders to a given JPEG colour."""
