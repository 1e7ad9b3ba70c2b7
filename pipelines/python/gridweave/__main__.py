"""The command `gridweave`, also as `python -m gridweave`."""

import signal
import sys

from . import _native
from .request import use_this_interpreter


def main() -> None:
    """Runs the command, and exits with its status."""
    use_this_interpreter()
    # An interrupt before the command has its own handler ends the program, without a traceback.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    sys.exit(_native.command([sys.executable, "-m", "gridweave"], sys.argv[1:]))


if __name__ == "__main__":
    main()
