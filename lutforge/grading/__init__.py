"""Grade images through OpenColorIO and OpenImageIO."""
