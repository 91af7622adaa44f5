"""Cells of CSV files with measured values, as spreadsheets, R and hands write them."""

from __future__ import annotations

import csv
import io
import math
import re
from typing import Dict, Iterator, List, Tuple

from . import Error
from ._user_file import read_text

_SEPARATORS = (",", ";", "\t", "|")
_LINE = re.compile(r"([^\r\n]*)(?:\r\n|\r|\n|\Z)")


class Cells:
    """Names of the columns, and the rows below them.

    Lines above the names may be empty, comments after "#", or Excel's line "sep=;". Commas, semicolons or tabs separate
    the cells. Rows of empty cells are left out.
    """

    def __init__(self, path: str) -> None:
        """Raises Error naming file, line and remedy."""
        self.path = path
        above, separator, text = _above_names(read_text(path))
        self._above = above
        self._reader = csv.reader(io.StringIO(text, newline=""), delimiter=separator)
        self.names = [name.strip() for name in self._next()]
        self.line = self._above + max(1, self._reader.line_num)
        """Line of the names."""
        twice = [name for name in self.names if name and self.names.count(name) > 1]
        if twice:
            raise Error(f"{path}:{self.line}: column {twice[0]!r} is there {self.names.count(twice[0])} times; keep one")

    def rows(self) -> Iterator[Tuple[int, Dict[str, str]]]:
        """Line, and stripped cells by the names of their columns, of each row. Raises Error as above."""
        while cells := self._next():
            line = self._above + self._reader.line_num
            if not any(cell.strip() for cell in cells):
                continue
            if len(cells) != len(self.names):
                names = len(self.names)
                raise Error(f"{self.path}:{line}: has {len(cells)} columns, and the first line has {names}; repair the line")
            yield line, {name: cell.strip() for name, cell in zip(self.names, cells)}

    def _next(self) -> List[str]:
        """Cells of the next line that is not empty; none at the end."""
        try:
            return next((cells for cells in self._reader if cells), [])
        except csv.Error as error:
            raise Error(f"{self.path}:{self._above + self._reader.line_num}: {error}; save it again as CSV") from None


def _above_names(text: str) -> Tuple[int, str, str]:
    """Number of lines above the names, the separator of the cells, and the text from the names on."""
    named = "none"
    for above, match in enumerate(_LINE.finditer(text)):
        line = match[1]
        if line.startswith("sep=") and len(line) <= len("sep=;"):
            named = line[len("sep=") :]
        elif line.strip() and not line.startswith("#"):
            return above, named if named in _SEPARATORS else _separator(line), text[match.start() :]
    return 0, ",", ""


def _separator(names: str) -> str:
    return next((one for one in ";\t" if one in names and "," not in names), ",")


def cell_number(where: str, name: str, text: str) -> float:
    """The finite number of a cell. Raises Error naming the place, the column and the value."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise Error(f"{where}: {name} is {text[:40]!r}; give a finite number with a decimal point")
    return value
