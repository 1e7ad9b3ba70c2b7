"""`python -m gridweave.program MODULE FOLDER`: the program of a stage, which a pipeline starts.

It speaks the protocol of a call, which is written down in `runtime/src/program/mod.rs`: one message at a time, in the order that the
stage gets them.
"""

import ctypes
import faulthandler
import io
import json
import os
import signal
import sys
import traceback
from typing import Any, Callable, Iterator

from rosbags.serde import SerdeError

from .calls import Calls, What
from .load import load
from .msg import decode
from .stages import About, Context, Stage


class Program:
    """A stage with its calls."""

    def __init__(self, module: str, calls: Calls):
        self.module, self.calls = module, calls
        self.stage: Stage
        self.inputs: list[tuple[str, type, Callable[[Any, About], None]]] = []
        #: What a source still has to send.
        self.messages: Iterator[Any] = iter(())

    def start(self, request: dict[str, Any]) -> None:
        """Makes the stage."""
        made = load(self.module)
        interface = made.interface()
        if interface != json.loads(request["interface"]):
            raise RuntimeError(f"{self.module} has other ports or parameters than when the pipeline was loaded: load it again")
        outputs = {output["name"]: number for number, output in enumerate(interface["outputs"])}
        context = Context(request["stage"], request["seed"], request["reference"], request["robots"], tuple(request["inputs"]))
        own = {name: value for name, value in request["parameters"].items() if name in interface["parameters"]["properties"]}
        self.stage = made.begin(own, context, lambda name, *sent: self.calls.send(outputs[name], *sent),
                                lambda what: self.calls.notify(What.WARNING, what))
        self.inputs = [(name, port.type, getattr(self.stage, f"on_{name}")) for name, port in made._members(_input()).items()]
        if made._is_source():
            self.messages = self.stage.messages()  # type: ignore[attr-defined]

    def receive(self, port: int, about: About, data: memoryview) -> None:
        """Hands a message to the stage. One that cannot be read is left out with a warning."""
        name, message_type, take = self.inputs[port]
        try:
            message = decode(message_type, data)
        except (SerdeError, AssertionError, IndexError, TypeError) as error:
            self.calls.notify(What.WARNING, f"messages on the input `{name}` that cannot be read are left out: {error}")
            return
        take(message, about)

    def advance(self) -> None:
        """Lets a source send what comes next."""
        try:
            next(self.messages)
        except StopIteration:
            self.calls.notify(What.END)

    def serve(self) -> None:
        """Answers calls until there are no more."""
        while (call := self.calls.wait()) is not None:
            try:
                if call.what == What.MESSAGE:
                    self.receive(call.port, call.about, call.data)
                elif call.what == What.NEXT:
                    self.advance()
                elif call.what == What.START:
                    self.start(json.loads(bytes(call.data)))
                elif call.what == What.FINISH:
                    self.stage.finish()
                elif call.what == What.ABORT:
                    self.stage.abort(bytes(call.data).decode(errors="replace"))
            except BaseException as error:  # noqa: BLE001: every error is reported
                self.calls.notify(What.FAILED, _traceback_of(error))
            else:
                self.calls.notify(What.DONE)


def _input() -> type:
    from .stages import Input

    return Input


def _traceback_of(error: BaseException) -> str:
    """An error and where it comes from, without what lies above the stage."""
    own = os.path.dirname(os.path.abspath(__file__))
    frames = traceback.extract_tb(error.__traceback__)
    while len(frames) > 1 and os.path.dirname(os.path.abspath(frames[0].filename)) == own:
        del frames[0]
    lines = traceback.format_exception_only(error)
    where = "".join(traceback.format_list(frames))
    return f"{''.join(lines).rstrip()}\nTraceback (most recent call last):\n{where}".rstrip()


def main() -> None:
    """Runs a stage until the calls end."""
    # The stage that has started this program ends it: signals of the terminal or of the system are for that one.
    for ignored in (signal.SIGINT, signal.SIGTERM):
        signal.signal(ignored, signal.SIG_IGN)
    # When that one dies in whatever way, so does this, also in the middle of its work: PR_SET_PDEATHSIG.
    ctypes.CDLL(None).prctl(1, signal.SIGKILL)
    # A crash of the interpreter says where, and so does one that hangs, when it is asked.
    faulthandler.enable()
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGUSR1})
    faulthandler.register(signal.SIGUSR1)
    doorbell_in, doorbell_out = os.dup(0), os.dup(1)
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    # What a stage prints must not go to the doorbell.
    os.dup2(2, 1)
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(line_buffering=True)
    module, folder = sys.argv[1:]
    Program(module, Calls(folder, doorbell_in, doorbell_out)).serve()


if __name__ == "__main__":
    main()
