"""`python -m gridweave.describe MODULE`: prints the ports and parameters of a stage as JSON."""

import json
import os
import sys

from .load import load


def main() -> None:
    """Prints JSON on standard output; what the module prints goes to standard error."""
    out = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    json.dump(load(sys.argv[1]).interface(), out)
    out.close()


if __name__ == "__main__":
    main()
