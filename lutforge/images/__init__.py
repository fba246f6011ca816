"""Image files, read and written: pictures by OpenImageIO, JPEG by libjpeg-turbo, RAW files by LibRaw."""
