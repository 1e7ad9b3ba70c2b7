"""Merging and reading in other processes and threads than that of the import."""

import concurrent.futures
import multiprocessing
import tempfile
import unittest
import warnings
from pathlib import Path

from gridweave import merge, read_log

from test_merge import room


def frame(_):
    return merge([room(), room(12, 7)], resolution=0.05).frames["robot2"].matrix.tolist()


class ProcessTest(unittest.TestCase):
    def test_a_child_made_by_fork_merges_as_its_parent(self):
        expected = frame(0)
        with warnings.catch_warnings():
            # Python 3.12 and later warn of threads that a child does not have.
            warnings.simplefilter("ignore", DeprecationWarning)
            with multiprocessing.get_context("fork").Pool(2) as pool:
                self.assertEqual(pool.map_async(frame, range(2)).get(timeout=120), [expected] * 2)

    def test_a_log_is_read_on_in_other_threads(self):
        with tempfile.TemporaryDirectory() as folder:
            log = Path(folder) / "merged.mcap"
            merge([room(), room(12, 7)], resolution=0.05, output=log)
            expected = [(logged.topic, logged.data) for logged in read_log(log)]
            messages = read_log(log)
            read = []
            for _ in expected:
                with concurrent.futures.ThreadPoolExecutor(1) as thread:
                    logged = thread.submit(next, messages).result()
                    read.append((logged.topic, logged.data))
            self.assertEqual(read, expected)
