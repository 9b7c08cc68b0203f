"""`fabricusd`: find the command, run it, and turn its result into an exit status.

The status is 0 when done, 1 for findings or for a bound that was not reached, 2 for bad input, and
130 when interrupted. Bad input is reported in one line on stderr. So is an error in fabricusd
itself, with status 2 as well; its line begins with "internal error", and FABRICUSD_DEBUG=1 shows a
traceback. Data goes to stdout, everything else to stderr.

To add a command, write a module in this folder with `EPILOG`, `add_arguments` and `run`, and add
its name to COMMANDS. Only the module of the command that is run is imported.
"""

from __future__ import annotations

import argparse
import sys
import traceback
import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
from importlib import import_module

from fabricusd import __version__
from fabricusd.cli.terminal.completion import SHELLS
from fabricusd.cli.terminal.parser import Parser
from fabricusd.cli.terminal.stdout import drop_stdout, ready_stdout
from fabricusd.cli.terminal.steps import shown
from fabricusd.errors import FabricError, FabricWarning, debugging, described, one_line
from fabricusd.host import MISSING
from fabricusd.partial_files import remove_own_partial_files
from fabricusd.stop import Stop

INTERNAL = "internal error"

COMMANDS = {
    "new": "make a fabric from a preset, a weave, an image or a WIF draft",
    "cat": "describe a fabric in a weaver's words, and draw its draft",
    "set": "change attributes of a fabric, by their names or by words of the trade",
    "dress": "put a fabric on garments, in a lit studio with a camera",
    "check": "find faults in fabrics, threads and bindings",
    "sides": "measure where a fabric's light goes, for the conserving model",
    "measure": "turn photographs of a thread into its lobes, and into the thread itself",
    "fit": "fit a thread to measured lobes, with intervals",
    "bake": "bake a fabric on a garment into textures",
    "material": "turn a bake into materials for USD, MaterialX and other tools",
    "blender-addon": "write the Blender add-on that imports materials with their garment",
    "render": "path-trace a scene for look-dev review",
    "preview": "show a fabric at once: on a shape, in the terminal, on a sheet",
    "compare": "measure the difference between two pictures",
    "chart": "measure and plot the speed and accuracy of every method",
    "cache": "list or clear the files that are cached on disk",
    "plugin-path": "print the folder to set PXR_PLUGINPATH_NAME to",
    "samples": "write a garment, a sky, artwork and drafts to try everything with",
    "demo": "write every preset into a folder, check it and print it",
}


def build_parser(command: str | None, *, whole: bool = False) -> argparse.ArgumentParser:
    """The parser, with the arguments of `command` only, or, if `whole`, of every command."""
    parser = Parser(
        prog="fabricusd",
        description="Woven cloth as USD prims: author, check, render, bake.",
        epilog="'fabricusd help COMMAND' describes a command, with examples.",
    )
    parser.add_argument("--version", action="version", version=f"fabricusd {__version__}")
    parser.add_argument(
        "--print-completion",
        choices=SHELLS,
        help="print the script that completes command lines in this shell, and exit: "
        'eval "$(fabricusd --print-completion bash)"',
    )
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name, line in COMMANDS.items():
        if name != command and not whole:
            commands.add_parser(name, help=line, add_help=False)
            continue
        module = import_module(f"fabricusd.cli.{name.replace('-', '_')}")
        one = commands.add_parser(
            name,
            help=line,
            description=line[0].upper() + line[1:] + ".",
            epilog=module.EPILOG,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        module.add_arguments(one)
        volume = one.add_mutually_exclusive_group()
        volume.add_argument("-q", "--quiet", action="store_true", help="print errors only")
        volume.add_argument("-v", "--verbose", action="store_true", help="print more messages")
        one.set_defaults(run=module.run)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    if given and given[0] == "help":
        # `help COMMAND` is `COMMAND --help`; `help` alone lists the commands.
        given = [*given[1:2], "--help", *given[2:]]
    command = next((word for word in given if word in COMMANDS), None)
    if command is None and given[:1] == ["--print-completion"] and given[1:2] != []:
        return _print_completion(given)
    parser = build_parser(command)
    options, unknown = parser.parse_known_args(given)
    if unknown:
        # argparse itself would refer to the help that lists the commands.
        commands = parser._subparsers._group_actions[0].choices  # type: ignore[union-attr]
        commands[command].refuse_unknown(unknown)  # type: ignore[index]
    ready_stdout()
    warnings.formatwarning = _format_warning
    return _guarded(lambda: _run(options))


def _run(options: argparse.Namespace) -> int:
    """Run a command whose long steps are shown."""
    with shown(quiet=options.quiet):
        return int(options.run(options))


def _print_completion(given: list[str]) -> int:
    """Print the script for the shell in `given`, and return the exit status."""
    from fabricusd.cli.terminal.completion import script

    parser = build_parser(None, whole=True)
    # A command is needed, but only to be parsed.
    shell = parser.parse_args([*given, "cache"]).print_completion
    ready_stdout()

    def run() -> int:
        print(script(parser, shell))
        return 0

    return _guarded(run)


def _guarded(run: Callable[[], int]) -> int:
    """Run a command, and turn whatever it raises into a line and an exit status."""
    try:
        with Stop():
            status = run()
            sys.stdout.flush()
            return status
    except KeyboardInterrupt:
        # The interrupt may have come before the code that removes a partial file was entered.
        remove_own_partial_files()
        _say("interrupted")
        return 130
    except Exception as error:
        if debugging():
            traceback.print_exc()
        return _status_of(error)


_python_format = warnings.formatwarning


def _format_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    line: str | None = None,
) -> str:
    """One line for a warning of fabricusd's; any other with its place, as Python prints it."""
    if issubclass(category, FabricWarning):
        return f"fabricusd: {one_line(str(message))}\n"
    return _python_format(message, category, filename, lineno, line)


def _status_of(error: Exception) -> int:
    """Report in one line what a command raised, and return the status for it."""
    if isinstance(error, FabricError):
        return refused(str(error))
    if isinstance(error, ModuleNotFoundError) and error.name == "pxr":
        return refused(MISSING)
    if isinstance(error, BrokenPipeError):
        # The reader of the output, such as `head`, has closed it.
        drop_stdout()
        return 0
    if isinstance(error, OSError):
        drop_stdout()
        where = error.filename or "the output"
        return refused(f"{where} cannot be read or written: {error.strerror or described(error)}")
    if isinstance(error, MemoryError):
        return refused("there is not enough memory for that")
    hint = "" if debugging() else " with the traceback that FABRICUSD_DEBUG=1 shows"
    return refused(f"{INTERNAL}: {described(error)}; please report it{hint}")


def refused(line: str) -> int:
    """Report what was refused, and return the status for it."""
    _say(line)
    return 2


def _say(line: str) -> None:
    # The terminal may have been closed.
    with suppress(OSError, ValueError):
        print(f"fabricusd: {one_line(line)}", file=sys.stderr)
