"""The command `tactile-marks`. What is heavy is imported when a command needs it, so help comes at once."""

from __future__ import annotations

import io
import os
import sys
import traceback
from collections.abc import Sequence
from typing import Literal

from cyclopts import App, CycloptsError, Parameter, ValidationError
from cyclopts.argument import ArgumentCollection

from pipeline.cli.exit_status import BROKEN_PIPE, FAULT, INTERRUPTED, USAGE, CommandError

PROGRAM = "tactile-marks"


def _version() -> str:
    from pipeline.common.version import program_version

    return program_version()


def _settings(app: App, commands: tuple[str, ...], arguments: ArgumentCollection) -> None:
    """Settings from file and environment, for the commands that have any."""
    if any(argument.name == "--config" for argument in arguments):
        from pipeline.cli.settings import from_file_and_environment

        from_file_and_environment(app, commands, arguments)


def _default(value: object) -> str | None:
    """A default as help shows it."""
    if value in (None, False, "", (), {}):
        return None
    return f"{value:g}" if isinstance(value, float) else str(value)


app = App(
    name=PROGRAM,
    version=_version,
    config=_settings,
    default_parameter=Parameter(negative_iterable=(), show_default=_default),
    help="Read die-stamped serials by touch and by camera, from height maps, whisker scans and photographs.",
    help_epilogue=(
        "Exit status: 0 all is well; 1 a part, file or machine failed; 2 wrong arguments or settings; 70 a fault of "
        "the program, please report it; 130 interrupted."
    ),
    suppress_keyboard_interrupt=False,
)
_LIBRARY = App(name="glyphs", help="List, show and collect the fonts of steel stamps.")

app.command("pipeline.cli.read:read", name="read", help="Read the serials of parts.")
app.command("pipeline.cli.inspect:inspect", name="inspect", help="Draw how one part was felt, seen and read.")
app.command("pipeline.cli.synth:synth", name="synth", help="Make stamped parts, their dirt and photographs.")
app.command("pipeline.cli.scan:scan", name="scan", help="Feel a height map with the virtual array.")
app.command("pipeline.cli.scan:calibrate", name="calibrate", help="Calibrate a scan from its lead-in.")
app.command("pipeline.cli.demo:demo", name="demo", help="Make, scan and read a few parts.")
app.command("pipeline.cli.figures:figures", name="figures", help="Draw the paper's results and beyond.")
app.command("pipeline.cli.benchmark:benchmark", name="benchmark", help="How well dirty parts are read.")
app.command("pipeline.cli.design:design", name="design", help="Find the whisker to build.")
app.command("pipeline.cli.serve:serve", name="serve", help="The service: camera first, touch when unsure.")
app.command(
    "pipeline.cli.enroll:enroll",
    name="enroll",
    help="Learn a die's shapes from parts that were reviewed.",
)
app.command("pipeline.cli.worker:worker", name="worker", help="Lend this machine to runs on a cluster.")
_TOKENS = App(name="tokens", help="Make, list and revoke tokens of the service.")
_TOKENS.command("pipeline.cli.tokens:add", name="add", help="Make a token.")
_TOKENS.command("pipeline.cli.tokens:list_tokens", name="list", help="List the tokens.")
_TOKENS.command("pipeline.cli.tokens:revoke", name="revoke", help="Take a token back.")
app.command(_TOKENS)
_LIBRARY.command("pipeline.cli.glyphs:list_fonts", name="list", help="List the fonts.")
_LIBRARY.command("pipeline.cli.glyphs:show", name="show", help="Draw a sheet of fonts.")
_LIBRARY.command("pipeline.cli.glyphs:build", name="build", help="Write a glyph database.")
app.command(_LIBRARY)


@app.command
def completion(shell: Literal["bash", "zsh", "fish"]) -> int:
    """Print what makes a shell complete commands and options.

    For bash, in ~/.bashrc: eval "$(tactile-marks completion bash)"; for zsh the same in ~/.zshrc, after compinit; for
    fish: tactile-marks completion fish > ~/.config/fish/completions/tactile-marks.fish

    Parameters
    ----------
    shell
        Which shell.
    """
    script = app.generate_completion(shell=shell)
    # many an argument is the name of a file or something else: where nothing better is known, complete files
    if shell == "bash":
        script = script.replace("\ncomplete -F ", "\ncomplete -o bashdefault -o default -F ")
    elif shell == "zsh":
        either = f"_{PROGRAM}_or_file"
        script += f'\n{either}() {{ _cyclopts_{PROGRAM} "$@" || _files }}\ncompdef {either} {PROGRAM}'
    print(script)
    return 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line.

    Returns:
        0; 1 where something failed; 2 for bad usage; 70 for a fault of the program; 130 when interrupted.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a file's name may be no text
            stream.reconfigure(errors="backslashreplace")
    try:
        status = app(
            sys.argv[1:] if arguments is None else list(arguments),
            exit_on_error=False,
            print_error=False,
            result_action="return_value",
        )
        sys.stdout.flush()
        return status if isinstance(status, int) else 0
    except CycloptsError as error:
        return _complain(_explained(error), USAGE)
    except CommandError as error:
        return _complain(str(error), error.status)
    except BrokenPipeError:
        # the reader of our output has gone; give the interpreter somewhere to flush to
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return BROKEN_PIPE
    except Exception as error:
        traceback.print_exc()
        fault = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
        return _complain(f"fault of the program ({fault}); please report it with the lines above", FAULT)
    except KeyboardInterrupt:
        return _complain("interrupted", INTERRUPTED)


def _explained(error: CycloptsError) -> str:
    if isinstance(error, ValidationError):
        from pipeline.cli.settings import explained

        return explained(error)
    return f"{error} (see {PROGRAM} --help)"


def _complain(message: str, status: int) -> int:
    print(f"{PROGRAM}: {' '.join(message.split())}", file=sys.stderr)
    return status
