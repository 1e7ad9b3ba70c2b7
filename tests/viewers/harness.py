"""What the tests of viewers have in common: checks that are counted, commands, a folder of their own, and a watchdog."""

import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

WATCHDOG = 110

gridweave = str(Path(sys.argv[1]).resolve())
failed = 0


def check(what, holds, found=""):
    global failed
    failed += not holds
    print(f"{'ok     ' if holds else 'FAILED '}{what}{'' if holds else f': {found}'}", flush=True)


def run(folder, *command):
    ended = subprocess.run([str(word) for word in command], cwd=folder, capture_output=True, text=True, timeout=60)
    if ended.returncode != 0:
        raise RuntimeError(f"{' '.join(map(str, command))} ended with {ended.returncode}: {ended.stdout}{ended.stderr}")
    return ended.stdout


def _stop(number, _):
    raise TimeoutError(f"not done within {WATCHDOG} s" if number == signal.SIGALRM else "stopped")


def finish(test, name, **environment):
    """Runs a test in a folder of its own, which is also HOME and the value of each variable that is None, and exits."""
    for number in (signal.SIGALRM, signal.SIGTERM, signal.SIGINT):
        signal.signal(number, _stop)
    signal.alarm(WATCHDOG)
    with tempfile.TemporaryDirectory(prefix=f"gridweave-{name}-") as folder:
        os.environ.update(HOME=folder, **{key: value or folder for key, value in environment.items()})
        try:
            test(Path(folder))
        except Exception as error:  # whatever it is, the others are told
            check("the test comes to its end", False, repr(error))
        signal.alarm(0)
    print("all is well" if not failed else f"{failed} failed", flush=True)
    sys.exit(1 if failed else 0)
