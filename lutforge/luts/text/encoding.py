"""The encoding of a LUT file's text: UTF-8, UTF-32, or UTF-16 with or without a byte order mark."""

import codecs


def decoded(data: bytes) -> tuple[str, str]:
    """The text of a file, and the problem with its encoding, or "". Raises UnicodeDecodeError on damaged text."""
    if data.startswith(codecs.BOM_UTF8):
        problem = "begins with a byte order mark, which OpenColorIO refuses: save it as UTF-8 without one"
        return data.decode("utf-8-sig", "replace"), problem
    if data.startswith((codecs.BOM_UTF32_LE, codecs.BOM_UTF32_BE)):  # the first begins as that of UTF-16
        return data.decode("utf-32"), "is text in UTF-32, which other programs do not read: save it as UTF-8"
    problem = "is text in UTF-16, which other programs do not read: save it as UTF-8"
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return data.decode("utf-16"), problem
    # UTF-16 without a byte order mark: every second byte of ASCII text is 0.
    if len(data) > 3 and data[1] == data[3] == 0 != data[0]:
        return data.decode("utf-16-le"), problem
    if len(data) > 3 and data[0] == data[2] == 0 != data[1]:
        return data.decode("utf-16-be"), problem
    return data.decode("utf-8", "replace"), ""
