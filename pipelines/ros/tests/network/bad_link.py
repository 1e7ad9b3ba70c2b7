"""Runs commands on machines of their own that a bad link ties together.

    python3 bad_link.py --rate 1e6 --delay 0.3 --loss 0.05 --cut 50:60 COMMAND...

Each COMMAND, a line for the shell, runs in a network namespace of its own, at the address 10.77.0.N, N counted from 1. What they send
each other as packets of IP goes through this program, by a TUN device in each namespace: as `tc netem` would have it, for
kernels without that. Each machine has a link of RATE bits a second each way, on which packets wait their turn; DELAY seconds
later they arrive, but for a share LOSS of them. Once as many kilobytes as the first number of CUT have arrived, nothing does for as
many seconds as the second. Needs the right to make network namespaces, and /dev/net/tun.

It ends when all commands have, and its exit status is the worst of theirs.
"""

import argparse
import ctypes
import fcntl
import heapq
import os
import random
import select
import struct
import subprocess
import sys
import threading
import time

CLONE_NEWNET = 0x40000000
TUNSETIFF = 0x400454CA
IFF_TUN, IFF_NO_PI = 0x0001, 0x1000
QUEUE_SECONDS = 2.0  # what waits longer for its turn is dropped, as full buffers do


class Machine:
    """A network namespace with one device, and the command that runs in it."""

    def __init__(self, number, command):
        self.address = f"10.77.0.{number}"
        self.command, self.error = command, None
        thread = threading.Thread(target=self._start)  # a namespace is a thread's
        thread.start()
        thread.join()
        if self.error:
            raise self.error

    def _start(self):
        try:
            libc = ctypes.CDLL(None, use_errno=True)
            if libc.unshare(CLONE_NEWNET) != 0:
                raise OSError(ctypes.get_errno(), "cannot make a network namespace")
            self.device = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
            fcntl.ioctl(self.device, TUNSETIFF, struct.pack("16sH14x", b"wan0", IFF_TUN | IFF_NO_PI))
            for line in ("link set dev lo up", f"addr add {self.address}/24 dev wan0", "link set dev wan0 up"):
                subprocess.run(["ip", *line.split()], check=True)
            self.process = subprocess.Popen(self.command, shell=True)
        except Exception as error:
            self.error = error


class Link:
    """One way of a machine's link."""

    def __init__(self):
        self.free_at = 0.0


def relay(machines, options):
    chance = random.Random(options.seed)
    start, cut_until = time.monotonic(), None
    by_address = {bytes(map(int, machine.address.split("."))): machine for machine in machines}
    up = {machine.address: Link() for machine in machines}
    down = {machine.address: Link() for machine in machines}
    on_their_way, count = [], 0
    totals = {"packets": 0, "bytes": 0, "lost": 0, "late": 0}
    devices = {machine.device: machine for machine in machines}
    while any(machine.process.poll() is None for machine in machines):
        now = time.monotonic()
        while on_their_way and on_their_way[0][0] <= now:
            _, _, target, packet = heapq.heappop(on_their_way)
            try:
                os.write(target.device, packet)
            except OSError:
                pass
        longest = min(0.05, max(0.0, on_their_way[0][0] - now)) if on_their_way else 0.05
        readable, _, _ = select.select(list(devices), [], [], longest)
        for device in readable:
            try:
                packet = os.read(device, 65536)
            except BlockingIOError:
                continue
            now = time.monotonic()
            target = by_address.get(packet[16:20]) if len(packet) >= 20 and packet[0] >> 4 == 4 else None
            if target is None:
                continue
            totals["packets"] += 1
            totals["bytes"] += len(packet)
            if options.cut and cut_until is None and totals["bytes"] > options.cut[0] * 1000:
                cut_until = now + options.cut[1]
            is_cut = cut_until is not None and now < cut_until
            at = now
            for link in (up[devices[device].address], down[target.address]):
                begin = max(at, link.free_at)
                if begin - at > QUEUE_SECONDS:
                    at = None
                    break
                link.free_at = at = begin + len(packet) * 8 / options.rate
            if at is None:
                totals["late"] += 1
            elif is_cut or chance.random() < options.loss:
                totals["lost"] += 1
            else:
                count += 1
                heapq.heappush(on_their_way, (at + options.delay, count, target, packet))
    print(f"the link: {totals}, {time.monotonic() - start:.1f} s", file=sys.stderr)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rate", type=float, default=1e6)
    parser.add_argument("--delay", type=float, default=0.3)
    parser.add_argument("--loss", type=float, default=0.05)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--cut", type=lambda text: [float(part) for part in text.split(":")])
    parser.add_argument("commands", nargs="+")
    options = parser.parse_args()
    machines = []
    try:
        for number, command in enumerate(options.commands, 1):
            machines.append(Machine(number, command))
        relay(machines, options)
    finally:
        for machine in machines:
            if machine.process.poll() is None:
                machine.process.kill()
                machine.process.wait()
    return max(machine.process.returncode for machine in machines)


if __name__ == "__main__":
    sys.exit(main())
