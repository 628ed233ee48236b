"""The command line `piec`.

Every command ends with where it wrote its results. With --json the standard output is one JSON
document; progress and messages go to the standard error, bars only if it is a terminal, and neither
with --quiet. Exit codes: 0 done, 2 bad input, 130 interrupted.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import sys
from collections.abc import Iterator, Sequence

from evaluation.commands import COMMANDS, Command, Interrupted, Report
from piec_envs import PiecError, __version__, console

EPILOG = "piec COMMAND --help shows an example of each command."


QUIET = "no progress and no notes, only results and errors"


class _Version(argparse.Action):
    """Looks for the commit only if asked."""

    def __init__(self, option_strings: Sequence[str], dest: str, help: str | None = None):
        super().__init__(option_strings, dest, nargs=0, help=help)

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        from evaluation.reuse import commit_of
        from piec_envs import provenance

        print(f"piec-envs {__version__} ({commit_of({'source': provenance.source()})})")
        parser.exit()


def make_parser() -> argparse.ArgumentParser:
    """The parser of all commands."""
    parser = argparse.ArgumentParser(
        prog="piec",
        description="Whole-arm caging: plan, disturb, measure, draw.",
        epilog=EPILOG,
    )
    parser.add_argument("--version", action=_Version, help="print version and commit, and exit")
    parser.add_argument("--quiet", action="store_true", help=QUIET)
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
    parser.add_argument(
        "--json", action="store_true", help="print one JSON document on the standard output"
    )
    # Before and behind the command; the default there must not undo what stands here.
    parser.add_argument("--quiet", action="store_true", default=argparse.SUPPRESS, help=QUIET)
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
        # what is printed on the way is no result
        with contextlib.redirect_stdout(sys.stderr), _quiet(args.quiet):
            report = _run(args)
    except (PiecError, OSError) as error:
        message = " ".join(str(error).split())
        return _fail(args, f"error: {message}", message, 2)
    except KeyboardInterrupt as error:
        message = str(error) if isinstance(error, Interrupted) else f"interrupted; {_kept(args)}"
        return _fail(args, message, message, 130)
    _print(report, args.json)
    return 0


def _run(args: argparse.Namespace) -> Report:
    from evaluation.commands.outputs import check_outputs

    check_outputs(args)  # before the work, not after it
    return COMMANDS[args.command].load().run(args)


def _kept(args: argparse.Namespace) -> str:
    from evaluation.commands.kept import kept_by

    return kept_by(args)


def _fail(args: argparse.Namespace, said: str, message: str, code: int) -> int:
    print(f"piec {args.command}: {said}", file=sys.stderr)
    if args.json:
        print(json.dumps({"error": message}))
    return code


@contextlib.contextmanager
def _quiet(wanted: bool) -> Iterator[None]:
    """Through the environment, so that workers are quiet as well."""
    before = os.environ.get(console.VARIABLE)
    if wanted:
        os.environ[console.VARIABLE] = "1"
    try:
        yield
    finally:
        if wanted and before is None:
            del os.environ[console.VARIABLE]
        elif wanted and before is not None:
            os.environ[console.VARIABLE] = before


if __name__ == "__main__":
    sys.exit(main())
