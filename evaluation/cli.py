"""The command line `piec`.

Every command ends with where it wrote its results. With --json the standard output is one JSON
document; progress and messages go to the standard error. Exit codes: 0 done, 2 bad input, 130
interrupted.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import sys
from collections.abc import Sequence

from evaluation.commands import COMMANDS, Command, Report
from piec_envs.errors import PiecError

EPILOG = "piec COMMAND --help shows an example of each command."


def make_parser() -> argparse.ArgumentParser:
    """The parser of all commands."""
    parser = argparse.ArgumentParser(
        prog="piec",
        description="Whole-arm caging: plan, disturb, measure, draw.",
        epilog=EPILOG,
    )
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for command in COMMANDS.values():
        _add_command(commands, command)
    return parser


def _add_command(commands, command: Command) -> None:
    examples = "".join(f"  {line}\n" for line in command.examples)
    parser = commands.add_parser(
        command.name,
        help=command.help,
        description=command.help[0].upper() + command.help[1:] + ".",
        epilog=f"examples:\n{examples}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--json", action="store_true", help="print one JSON document on the standard output")
    command.load().add_arguments(parser)


def _print(report: Report, as_json: bool) -> None:
    wrote = [str(path) for path in report.wrote]
    if as_json:
        from evaluation.records import to_json

        print(json.dumps({**to_json(report.data), "wrote": wrote}, indent=2, allow_nan=False))
        return
    if report.text:
        print(report.text.rstrip())
    for path in wrote:
        print(f"wrote {path}")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command.

    Args:
        arguments: of the command line; None takes those of this process.

    Returns:
        The exit code.
    """
    args = make_parser().parse_args(arguments)
    try:
        with contextlib.redirect_stdout(sys.stderr):  # whatever is printed on the way is no result
            report = COMMANDS[args.command].load().run(args)
    except (PiecError, OSError) as error:
        message = " ".join(str(error).split())
        print(f"piec {args.command}: error: {message}", file=sys.stderr)
        if args.json:
            print(json.dumps({"error": message}))
        return 2
    except KeyboardInterrupt:
        print(f"piec {args.command}: interrupted; what is recorded is kept", file=sys.stderr)
        return 130
    _print(report, args.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
