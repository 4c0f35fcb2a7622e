"""The command `tactile-marks`. What is heavy is imported when a command needs it, so help comes at once."""

from __future__ import annotations

import contextlib
import io
import os
import sys
import traceback
from collections.abc import Iterator, Sequence
from typing import Literal

from cyclopts import App, CycloptsError, Parameter, ValidationError
from cyclopts.argument import ArgumentCollection

from glyphs.compiling import show_compiling
from glyphs.errors import describe_fault, is_machine_error
from pipeline.cli.exit_status import (
    BROKEN_PIPE,
    FAILED,
    FAULT,
    INTERRUPTED,
    USAGE,
    CommandError,
    failures_reported,
)
from pipeline.workers.interrupts import interrupts_noted

PROGRAM = "tactile-marks"


def _version() -> str:
    from pipeline.common.version import program_version

    return program_version()


def _settings(app: App, commands: tuple[str, ...], arguments: ArgumentCollection) -> None:
    """Settings from file and environment, for the commands that have any."""
    if any(argument.name == "--config" for argument in arguments):
        from pipeline.cli.settings import from_file_and_environment

        with failures_reported():
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
        "the program, please report it; 130 interrupted; 141 nobody reads the output."
    ),
    suppress_keyboard_interrupt=False,
)
_LIBRARY = App(name="glyphs", help="List, show and collect the fonts of steel stamps.")

app.command("pipeline.cli.read:read", name="read", help="Read the serials of parts.")
app.command(
    "pipeline.cli.certify:certify",
    name="certify",
    help="Show from which confidence your parts may be accepted, and certify it.",
)
app.command("pipeline.cli.inspect:inspect", name="inspect", help="Draw how one part was read, step by step.")
app.command(
    "pipeline.cli.synth:synth", name="synth", help="Make stamped, dirty parts and photographs of them."
)
app.command("pipeline.cli.scan:scan", name="scan", help="Scan a height map with the simulated array.")
app.command(
    "pipeline.cli.scan:calibrate", name="calibrate", help="Calibrate a recorded scan from its lead-in."
)
app.command(
    "pipeline.cli.identify:identify",
    name="identify",
    help="Find the whisker and bench that made a recording over a test piece.",
)
app.command(
    "pipeline.cli.import_traces:import_traces",
    name="import",
    help="Make a scan of traces recorded by others.",
)
_BENCH = App(name="bench", help="Drive a bench of iron: stage by G-code, converter, and emulators of both.")
_BENCH.command("pipeline.cli.bench:check", name="check", help="Ask stage and converter who they are.")
_BENCH.command("pipeline.cli.bench:home", name="home", help="Lift the comb and find the axes' ends.")
_BENCH.command(
    "pipeline.cli.bench:calibrate", name="calibrate", help="Find the whiskers' gains on a bare plate."
)
_BENCH.command(
    "pipeline.cli.bench:scan", name="scan", help="Scan the part under the comb, or draw the moves."
)
_BENCH.command(
    "pipeline.cli.bench:emulate", name="emulate", help="Stand in for a bench, at pseudo-terminals."
)
app.command(_BENCH)
app.command("pipeline.cli.demo:demo", name="demo", help="Make, scan and read a few parts; start here.")
app.command("pipeline.cli.figures:figures", name="figures", help="Compute and draw the results of the paper.")
app.command(
    "pipeline.cli.benchmarking.run:app",
    name="benchmark",
    help="Measure how well dirty marks are read, by this reader and by others.",
)
app.command(
    "pipeline.cli.study:study", name="study", help="Read parts several times: do readings repeat and agree?"
)
app.command("pipeline.cli.design:design", name="design", help="Find the whisker to build.")
app.command(
    "pipeline.cli.serve:serve", name="serve", help="Run the service: camera first, touch when unsure."
)
app.command(
    "pipeline.cli.enroll:enroll",
    name="enroll",
    help="Learn the shapes of a die from reviewed parts.",
)
app.command("pipeline.cli.worker:worker", name="worker", help="Lend this machine's cores to a cluster.")
_TOKENS = App(name="tokens", help="Make, list and revoke tokens of the service.")
_TOKENS.command("pipeline.cli.tokens:add", name="add", help="Make a token.")
_TOKENS.command("pipeline.cli.tokens:list_tokens", name="list", help="List the tokens.")
_TOKENS.command("pipeline.cli.tokens:revoke", name="revoke", help="Revoke a token.")
app.command(_TOKENS)
_STORE = App(name="store", help="Back up, restore and check the service's store and files.")
_STORE.command(
    "pipeline.cli.store:backup", name="backup", help="Copy store and files while the service runs."
)
_STORE.command("pipeline.cli.store:restore", name="restore", help="Bring a backup back into an empty store.")
_STORE.command("pipeline.cli.store:check", name="check", help="See whether store and files are as written.")
app.command(_STORE)
_LIBRARY.command("pipeline.cli.glyphs:list_fonts", name="list", help="List the fonts.")
_LIBRARY.command("pipeline.cli.glyphs:show", name="show", help="Draw a sheet of fonts.")
_LIBRARY.command("pipeline.cli.glyphs:build", name="build", help="Write a glyph database.")
app.command(_LIBRARY)


@app.command
def completion(shell: Literal["bash", "zsh", "fish"]) -> int:
    """Print the script with which a shell completes commands and options.

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


def whole_help(*names: str) -> None:
    """Let the help of a command be all that its function says, not the line that the list of commands has.

    Args:
        names: of the command, such as tokens, add; what follows it on a command line may follow.
    """
    command = app
    for name in names:
        if name.startswith("-") or name not in command:
            break
        command = command[name]
    if command.default_command is not None:
        command.help = None


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line.

    Returns:
        0; 1 where something failed; 2 for bad usage; 70 for a fault of the program; 130 when interrupted; 141 where
        nobody reads the output.
    """
    _open_streams()
    given = sys.argv[1:] if arguments is None else list(arguments)
    try:
        if not {"--help", "-h"}.isdisjoint(given):
            whole_help(*given)
        with (
            interrupts_noted(),
            show_compiling(lambda line: print(line, file=sys.stderr, flush=True)),
        ):
            status = app(
                given,
                exit_on_error=False,
                print_error=False,
                result_action="return_value",
            )
        sys.stdout.flush()
        return status if isinstance(status, int) else 0
    except CycloptsError as error:
        return _complain(_explained(error), USAGE)
    except CommandError as error:
        # nobody reads the output any more: end as other programs of a pipe do
        return BROKEN_PIPE if error.status == BROKEN_PIPE else _complain(str(error), error.status)
    except Exception as error:
        if is_machine_error(error):  # a full disk, say, wherever it was met
            return _complain(f"{error}; see to the disk and start it again", FAILED)
        traceback.print_exc()
        return _complain(f"{describe_fault(error)}; please report it with the lines above", FAULT)
    except KeyboardInterrupt:
        return _complain("interrupted", INTERRUPTED)


class _Output(io.TextIOWrapper):
    """Standard output or error; where it cannot be written the command ends with a status of its own."""

    def write(self, text: str) -> int:
        with _output_faults(self):
            return super().write(text)

    def flush(self) -> None:
        with _output_faults(self):
            super().flush()


@contextlib.contextmanager
def _output_faults(stream: io.TextIOBase) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        # the interpreter flushes once more at its end
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
        broken = isinstance(error, BrokenPipeError)
        raise CommandError(
            f"the output cannot be written ({error.strerror})", status=BROKEN_PIPE if broken else FAILED
        ) from error


def _open_streams() -> None:
    """Replace closed standard streams by the null device, so that no other file takes their numbers."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            null = os.open(os.devnull, os.O_RDWR)
            if null != number:
                os.dup2(null, number)
                os.close(null)
            setattr(sys, name, open(number, "r" if name == "stdin" else "w"))  # noqa: SIM115
    for name in ("stdout", "stderr"):
        given = getattr(sys, name)
        if isinstance(given, io.TextIOWrapper):  # a file's name may be no text
            given.reconfigure(errors="backslashreplace")
        if type(given) is io.TextIOWrapper:  # not what a test has put there
            stream = _Output(
                given.buffer, given.encoding, given.errors,
                line_buffering=given.line_buffering, write_through=given.write_through,
            )  # fmt: skip
            setattr(sys, name, stream)
            given.detach()


def _explained(error: CycloptsError) -> str:
    if isinstance(error, ValidationError):
        from pipeline.cli.settings import explained

        return explained(error)
    return f"{error} (see {PROGRAM} --help)"


def _complain(message: str, status: int) -> int:
    with contextlib.suppress(CommandError):  # the status says it, too
        print(f"{PROGRAM}: {' '.join(message.split())}", file=sys.stderr)
    return status
