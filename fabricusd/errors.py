"""The one exception that a caller of fabricusd has to catch."""

from __future__ import annotations


def one_line(text: str, longest: int = 600) -> str:
    """`text` on one line of at most `longest` characters, `?` for what would not print.

    What libraries say of a damaged file holds line ends and bytes of that file.
    """
    line = "".join(c if c.isprintable() else "?" for c in " ".join(text.split()))
    return line if len(line) <= longest else line[: longest - 3] + "..."


class FabricError(ValueError):
    """Input that cannot be used: where it is, what it holds, what would be accepted.

    Commands print it as one line and leave with status 2.
    """

    def __init__(self, where: str, problem: str) -> None:
        self.where = where
        self.problem = problem
        super().__init__(f"{where} {problem}" if where else problem)

    def inside(self, where: str) -> FabricError:
        """The same problem, with `where` put before its place."""
        return FabricError(f"{where} {self.where}".strip(), self.problem)
