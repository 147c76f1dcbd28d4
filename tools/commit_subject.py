"""Hook `commit-msg`: a commit's subject is one line of at most 60 letters.

python tools/commit_subject.py .git/COMMIT_EDITMSG
"""

from __future__ import annotations

import sys
from pathlib import Path

MAXIMUM_LETTERS = 60
# Subjects that git writes by itself.
WRITTEN_BY_GIT = ("Merge ", 'Revert "', "fixup! ", "squash! ", "amend! ")
SCISSORS = "# ------------------------ >8 ------------------------"


def faults(message: str) -> list[str]:
    """Say what is wrong with a commit message.

    Parameters
    ----------
    message : str
        The message as git hands it over, comments included.

    Returns
    -------
    list of str
        One sentence a fault: what was found, what is needed, what to do.
    """
    kept = message.split(SCISSORS, maxsplit=1)[0].splitlines()
    lines = [line.rstrip() for line in kept if not line.startswith("#")]
    while lines and not lines[0]:
        del lines[0]
    if not lines:
        return ["The message is empty. Say in its first line what the commit does."]
    subject = lines[0]
    found = []
    if len(subject) > MAXIMUM_LETTERS and not subject.startswith(WRITTEN_BY_GIT):
        found.append(
            f"The subject has {len(subject)} letters, at most {MAXIMUM_LETTERS} are wanted: "
            "name the topic there and move the why into the body."
        )
    if len(lines) > 1 and lines[1]:
        found.append("The second line is not empty: leave a line between subject and body.")
    return found


def main(arguments: list[str]) -> int:
    """Check the message in the file that git names."""
    if len(arguments) != 1:
        print(__doc__, file=sys.stderr)
        return 2
    found = faults(Path(arguments[0]).read_text(encoding="utf-8"))
    for sentence in found:
        print(sentence, file=sys.stderr)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
