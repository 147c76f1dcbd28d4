"""``flightid completion``: the script by which a shell completes commands, options and words."""

from __future__ import annotations

import click

SHELLS = ("bash", "zsh", "fish")
HELP = """Print the completion script of SHELL. It asks flightid itself, so it is never out of date.

\b
flightid completion bash > ~/.local/share/bash-completion/completions/flightid
flightid completion zsh > "${fpath[1]}/_flightid"
flightid completion fish > ~/.config/fish/completions/flightid.fish
"""


@click.command(short_help="Script that lets bash, zsh or fish complete flightid.", help=HELP)
@click.argument("shell", type=click.Choice(SHELLS))
def command(shell: str) -> None:
    """Print the script."""
    from click.shell_completion import get_completion_class

    from flightid.cli.program import COMPLETE, NAME, program

    kind = get_completion_class(shell)
    assert kind is not None, "click knows these three"
    made = kind(program, {}, NAME, COMPLETE)
    # Its `source` would first start a bash to ask for its version, which need not be here.
    click.echo(made.source_template % made.source_vars())
