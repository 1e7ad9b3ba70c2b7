"""The program of a stage, as the stage that starts it sees it: the protocol of a call."""

import ctypes
import json
import os
import signal
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import iceoryx2 as iox2

from gridweave import msg
from gridweave.calls import CREDITS, HELD, Header, What
from gridweave.load import load
from gridweave.msg.nav_msgs import OccupancyGrid
from gridweave.stages import PROTOCOL

STAGE = '''
import os, signal, threading, time
import numpy as np
from gridweave import Input, Output, Parameter, Stage
from gridweave.msg.nav_msgs import OccupancyGrid

class Troubled(Stage):
    """Has the trouble that its parameters select."""
    map = Input(OccupancyGrid)
    out = Output(OccupancyGrid)
    what = Parameter("copy")
    level = Parameter(1.5)

    def __init__(self):
        self.kept = []
        print("what a stage prints rings no doorbell")

    def on_map(self, map, about):
        getattr(self, self.what)(map, about)

    def copy(self, map, about):
        self.out.send(map, about.robot)

    def many(self, map, about):
        for cell in range(100):
            self.out.send(OccupancyGrid(data=[cell]), about.robot)

    def keep(self, map, about):
        self.kept.append(map.data)

    def wrong(self, map, about):
        return 1 / 0

    def kill(self, map, about):
        os.kill(os.getpid(), signal.SIGKILL)

    def exit(self, map, about):
        raise SystemExit(3)

    def finish(self):
        self.out.send(OccupancyGrid(data=[int(kept.sum()) for kept in self.kept]), "all")

    def abort(self, reason):
        self.warn(f"aborted: {reason}")
'''


class Host:
    """The other side, as `runtime/src/program/call.rs` is."""

    def __init__(self, folder, module):
        self.folder = folder
        prefix = f"gw{os.getpid()}_0123456789abcdef_"
        path = Path(folder) / prefix
        path.mkdir()
        config = iox2.config.default()
        config.global_cfg.prefix = iox2.FileName.new(prefix)
        config.global_cfg.root_path = iox2.Path.new(str(path))
        node = iox2.NodeBuilder.new().config(config).signal_handling_mode(iox2.SignalHandlingMode.Disabled)
        self.node = node.create(iox2.ServiceType.Ipc)
        services = [self.service(f"{prefix}/call/to", 1), self.service(f"{prefix}/call/from", CREDITS)]
        publisher = services[0].publisher_builder().initial_max_slice_len(64)
        self.publisher = publisher.allocation_strategy(iox2.AllocationStrategy.PowerOfTwo).create()
        self.subscriber = services[1].subscriber_builder().create()
        self.prefix = prefix
        self.module = module
        self.process = subprocess.Popen([sys.executable, "-m", "gridweave.program", module, str(path)], stdin=subprocess.PIPE,
                                        stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        assert self.process.stdout.read(1) == b"r"

    def service(self, name, buffer):
        builder = self.node.service_builder(iox2.ServiceName.new(name)).publish_subscribe(iox2.Slice[ctypes.c_uint8])
        builder = builder.user_header(Header).enable_safe_overflow(False).history_size(0).subscriber_max_buffer_size(buffer)
        return builder.subscriber_max_borrowed_samples(32).max_publishers(1).max_subscribers(1).max_nodes(2).create()

    def call(self, what, data=b"", robot=b"robot1"):
        sample = self.publisher.loan_slice_uninit(len(data))
        header = sample.user_header().contents
        header.version, header.what, header.port, header.robot, header.log_time = PROTOCOL, what, 0, robot, 7
        ctypes.memmove(sample.payload_ptr, data, len(data))
        sample.assume_init().send()
        self.ring(b"m")
        answers = []
        while True:
            if self.process.stdout.read(1) != b"s":
                return answers, None
            sample = self.subscriber.receive()
            header = sample.user_header().contents
            said, robot = What(header.what), header.robot
            if said is What.OUTPUT:
                self.log_time = header.log_time
            payload = ctypes.string_at(sample.payload_ptr, sample.payload().len())
            sample.delete()
            self.ring(b"c")
            if said in (What.DONE, What.FAILED):
                return answers, (said, payload.decode())
            answers.append((said, robot, payload))

    def ring(self, event):
        try:
            os.write(self.process.stdin.fileno(), event)
        except BrokenPipeError:
            pass

    def start(self, **parameters):
        interface = json.dumps(load(self.module).interface())
        start = {"stage": "troubled", "parameters": parameters, "seed": 2**63, "reference": None, "robots": {}, "inputs": [],
                "interface": interface}
        return self.call(What.START, json.dumps(start).encode())

    def end(self):
        self.process.stdin.close()
        self.process.wait(10)
        errors = self.process.stderr.read().decode()
        self.process.stdout.close()
        self.process.stderr.close()
        self.publisher = self.subscriber = self.node = None
        for file in Path("/dev/shm").glob(f"{self.prefix}*"):
            file.unlink()
        return self.process.returncode, errors


class RunTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        module = Path(folder.name) / "troubled.py"
        module.write_text(STAGE)
        self.host = Host(folder.name, str(module))
        self.addCleanup(lambda: self.host.process.returncode is None and self.host.end())

    def grid(self, cells):
        return msg.encode(OccupancyGrid(data=cells))

    def decoded(self, answers):
        return [msg.decode(OccupancyGrid, memoryview(data)).data.tolist() for _, _, data in answers]

    def test_messages_keep_their_robot_and_the_program_ends_with_the_calls(self):
        self.assertEqual(self.host.start(), ([], (What.DONE, "")))
        for size in (1, 100, 100_000):
            answers, end = self.host.call(What.MESSAGE, self.grid([1] * size))
            self.assertEqual((self.decoded(answers), answers[0][1], end), ([[1] * size], b"robot1", (What.DONE, "")))
        status, errors = self.host.end()
        self.assertEqual((status, errors), (0, "what a stage prints rings no doorbell\n"))

    def test_more_than_there_is_room_for_comes_in_order(self):
        self.host.start(what="many")
        answers, _ = self.host.call(What.MESSAGE, self.grid([]))
        self.assertEqual(self.decoded(answers), [[cell] for cell in range(100)])

    def test_messages_that_are_kept_stay_as_they_were_however_many(self):
        self.host.start(what="keep")
        for number in range(3 * HELD):
            self.assertEqual(self.host.call(What.MESSAGE, self.grid([number] * 5000))[1], (What.DONE, ""))
        with self.subTest("sums are too large for cells, which is reported"):
            _, (said, text) = self.host.call(What.FINISH)
            self.assertEqual(said, What.FAILED)
            self.assertIn("`data` takes int8", text)

    def test_a_message_that_cannot_be_read_is_left_out_with_a_warning(self):
        self.host.start()
        answers, end = self.host.call(What.MESSAGE, b"\0\1\0\0nonsense")
        (said, _, text), = answers
        self.assertEqual((said, end[0]), (What.WARNING, What.DONE))
        self.assertIn(b"messages on the input `map` that cannot be read are left out", text)

    def test_an_error_is_reported_with_its_origin(self):
        self.host.start(what="wrong")
        _, (said, text) = self.host.call(What.MESSAGE, self.grid([1]))
        self.assertEqual(said, What.FAILED)
        self.assertTrue(text.startswith("ZeroDivisionError: division by zero\nTraceback"), text)
        self.assertIn("in wrong\n    return 1 / 0", text)
        self.assertNotIn("gridweave/run.py", text)

    def test_an_exit_is_an_error(self):
        self.host.start(what="exit")
        _, (said, text) = self.host.call(What.MESSAGE, self.grid([1]))
        self.assertEqual((said, text.splitlines()[0]), (What.FAILED, "SystemExit: 3"))

    def test_a_killed_program_is_noticed_at_its_doorbell(self):
        self.host.start(what="kill")
        self.assertEqual(self.host.call(What.MESSAGE, self.grid([1])), ([], None))
        self.assertEqual(self.host.end()[0], -signal.SIGKILL)

    def test_signals_of_the_terminal_are_for_the_stage(self):
        self.host.start()
        self.host.process.send_signal(signal.SIGINT)
        self.host.process.send_signal(signal.SIGTERM)
        self.assertEqual(self.host.call(What.MESSAGE, self.grid([1]))[1], (What.DONE, ""))

    def test_an_abort_reaches_the_stage(self):
        self.host.start()
        answers, end = self.host.call(What.ABORT, b"the disk is full")
        self.assertEqual((answers[0][2], end[0]), (b"aborted: the disk is full", What.DONE))

    def test_another_interface_than_the_pipeline_knows_is_refused(self):
        start = {"stage": "a", "parameters": {}, "seed": 0, "reference": None, "robots": {}, "inputs": [], "interface": "{}"}
        _, (said, text) = self.host.call(What.START, json.dumps(start).encode())
        self.assertEqual(said, What.FAILED)
        self.assertIn("other ports or parameters", text)


SOURCE = '''
from gridweave import Output, Parameter, Stage
from gridweave.msg.nav_msgs import OccupancyGrid

class Counter(Stage):
    """Counts."""
    out = Output(OccupancyGrid)
    times = Parameter([10, 20, 20])

    def messages(self):
        for time in self.times:
            self.out.send(OccupancyGrid(data=[time]), "robot1", log_time=time)
            yield
        self.out.send(OccupancyGrid(), log_time=99)

    def abort(self, reason):
        self.warn(f"aborted: {reason}")
'''


class SourceTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        module = Path(folder.name) / "counter.py"
        module.write_text(SOURCE)
        self.host = Host(folder.name, str(module))
        self.addCleanup(lambda: self.host.process.returncode is None and self.host.end())

    def test_a_source_gives_what_is_next_until_its_end(self):
        self.host.start()
        for time in (10, 20, 20):
            (said, robot, _), = self.host.call(What.NEXT)[0]
            self.assertEqual((said, robot, self.host.log_time), (What.OUTPUT, b"robot1", time))
        answers, end = self.host.call(What.NEXT)
        self.assertEqual(([said for said, *_ in answers], end), ([What.OUTPUT, What.END], (What.DONE, "")))
        self.assertEqual(self.host.call(What.NEXT), ([(What.END, b"", b"")], (What.DONE, "")))

    def test_falling_log_times_are_reported_with_the_line(self):
        self.host.start(times=[10, 9])
        self.host.call(What.NEXT)
        answers, (said, text) = self.host.call(What.NEXT)
        self.assertEqual((answers, said), ([], What.FAILED))
        self.assertIn("ValueError: the log time 9 ns comes after 10 ns", text)
        self.assertIn("self.out.send(OccupancyGrid(data=[time])", text)

    def test_an_abort_reaches_a_source(self):
        self.host.start()
        answers, end = self.host.call(What.ABORT, b"the disk is full")
        self.assertEqual((answers[0][2], end[0]), (b"aborted: the disk is full", What.DONE))


if __name__ == "__main__":
    unittest.main()
