"""Install what pyproject.toml lists, without building flightid itself."""

import subprocess
import sys
import tomllib
from pathlib import Path


def requirements(*extras: str) -> list[str]:
    """List the run-time requirements and those of the named extras."""
    text = Path(__file__).parent.parent.joinpath("pyproject.toml").read_text(encoding="utf-8")
    project = tomllib.loads(text)["project"]
    found: list[str] = list(project["dependencies"])
    for extra in extras:
        found += project["optional-dependencies"][extra]
    return found


if __name__ == "__main__":
    constraints = Path(__file__).parent.parent / "constraints.txt"
    pip = [sys.executable, "-m", "pip", "install", "--quiet", "--constraint", str(constraints)]
    command = [*pip, *requirements(*sys.argv[1:])]
    sys.exit(subprocess.run(command, check=False).returncode)
