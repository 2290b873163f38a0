"""What is installed, and the command that installs what is not.

Interface: :func:`needs`.  The command is read from the metadata of this distribution, so it holds
for a clone as for a wheel, and it calls the Python that runs, whatever is on the path.
"""

import re
import shlex
import sys
from importlib import metadata

US = "dcpg-swarm"
PACKAGES = {"rerun": "rerun-sdk", "PIL": "pillow", "yaml": "PyYAML"}  # module -> its package


def needs(module: str, what: str = "this") -> str | None:
    """A line for a package that is missing, with the command that installs it.

    Args:
        module: what could not be imported.
        what: wants it.

    Returns:
        None where it is none of the packages that we name.
    """
    name = module.partition(".")[0]
    package = PACKAGES.get(name, name)
    for wanted in _named():
        if re.split(r"[^\w.-]", wanted)[0].lower() == package.lower():
            pip = f"{shlex.quote(sys.executable)} -m pip install"
            return f'{what} needs {package}, which is not installed: {pip} "{wanted}"'
    return None


def _named() -> list[str]:
    try:
        return [line.partition(";")[0].strip() for line in metadata.requires(US) or ()]
    except metadata.PackageNotFoundError:  # run from a folder
        return []
