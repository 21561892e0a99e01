"""Whether a file or folder can be written, asked before the work whose result it will hold."""

import tempfile
from pathlib import Path

from mtcsirl.errors import UserError


def check_folder(folder: Path | str) -> None:
    """Raise UserError, one line, where ``folder`` is no folder or nothing can be written into it; leaves nothing."""
    folder = Path(folder)
    there = folder.absolute()
    while not there.exists() and not there.is_symlink():
        there = there.parent
    if not there.is_dir():
        raise UserError(f"{folder}: {there} is a file, not a folder; choose another place")
    try:
        with tempfile.TemporaryFile(dir=there) as probe:
            probe.write(b"\0" * 4096)
            probe.flush()
    except OSError as error:
        raise UserError(f"{folder}: cannot be written ({error.strerror}); make room or choose another place") from error


def check_file(file: Path | str) -> None:
    """Raise UserError, one line, where ``file`` cannot be written or replaced."""
    file = Path(file)
    if file.exists() and not file.is_file():
        raise UserError(f"{file}: is no ordinary file; choose another name")
    check_folder(file.parent)
