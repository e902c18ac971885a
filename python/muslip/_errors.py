"""The one exception of the package."""

from __future__ import annotations


class MuslipError(Exception):
    """Input that cannot be used; ``str()`` is the line that the command prints.

    Attributes
    ----------
    file : str or None
        The file, or the name that stands for a frame.
    line, column : int or None
        Where in it, from 1; of a frame, the row and the column.
    channel : str or None
        The channel that it is about.
    """

    file: str | None
    line: int | None
    column: int | None
    channel: str | None

    def __init__(
        self,
        message: str,
        file: str | None = None,
        line: int | None = None,
        column: int | None = None,
        channel: str | None = None,
    ) -> None:
        super().__init__(message, file, line, column, channel)
        self.file, self.line, self.column, self.channel = file, line, column, channel

    def __str__(self) -> str:
        return str(self.args[0])
