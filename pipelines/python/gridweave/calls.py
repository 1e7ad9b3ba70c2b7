"""The memory that a stage shares with the program that has started it, and the doorbells between them."""

import ctypes
import os
import weakref
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path
from typing import Any

import iceoryx2 as iox2  # type: ignore[import-untyped]  # it has no types

from .msg import encode_into, size
from .stages import PROTOCOL, About

#: How many samples may wait for the other side.
CREDITS = 16
#: How many messages may be kept in shared memory; further ones are copied.
HELD = 28
_MOST = ctypes.c_uint8 * (1 << 46)


class What(IntEnum):
    """Kind of a sample."""

    START = 1
    MESSAGE = 2
    FINISH = 3
    ABORT = 4
    NEXT = 5
    OUTPUT = 16
    WARNING = 17
    DONE = 18
    FAILED = 19
    END = 20


class Header(ctypes.Structure):
    """Header of every sample: `CallHeader` of `runtime/src/program/header.rs`."""

    _fields_ = [
        ("version", ctypes.c_uint32), ("what", ctypes.c_uint32), ("port", ctypes.c_uint32), ("wire", ctypes.c_uint32),
        ("sequence", ctypes.c_uint64), ("log_time", ctypes.c_uint64), ("publish_time", ctypes.c_uint64),
        ("length", ctypes.c_uint64), ("flags", ctypes.c_uint32), ("channel", ctypes.c_uint32),
        ("log_sequence", ctypes.c_uint32), ("reserved", ctypes.c_uint32),
        ("robot", ctypes.c_char * 64), ("topic", ctypes.c_char * 128),
    ]

    @staticmethod
    def type_name() -> str:
        """The name by which iceoryx2 knows it."""
        return "gridweave_call_header_1"


@dataclass(frozen=True)
class Call:
    """A call of the stage."""

    what: int
    port: int
    about: About
    #: The bytes of a message in shared memory. They stay there for as long as anything refers to them.
    data: memoryview


class Calls:
    """The side of the program in the protocol of a call."""

    def __init__(self, folder: str, doorbell_in: int, doorbell_out: int):
        prefix = Path(folder).name
        self._in, self._out = doorbell_in, doorbell_out
        self._credits, self._waiting, self._held = CREDITS, 0, 0
        self._is_called = False
        config = iox2.config.default()
        config.global_cfg.prefix = iox2.FileName.new(prefix)
        config.global_cfg.root_path = iox2.Path.new(folder)
        config.global_cfg.node.cleanup_dead_nodes_on_creation = False
        config.global_cfg.node.cleanup_dead_nodes_on_destruction = False
        builder = iox2.NodeBuilder.new().config(config).signal_handling_mode(iox2.SignalHandlingMode.Disabled)
        self._node = builder.create(iox2.ServiceType.Ipc)
        self._subscriber = self._open(f"{prefix}/call/to").subscriber_builder().create()
        publisher = self._open(f"{prefix}/call/from").publisher_builder().initial_max_slice_len(4096)
        publisher = publisher.allocation_strategy(iox2.AllocationStrategy.PowerOfTwo).max_loaned_samples(1)
        self._publisher = publisher.backpressure_strategy(iox2.BackpressureStrategy.DiscardData).create()
        # Only who has received once is connected.
        self._subscriber.receive()
        os.write(self._out, b"r")

    def _open(self, name: str) -> Any:
        builder = self._node.service_builder(iox2.ServiceName.new(name))
        return builder.publish_subscribe(iox2.Slice[ctypes.c_uint8]).user_header(Header).open()

    def wait(self) -> Call | None:
        """Waits for the next call; None when there are no more."""
        self._is_called = False
        while self._waiting == 0:
            if not self._listen():
                return None
        self._waiting -= 1
        sample = self._subscriber.receive()
        header = sample.user_header().contents
        if header.version != PROTOCOL:
            raise RuntimeError(f"the stage speaks version {header.version} of the protocol, and this package {PROTOCOL}")
        about = About(header.robot.decode(), header.log_time, header.topic.decode(), header.wire)
        self._is_called = True
        return Call(header.what, header.port, about, self._bytes(sample))

    def _bytes(self, sample: Any) -> memoryview:
        """The bytes of a sample, which is given back when nothing refers to them any more."""
        memory = _MOST.from_address(sample.payload_ptr)
        view = memoryview(memory).cast("B")[: sample.payload().len()].toreadonly()
        if self._held >= HELD:
            copied = memoryview(bytes(view))
            sample.delete()
            return copied
        self._held += 1
        weakref.finalize(memory, self._give_back, sample)
        return view

    def _give_back(self, sample: Any) -> None:
        self._held -= 1
        sample.delete()

    def _listen(self) -> bool:
        """Waits for doorbell events. Returns False at the end."""
        events = os.read(self._in, 256)
        self._waiting += events.count(b"m")
        self._credits += events.count(b"c")
        return bool(events)

    def send(self, port: int, message: Any, robot: str, log_time: int = 0) -> None:
        """Sends a message on an output, written straight into the memory that the stage reads. Of a source it has a log time."""
        name = robot.encode()
        if len(name) > 64:
            raise ValueError(f"the name of the robot `{robot}` has {len(name)} bytes, and at most 64 fit")
        self._send(What.OUTPUT, port, name, size(message), lambda data: encode_into(message, data), log_time)

    def notify(self, what: What, text: str = "") -> None:
        """Sends a notification that is no message."""
        data = text.encode(errors="replace")

        def write(memory: memoryview) -> None:
            memory[:] = data

        self._send(what, 0, b"", len(data), write)

    def _send(self, what: What, port: int, robot: bytes, length: int, write: Any, log_time: int = 0) -> None:
        if not self._is_called:
            raise RuntimeError("a stage sends while it handles a message, not from threads of its own at other times")
        while self._credits == 0:
            if not self._listen():
                raise SystemExit
        sample = self._publisher.loan_slice_uninit(length)
        header = sample.user_header().contents
        header.version, header.what, header.port, header.robot, header.log_time = PROTOCOL, what, port, robot, log_time
        write(memoryview(_MOST.from_address(sample.payload_ptr)).cast("B")[:length])
        sample.assume_init().send()
        self._credits -= 1
        os.write(self._out, b"s")
