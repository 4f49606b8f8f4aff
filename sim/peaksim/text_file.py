"""Reading text files from outside: UTF-8 with or without the byte order mark that Windows writes, of limited size."""

from pathlib import Path

from peaksim.errors import InputError


def read_text(file: Path, largest: int, kind: type[InputError] = InputError) -> str:
    """Return a text file's content without its byte order mark.

    Raises
    ------
    InputError
        One line that names the file, of the given `kind`: it is missing, has more than `largest` bytes, or is no UTF-8.
    """
    try:
        with file.open("rb") as opened:
            content = opened.read(largest + 1)
    except OSError as error:
        raise kind(f"{file}: cannot be read: {error.strerror or error}") from error
    if len(content) > largest:
        raise kind(f"{file}: expected a file of at most {largest} bytes")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise kind(f"{file}: is not a text file in UTF-8: {error.reason} at byte {error.start}") from error
