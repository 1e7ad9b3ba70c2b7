"""Runs two commands on machines of their own that a cable ties together.

    python3 two_machines.py COMMAND1 COMMAND2

Each command, a line for the shell, runs in a network namespace of its own, at the address 10.78.0.1 and 10.78.0.2, with a pair of veth
devices between them. When the first ends, the second is interrupted, as by ctrl-c. The exit status is the worse of theirs. Needs the right
to make network namespaces.
"""

import ctypes
import os
import signal
import subprocess
import sys
import threading

CLONE_NEWNET = 0x40000000
DEVICE = "eth0"


def ip(line):
    subprocess.run(["ip", *line.split()], check=True)


class Machine:
    """A network namespace, in which a thread runs what it is told."""

    def __init__(self, number):
        self.address = f"10.78.0.{number}"
        self.namespace, self.process, self.error = None, None, None
        self.steps = [threading.Event(), threading.Event(), threading.Event()]
        self.command = None
        threading.Thread(target=self._live, daemon=True).start()
        self._wait(0)

    def _wait(self, step):
        self.steps[step].wait()
        if self.error:
            raise self.error

    def _live(self):
        try:
            libc = ctypes.CDLL(None, use_errno=True)
            if libc.unshare(CLONE_NEWNET) != 0:
                raise OSError(ctypes.get_errno(), "cannot make a network namespace")
            self.namespace = f"/proc/{os.getpid()}/task/{threading.get_native_id()}/ns/net"
            self.steps[0].set()
            self.steps[1].wait()
            for line in ("link set dev lo up", f"addr add {self.address}/24 dev {DEVICE}", f"link set dev {DEVICE} up"):
                ip(line)
            # A group of its own, all of which is interrupted.
            self.process = subprocess.Popen(["sh", "-c", self.command], start_new_session=True)
        except Exception as error:
            self.error = error
        for step in self.steps:
            step.set()

    def run(self, command):
        """Starts a command, once the device is there."""
        self.command = command
        self.steps[1].set()
        self._wait(2)


def main(first_command, second_command):
    machines = [Machine(1), Machine(2)]
    ends = [f"name {DEVICE} netns {machine.namespace}" for machine in machines]
    ip(f"link add {ends[0]} type veth peer {ends[1]}")
    try:
        # What is to be found is there first on one machine, what finds it on the other.
        for machine, command in zip(reversed(machines), (second_command, first_command)):
            machine.run(command)
        first, second = (machine.process for machine in machines)
        first.wait()
        os.killpg(second.pid, signal.SIGINT)
        second.wait()
        return max(abs(first.returncode), abs(second.returncode))
    finally:
        for machine in machines:
            if machine.process and machine.process.poll() is None:
                os.killpg(machine.process.pid, signal.SIGKILL)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
