"""The program ``flightid``: finds its verbs, shows errors as sentences, leaves with a code."""

from __future__ import annotations

import os
import pkgutil
import traceback
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

import click

from flightid.cli.hints import MEANT, missing_hint
from flightid.cli.output import Exit, note
from flightid.cli.wording import as_typed
from flightid.errors import FlightidError
from flightid.surface import speaking
from flightid.threads import one_linear_algebra_thread
from flightid.version import VERSION

NAME, COMPLETE = "flightid", "_FLIGHTID_COMPLETE"
"""The program, and the variable by which a shell asks it for completions."""
ORDER = (
    "run",
    "tune",
    "inspect",
    "flight",
    "autotune",
    "new",
    "plan",
    "design",
    "response",
    "response-arithmetic",
    "identify",
    "verify",
    "predict",
    "modes",
    "margins",
    "disk-margin",
    "disturbance-rejection",
    "handling-qualities",
    "lower-order",
    "compare",
    "compare-structures",
    "simulate",
    "report",
)
"""Verbs in the order of the work, as help lists them; others follow in alphabetical order."""
NOT_VERBS = frozenset(
    {
        "bar",
        "black_boxes",
        "compared_loops",
        "equations",
        "figures",
        "gain_files",
        "hints",
        "lists",
        "log_parts",
        "model_commands",
        "next_comparison",
        "option_fields",
        "output",
        "pages",
        "pairs",
        "program",
        "proposals",
        "records",
        "sources",
        "wording",
    }
)


class Verbs(click.Group):
    """A group whose commands are the files of this folder, each loaded when it is used."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Verbs in the order of the work."""
        del ctx
        here = pkgutil.iter_modules([str(Path(__file__).parent)])
        found = {module.name.replace("_", "-") for module in here if module.name not in NOT_VERBS}
        ordered = [verb for verb in ORDER if verb in found]
        return [*ordered, *sorted(found - set(ordered))]

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Command of a verb, or None."""
        if cmd_name not in self.list_commands(ctx):
            return None
        command = import_module(f"flightid.cli.{cmd_name.replace('-', '_')}").command
        if not isinstance(command, click.Command):
            raise TypeError(f"flightid.cli.{cmd_name}.command is not a click command")
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Find the command; an unknown verb is answered with the nearest one."""
        if args and not args[0].startswith("-") and self.get_command(ctx, args[0]) is None:
            from difflib import get_close_matches

            near = get_close_matches(args[0], self.list_commands(ctx), n=1)
            hint = f" Did you mean {near[0]!r}?" if near else " All commands: flightid --help"
            if args[0] in MEANT:
                hint = f" That is: {MEANT[args[0]]}"
            ctx.fail(f"There is no command {args[0]!r}.{hint}")
        return super().resolve_command(ctx, args)


@click.group(
    cls=Verbs,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    epilog="Exit codes: 0 done; 1 done, and a verdict is red; 2 input cannot be used; "
    "70 a fault in flightid; 130 interrupted.",
)
@click.version_option(VERSION, prog_name=NAME)
@click.option("--debug", is_flag=True, expose_value=False, help="Show the traceback of an error.")
@click.option("--quiet", is_flag=True, help="Show no progress.")
@click.option(
    "--memory",
    type=click.IntRange(min=1),
    metavar="MIB",
    help="What one file may take in memory, MiB; default: FLIGHTID_MEMORY_MIB, else 2048.",
)
@click.pass_context
def program(ctx: click.Context, quiet: bool, memory: int | None) -> None:
    """Turn flight logs and rig records into validated flight-dynamics models."""
    if memory is not None:
        from flightid.reading import VARIABLE

        os.environ[VARIABLE] = str(memory)
    if not quiet:
        from flightid.cli.bar import bar_display
        from flightid.progress import shown_by

        ctx.with_resource(shown_by(bar_display))


def run(arguments: Sequence[str] | None = None) -> int:
    """Run the program and return its exit code.

    Parameters
    ----------
    arguments : sequence of str, optional
        Arguments after the program's name; default: those of this process.

    Returns
    -------
    int
        One of `Exit`.
    """
    one_linear_algebra_thread()
    given = None if arguments is None else list(arguments)
    try:
        with speaking(as_typed):
            code = program.main(
                args=given, prog_name=NAME, standalone_mode=False, complete_var=COMPLETE
            )
    except click.ClickException as error:
        error.show()
        where = error.ctx if isinstance(error, click.UsageError) else None
        if where and (hint := missing_hint(error.format_message(), where.command_path)):
            note(f"Hint: {hint}")
        return error.exit_code
    except (KeyboardInterrupt, click.Abort) as stop:
        # Click makes an abort of Ctrl-C: what a verb has to say of it stands in its cause.
        told = stop.__cause__ if isinstance(stop, click.Abort) else stop
        note(str(told or "") or "Interrupted; nothing was left half-written.")
        return Exit.INTERRUPTED
    except BrokenPipeError:
        return Exit.DONE
    except (FlightidError, OSError, MemoryError) as error:
        _explain(error, given)
        return Exit.UNUSABLE
    except Exception as error:
        _explain(error, given)
        note("This is a fault in flightid. Please report it with the output of --debug.")
        return Exit.FAULT
    return code if isinstance(code, int) else Exit.DONE


def _explain(error: Exception, arguments: list[str] | None) -> None:
    import sys

    if "--debug" in (sys.argv[1:] if arguments is None else arguments):
        note(traceback.format_exc())
    if isinstance(error, OSError) and error.filename is not None and error.strerror:
        said = f"{error.filename}: {error.strerror[:1].lower()}{error.strerror[1:]}"
    else:
        said = f"{'' if isinstance(error, FlightidError) else f'{type(error).__name__}: '}{error}"
    note(f"Error: {said}")
