"""The command `tactile-marks`. Slow libraries are imported when a command needs them, so help is fast."""

from __future__ import annotations

import contextlib
import functools
import gc
import io
import os
import sys
import traceback
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Literal

from cyclopts import App, CycloptsError, Parameter, UnknownOptionError, ValidationError
from cyclopts.argument import ArgumentCollection

from glyphs.compiling import show_compiling
from pipeline.cli.exit_status import (
    BROKEN_PIPE,
    FAILED,
    FAULT,
    INTERRUPTED,
    USAGE,
    CommandError,
    failures_reported,
)
from pipeline.errors import describe_fault, is_machine_error
from pipeline.workers.interrupts import interrupts_noted

PROGRAM = "tactile-marks"
_HELP = ("--help", "-h", "--help-all")
_READ_BY = ("pipeline.reading.part_job", "pipeline.reading.part_reader", "recognition.surface")
"""Modules that a worker needs for its first part."""


def _version() -> str:
    from pipeline.common.version import program_version

    return program_version()


def _settings(app: App, commands: tuple[str, ...], arguments: ArgumentCollection) -> None:
    if any(argument.name == "--config" for argument in arguments):
        from pipeline.cli.settings import from_file_and_environment

        from_file_and_environment(app, commands, arguments)


def _default(value: object) -> str | None:
    if value in (None, False, "", (), {}):
        return None
    return f"{value:g}" if isinstance(value, float) else str(value)


app = App(
    name=PROGRAM,
    version=_version,
    config=_settings,
    default_parameter=Parameter(negative_iterable=(), show_default=_default),
    help="Read die-stamped serials by touch and by camera, from height maps, whisker scans and photographs.",
    help_flags=_HELP,
    help_epilogue=(
        "Exit status: 0 all is well; 1 a part, file or machine failed; 2 wrong arguments or settings; 70 a fault of "
        "the program; 130 interrupted; 141 nobody reads the output."
    ),
    help_format="plaintext",  # each command has its own: the module of Markdown is slow to import
    suppress_keyboard_interrupt=False,
)
_GROUPS = (
    ("glyphs", "Teach", "List, show and collect the fonts of steel stamps."),
    ("bench", "Whisker", "Drive a real bench: a stage by G-code, and a converter."),
    ("tokens", "Serve", "Make, list and revoke tokens of the service."),
    ("store", "Serve", "Back up, restore and check the service's store and files."),
    ("benchmark", "Exam", "Measure how well dirty marks are read, by this reader and by others."),
)
_COMMANDS = (
    ("read", "Read", "read:read", "Read the serials of parts.", "out format font mode verify accept-risk"),
    ("inspect", "Read", "read:inspect", "Draw how one part was read, step by step.", "out format mode"),
    ("demo", "Read", "demo:demo", "Make, scan and read a few parts; start here.", "service stay"),
    ("enroll", "Teach", "teach:enroll", "Learn the shapes of a die from reviewed parts.",
     "database font truth from-store"),
    ("glyphs list", "Teach", "stamp:list_fonts", "List the fonts.", "database"),
    ("glyphs show", "Teach", "stamp:show", "Draw a sheet of fonts.", "out"),
    ("glyphs build", "Teach", "stamp:build", "Write a glyph database.", ""),
    ("certify", "Judge", "judge:certify", "Find the confidence from which readings may be accepted, and certify it.",
     "truth risk confidence out format"),
    ("study", "Judge", "judge:study", "Read parts several times: do readings repeat and agree?",
     "repeats truth reviewers out format"),
    ("synth", "Whisker", "stamp:synth", "Make stamped, dirty parts and photographs of them.",
     "parts format dirt soil seed"),
    ("scan", "Whisker", "whisker:scan", "Scan a height map with the simulated array.",
     "out height-mm whisker active seed"),
    ("calibrate", "Whisker", "whisker:calibrate", "Calibrate a recorded scan from its lead-in.", "out in-place"),
    ("identify", "Whisker", "whisker:identify", "Find the whisker and bench that made a recording over a test piece.",
     "piece whisker out figure"),
    ("import", "Whisker", "whisker:import_traces", "Make a scan from traces recorded by others.", "traces out"),
    ("design", "Whisker", "design:design", "Find the whisker to build.", "height-mm alpha mu depth-mm out array"),
    ("bench check", "Whisker", "bench:check", "Ask stage and converter to identify themselves.", ""),
    ("bench home", "Whisker", "bench:home", "Lift the comb and find the axes' ends.", ""),
    ("bench calibrate", "Whisker", "bench:calibrate", "Find the whiskers' gains on a bare plate.", ""),
    ("bench scan", "Whisker", "bench:scan", "Scan the part under the comb, or draw the moves.", "out dry-run active"),
    ("serve", "Serve", "serve:serve", "Run the service: camera first, touch when unsure.",
     "port folder format tokens"),
    ("settings", "Serve", "settings:settings", "Print every setting with its value.", ""),
    ("worker", "Serve", "serve:worker", "Lend this machine's cores to a cluster.", "jobs"),
    ("tokens add", "Serve", "store:add", "Make a token.", "scope days"),
    ("tokens list", "Serve", "store:list_tokens", "List the tokens.", ""),
    ("tokens revoke", "Serve", "store:revoke", "Revoke a token.", ""),
    ("store backup", "Serve", "store:backup", "Copy store and files while the service runs.", "folder"),
    ("store restore", "Serve", "store:restore", "Restore a backup into an empty store.", "folder"),
    ("store check", "Serve", "store:check", "Check that store and files are as written.", "json"),
    ("benchmark run", "Exam", "exam:run", "Take an exam, and write a report.", "out design parts mode give jobs"),
    ("benchmark compare", "Exam", "exam:compare", "Show what a change did, part by part.", "out"),
    ("benchmark export", "Exam", "exam:export", "Write an exam as files, for readers outside this program.",
     "parts jobs check"),
    ("benchmark score", "Exam", "exam:score", "Score answers to an exam from a file.", "design truth give out"),
    ("completion", "Serve", "", "Print the script with which a shell completes commands and options.", ""),
)  # fmt: skip
"""Words of a command, its panel in help, its function, its summary, and the flags that `--help` shows."""
_MORE = ("calibrate", "identify", "import", "study", "worker", "completion")
"""Commands that `--help` leaves to `--help-all`."""

for _name, _group, _line in _GROUPS:
    app.command(App(name=_name, help=_line, group=_group, help_flags=_HELP, help_format="markdown"))


def completion(shell: Literal["bash", "zsh", "fish"], /) -> None:
    """Print the script with which a shell completes commands and options.

    For bash, in ~/.bashrc: eval "$(tactile-marks completion bash)"; for zsh the same in ~/.zshrc, after compinit; for
    fish: tactile-marks completion fish > ~/.config/fish/completions/tactile-marks.fish

    Args:
        shell: Which shell.
    """
    _read_docstrings_once()
    script = app.generate_completion(shell=shell)
    # many arguments are names of files: complete files where nothing better is known
    if shell == "bash":
        script = script.replace("\ncomplete -F ", "\ncomplete -o bashdefault -o default -F ")
    elif shell == "zsh":
        either = f"_{PROGRAM}_or_file"
        script += f'\n{either}() {{ _cyclopts_{PROGRAM} "$@" || _files }}\ncompdef {either} {PROGRAM}'
    print(script)


for _words, _group, _function, _line, _ in _COMMANDS:
    *_path, _name = _words.split()
    _within, _panel = (app[_path[0]], "Commands") if _path else (app, _group)
    _target = f"pipeline.cli.{_function}" if _function else completion
    _within.command(_target, name=_name, help=_line, group=_panel, help_format="markdown")


def _command_of(arguments: Sequence[str]) -> tuple[list[str], App]:
    words, command = [], app
    for word in arguments:
        if word.startswith("-") or word not in command:
            break
        words.append(word)
        command = command[word]
    return words, command


def _show_less(arguments: Sequence[str]) -> Callable[[], None]:
    """Let help show only the most important commands and flags; the returned function reports how much was left out."""
    from cyclopts.help.formatters import DefaultFormatter

    words, _ = _command_of(arguments)
    flags = next((flags for name, *_, flags in _COMMANDS if name == " ".join(words)), None)
    shown = {f"--{flag}" for flag in (flags or "").split()}
    left_out = 0

    class Short(DefaultFormatter):
        def __call__(self, console: Any, options: Any, panel: Any) -> None:
            nonlocal left_out
            if flags is None:
                entries = [e for e in panel.entries if words or not {*e.names} & {*_MORE}]
            else:
                entries = [e for e in panel.entries if e.required or e.positional_label or shown & {*e.names}]
            left_out += len(panel.entries) - len(entries)
            panel.entries = entries
            if entries:
                super().__call__(console, options, panel)

    app.help_formatter = Short()

    def report_left_out() -> None:
        app.help_formatter = None
        if left_out:
            what = ("command" if flags is None else "flag") + "s" * (left_out > 1)
            print(f"{left_out} more {what}: {' '.join([PROGRAM, *words])} --help-all")

    return report_left_out


def whole_help(*names: str) -> None:
    """Show the whole docstring of a command's function in its help, not only the line in the list of commands."""
    _read_docstrings_once()
    _, command = _command_of(names)
    if command.default_command is not None:
        command.help = None


def _read_docstrings_once() -> None:
    """Let cyclopts read the source of a class once instead of for every command with its settings; this saves 10 s."""
    import docstring_parser

    if not hasattr(docstring_parser.parse_from_object, "cache_info"):
        docstring_parser.parse_from_object = functools.cache(docstring_parser.parse_from_object)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; 0, 1 on failure, 2 for bad usage, 70 for a fault of the program, 130 interrupted, 141
    closed pipe."""
    _open_streams()
    # small matrix products are slower when shared among threads; numpy is not loaded yet
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # looking for pydantic plugins, which nothing here uses, takes each process 30 ms
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    if arguments is None:
        # modules make many lasting objects; searching them takes a tenth of the start
        gc.set_threshold(10_000)
        # multiprocessing would run the file named here in every worker, and workers do not need it
        vars(sys.modules["__main__"]).pop("__file__", None)
    words = sys.argv[1:] if arguments is None else list(arguments)
    try:
        report_left_out = None
        if not {*_HELP}.isdisjoint(words):
            whole_help(*words)
            report_left_out = None if "--help-all" in words else _show_less(words)
        with (
            interrupts_noted(),
            show_compiling(lambda line: print(line, file=sys.stderr, flush=True)),
            failures_reported(),
            _worker_of(words) if arguments is None else contextlib.nullcontext(),
        ):
            status = app(words, exit_on_error=False, print_error=False, result_action="return_value")
        if report_left_out is not None:
            report_left_out()
        sys.stdout.flush()
        return status if isinstance(status, int) else 0
    except CycloptsError as error:
        return _complain(_explain(error), USAGE)
    except CommandError as error:
        # the output pipe is closed: end as other programs in a pipe do
        return BROKEN_PIPE if error.status == BROKEN_PIPE else _complain(str(error), error.status)
    except Exception as error:
        if is_machine_error(error):  # such as a full disk
            return _complain(f"{error}; check the disk and start it again", FAILED)
        traceback.print_exc()
        return _complain(f"{describe_fault(error)}; please report it with the lines above", FAULT)
    except KeyboardInterrupt:
        return _complain("interrupted", INTERRUPTED)


def _worker_of(arguments: Sequence[str]) -> contextlib.AbstractContextManager[None]:
    """Start a worker that imports the reader's libraries while this process parses arguments; only for `read`."""
    if arguments[:1] != ["read"] or any(
        word.partition("=")[0] in (*_HELP, "--cluster") for word in arguments
    ):
        return contextlib.nullcontext()
    from pipeline.workers.process import started_early

    return started_early(_READ_BY)


class _Output(io.TextIOWrapper):
    """Standard output or error; if it cannot be written, the command ends with its own status."""

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
        standard = getattr(sys, name)
        if isinstance(standard, io.TextIOWrapper):  # a file's name may hold bytes that are not text
            standard.reconfigure(errors="backslashreplace")
        if type(standard) is io.TextIOWrapper:  # not a test's replacement
            stream = _Output(
                standard.buffer, standard.encoding, standard.errors,
                line_buffering=standard.line_buffering, write_through=standard.write_through,
            )  # fmt: skip
            setattr(sys, name, stream)
            standard.detach()


def _explain(error: CycloptsError) -> str:
    if isinstance(error, ValidationError):
        from pipeline.cli.settings import explained

        return explained(error)
    if isinstance(error, UnknownOptionError):
        from pipeline.cli.settings import unknown_flag_hint

        flag = error.token.keyword or error.token.value.partition("=")[0]
        flags = [name for argument in error.argument_collection if argument.parse for name in argument.names]
        return " ".join(
            (f"Unknown option: {flag}.", unknown_flag_hint(flag, flags), f"(see {PROGRAM} --help)")
        )
    return f"{error} (see {PROGRAM} --help)"


def _complain(message: str, status: int) -> int:
    with contextlib.suppress(CommandError):  # if it cannot be printed, the status still shows the failure
        print(f"{PROGRAM}: {' '.join(message.split())}", file=sys.stderr)
    return status
