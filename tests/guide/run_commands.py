"""Every command that the user guide shows does what it says: it is run, in a folder with files of the names that its page uses.

    python3 tests/guide/run_commands.py target/debug/gridweave [options of unittest]

GRIDWEAVE may name the command instead. With GRIDWEAVE_PYTHON, an interpreter in which the package is installed, the commands on stages
in Python are run, too. Python 3.10 or later, and no packages.

A command is a line in an indented or fenced block that begins with `gridweave ` or `mkdir `, with the lines that `\\` ties to it and
without its comment; or a text in backticks that begins with `gridweave `, of three words or more. Those of a page run in their order,
in one folder. A command that cannot be run is in `EXCEPTED`, with the reason.
"""

import json
import math
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import textwrap
import threading
import unittest
import urllib.request
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGES = [
    "README.md",
    "pipelines/README.md",
    "pipelines/WALKTHROUGH.md",
    "pipelines/python/README.md",
    "pipelines/python/STAGES.md",
    *sorted(str(page.relative_to(ROOT)) for page in (ROOT / "pipelines/guide").glob("*.md")),
]
#: Seconds that a command may take before it is killed, and the test fails.
WATCHDOG = 180

#: What cannot be run, and why.
EXCEPTED = {
    "gridweave compare --pipelines tag_merge pipelines/python/examples/tag_merge_opencv.toml --inputs LOG...":
        "needs OpenCV; the tests `python_stages` of tests/end_to_end run this pipeline",
    "gridweave play LOG": "needs a live run; `gridweave play log.mcap --rate 5` is run beside one",
    "gridweave run NAME": "stands for any pipeline",
    "gridweave merge --summary": "names an option",
}

#: What the placeholders of the pages stand for. Of several that fit, the first is taken.
PLACEHOLDERS = {
    "robot1=BAG": "robot1=robot1_bag",
    "robot2=BAG": "robot2=robot2_bag",
    "LOG...": "log.mcap",
    "LOG": "log.mcap",
    "OUT": "out.mcap",
    "OUT.mcap": "out.mcap",
    " run ...": " run map_merge --input log.mcap --output out.mcap",
}

#: What they stand for in one command, and what else is put in: ports that are free, so that a test can run beside another.
OF_COMMAND = {
    "gridweave cat LOG --topic /map --max-array 9": {"LOG": "merged.mcap"},
    "gridweave merge LOG -o merged.mcap --reference robot1 --initial robot2=5.0,3.0,1.57": {"LOG": "known.mcap"},
    "gridweave merge LOG -o merged.mcap --reference robot1 --initial robot2=5.0,3.0,1.57 --accept robot2=initial":
        {"LOG": "known.mcap"},
    "gridweave merge LOG -o merged.mcap --accept robot2=2": {"LOG": "alike.mcap"},
    "gridweave merge LOG -o merged.mcap --explain robot2": {"LOG": "alike.mcap"},
    "gridweave merge robot1=BAG robot2=BAG -o merged.mcap --rename /slam/map=/map":
        {"robot1=BAG": "robot1=slam1_bag", "robot2=BAG": "robot2=slam2_bag"},
    "gridweave merge LOG -o merged.mcap --rename '/{robot}/slam/map=/{robot}/map'": {"LOG": "slam.mcap"},
    "gridweave run my_merge.toml --input LOG --output merged.mcap": {"LOG": "fleet.mcap"},
    "gridweave info NAME.part": {"NAME.part": "killed.mcap.part"},
    "gridweave golden --partial --cases FOLDER --bless": {"FOLDER": "examples/golden"},
    "gridweave simulate -o LOG": {"LOG": "simulated.mcap"},
    "gridweave view": {"view": "view --address 127.0.0.1:0"},
    "gridweave run live_merge -o OUT --view": {"OUT": "seen.mcap", "--view": "--view=127.0.0.1:0"},
}

#: The exit statuses that are not 0, as the pages say.
STATUS = {
    "gridweave merge LOG -o merged.mcap --explain robot2": 3,
}

#: Commands that go on until they are interrupted, with what they print once they are ready.
UNTIL_INTERRUPTED = {
    "gridweave run live_merge --output merged.mcap": "has started",
    "gridweave run live_merge -o OUT --view": "has started",
    "gridweave top": "STAGE",
    "gridweave view": "open http://",
    "gridweave record -o some.mcap robots fuser": None,
}

#: The order of the commands of a page, where it is not that of the page: what watches a run is there before messages are, and is
#: interrupted before it, in the order given here.
LIVE = "pipelines/guide/live.md"
LIVE_WATCHERS = [
    "gridweave top",
    "gridweave view",
    "gridweave record -o some.mcap robots fuser",
]
LIVE_TAP = "gridweave tap icp.alignment --json --count 3"
LIVE_IN_ORDER = ["gridweave play log.mcap --rate 5", "gridweave top --once --json"]
LIVE_RUN = "gridweave run live_merge --output merged.mcap"

#: Commands that need the package for Python.
NEED_PYTHON = [
    "gridweave kinds invert.py",
    "gridweave check my.toml",
    "gridweave run my.toml --input LOG --output out.mcap --engine processes",
    "gridweave golden --partial --cases FOLDER --bless",
]

#: Options whose value is a file or folder that the command writes.
WRITES = ["-o", "--output", "--map", "--picture", "--summary", "--csv", "--trace", ">"]


def commands_of(page):
    """The commands that a page shows, in their order."""
    found, prose, fence, tied = [], "", None, None
    # A last line ends the last paragraph.
    for line in [*(ROOT / page).read_text().splitlines(), "```"]:
        mark = re.match(r"\s*(```+)", line)
        is_prose = not (mark or fence or tied) and line.strip() and not line.startswith("    ")
        if is_prose:
            # In a paragraph a text in backticks may go on in the next line.
            prose += line.strip() + " "
            continue
        found += [text for text in re.findall(r"`(gridweave [^`]+)`", prose) if len(text.split()) > 2]
        prose = ""
        if mark:
            fence = None if fence else mark[1]
            continue
        text = line.strip()
        if tied is not None:
            text, tied = f"{tied} {text}", None
        if not text.startswith(("gridweave ", "mkdir ")):
            continue
        if text.endswith("\\"):
            tied = text[:-1].rstrip()
            continue
        found.append(without_comment(text))
    return found


def without_comment(text):
    """A line without the comment of the shell behind it."""
    quote = None
    for at, letter in enumerate(text):
        if quote is None and letter == "#" and text[at - 1].isspace():
            return text[:at].rstrip()
        if letter in "'\"":
            quote = letter if quote is None else None if quote == letter else quote
    return text


def blocks(page):
    """The blocks of a page, indented and fenced ones."""
    text = (ROOT / page).read_text()
    for fenced, indented in re.findall(r"^```\w+\n([^`]*)^```|^((?:    .*\n|\n(?=    ))+)", text, re.MULTILINE):
        yield fenced or textwrap.dedent(indented).lstrip("\n")


class Started:
    """A command that is running, in a process group of its own."""

    def __init__(self, command, folder, environment):
        self.command = command
        self.printed, self.changed = "", threading.Condition()
        self.process = subprocess.Popen(
            ["bash", "-c", command], cwd=folder, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT, text=True, errors="replace", start_new_session=True,
        )
        self.reader = threading.Thread(target=self._read, daemon=True)
        self.reader.start()

    def _read(self):
        for line in self.process.stdout:
            with self.changed:
                self.printed += line
                self.changed.notify_all()
        with self.changed:
            self.changed.notify_all()

    def wait_for(self, text):
        """Waits until it has printed a text."""
        def is_known():
            return text in self.printed or not self.reader.is_alive()

        with self.changed:
            self.changed.wait_for(is_known, WATCHDOG)
            if text not in self.printed:
                raise AssertionError(f"`{self.command}` did not print `{text}`:\n{self.printed}")

    def interrupt(self):
        """What ctrl-c does in a terminal."""
        os.killpg(self.process.pid, signal.SIGINT)

    def end(self, status=0):
        """Waits for its end, and checks its status and that nothing of it is alive."""
        try:
            ended = self.process.wait(WATCHDOG)
        except subprocess.TimeoutExpired:
            raise AssertionError(f"`{self.command}` did not end within {WATCHDOG} s:\n{self.printed}") from None
        self.reader.join(WATCHDOG)
        if ended != status:
            raise AssertionError(f"`{self.command}` ended with {ended}, and not {status}:\n{self.printed}")
        if self._is_group_alive():
            raise AssertionError(f"`{self.command}` has left processes")
        for run in re.findall(r"live run (gw\w+) has started", self.printed):
            if left := [file for file in os.listdir("/dev/shm") if run in file]:
                raise AssertionError(f"`{self.command}` has left {len(left)} files in /dev/shm, such as {left[0]}")
        return self.printed

    def _is_group_alive(self):
        try:
            os.killpg(self.process.pid, 0)
        except ProcessLookupError:
            return False
        return True

    def stop(self):
        """After a failure: ends it in order, so that it leaves nothing, or else kills it."""
        for how, seconds in (signal.SIGINT, 20), (signal.SIGKILL, None):
            if self._is_group_alive():
                os.killpg(self.process.pid, how)
            try:
                self.process.wait(seconds)
                break
            except subprocess.TimeoutExpired:
                pass
        self.reader.join(WATCHDOG)
        self.process.stdout.close()


class Folder:
    """A folder of its own for the commands of a page."""

    def __init__(self, test, inputs=None):
        self.test, self.started = test, []
        holder = tempfile.TemporaryDirectory(prefix="gridweave-guide-")
        test.addCleanup(holder.cleanup)
        test.addCleanup(lambda: [started.stop() for started in reversed(self.started)])
        self.path = Path(holder.name) / "work"
        if inputs:
            shutil.copytree(inputs, self.path)
        else:
            self.path.mkdir()
        home, runs, programs = (Path(holder.name) / name for name in ("home", "runs", "bin"))
        for folder in (home, runs, programs):
            folder.mkdir(mode=0o700)
        (programs / "gridweave").symlink_to(GRIDWEAVE)
        self.environment = {
            **{name: value for name, value in os.environ.items() if not name.startswith("GRIDWEAVE")},
            "PATH": f"{programs}:{os.environ['PATH']}", "HOME": str(home), "XDG_RUNTIME_DIR": str(runs), "COLUMNS": "120",
        }
        if PYTHON:
            self.environment["GRIDWEAVE_PYTHON"] = str(Path(PYTHON).absolute())

    def start(self, command):
        """Starts a command of a page, with what its placeholders stand for."""
        text = command
        of_command = OF_COMMAND.get(command, {})
        for name, value in {**of_command, **PLACEHOLDERS}.items():
            value = of_command.get(name, value)
            ahead, behind = (r"(?<![\w./-])" if re.match(r"[\w-]", name) else "", r"(?![\w./])" if name[-1] != "." else "")
            text = re.sub(ahead + re.escape(name) + behind, lambda _: value, text)
        self.started.append(Started(text, self.path, self.environment))
        return self.started[-1]

    def run(self, command):
        """Runs a command of a page to its end, and checks that it has written what it says."""
        started = self.start(command)
        if command in UNTIL_INTERRUPTED:
            started.wait_for(UNTIL_INTERRUPTED[command])
            started.interrupt()
        printed = started.end(STATUS.get(command, 0))
        words = shlex.split(started.command)
        for option, value in zip(words, words[1:]):
            file = Path(value.replace("~", self.environment["HOME"], 1))
            if option in WRITES and not ((self.path / file).is_dir() or (self.path / file).stat().st_size > 0):
                raise AssertionError(f"`{started.command}` has written nothing to {value}")
        return printed


class Inputs(unittest.TestCase):
    """The files that the pages name, made by the command itself."""

    @classmethod
    def setUpClass(cls):
        holder = tempfile.TemporaryDirectory(prefix="gridweave-guide-")
        cls.addClassCleanup(holder.cleanup)
        cls.inputs = Path(holder.name) / "inputs"
        folder = Folder(_Maker(cls))
        folder.path.rmdir()
        folder.path = cls.inputs
        folder.path.mkdir()
        make_inputs(folder)


class _Maker:
    """Where the inputs are made no test is running."""

    def __init__(self, owner):
        self.addCleanup = owner.addClassCleanup


def make_inputs(folder):
    path = folder.path

    def gridweave(arguments):
        folder.start(f"gridweave {arguments}").end()

    def copy(log, *names):
        for name in names:
            shutil.copy(path / log, path / name)
            shutil.copy((path / log).with_suffix(".truth.json"), (path / name).with_suffix(".truth.json"))

    # Two robots that drive fast through a building, and tell their maps early.
    gridweave("simulate -o whole.mcap --robots 2 --set speed=5 --set snapshots=8")
    gridweave("convert whole.mcap -o log.mcap --end 50")
    shutil.copy(path / "whole.truth.json", path / "log.truth.json")
    copy("log.mcap", "robots.mcap", "one.mcap")
    (path / "logs").mkdir()
    copy("log.mcap", "logs/two.mcap")
    # All rooms are alike: the maps fit at several places.
    gridweave("simulate -o alike.mcap --robots 2 --set speed=5 --set layout=repeated --set tags=0 --set clutter=0")

    for robot in ("robot1", "robot2"):
        number = robot[-1]
        # A robot that knows of no other.
        renames = f"--rename /{robot}/map=/map --rename /{robot}/pose=/amcl_pose"
        gridweave(f"convert whole.mcap -o {robot}_bag/ --topics /map,/amcl_pose {renames}")
        renames = f"--rename /{robot}/map=/slam/map --rename /{robot}/pose=/pose"
        gridweave(f"convert whole.mcap -o slam{number}_bag/ --topics /slam/map,/pose {renames}")
        gridweave(f"merge whole.mcap --robots {robot} -o {robot}.yaml")
        (path / robot).mkdir()
        copy_map(path / f"{robot}.yaml", path / robot / "map.yaml")
    gridweave("convert log.mcap -o slam.mcap --rename '/{robot}/map=/{robot}/slam/map'")
    gridweave("convert log.mcap -o fleet.mcap --rename '/{robot}/map=/fleet/{robot}/slam/map'"
              " --rename '/{robot}/tag_ranges=/fleet/{robot}/uwb'")

    # Two map files, and a log of the same maps, with the second map frame where the pages say that it is.
    truth = json.loads((path / "whole.truth.json").read_text())["frames"]["robot2"]
    copy_map(path / "robot1.yaml", path / "a.yaml")
    copy_map(path / "robot2.yaml", path / "b.yaml", (truth["x"], truth["y"], truth["yaw"]), (5.0, 3.0, 1.57))
    (path / "known").mkdir()
    copy_map(path / "a.yaml", path / "known/robot1.yaml")
    copy_map(path / "b.yaml", path / "known/robot2.yaml")
    gridweave("run map_files_to_log --input known/robot1.yaml --input known/robot2.yaml --output known.mcap")
    # Topological maps that were drawn by hand: ways of different lengths, one behind the other.
    places = [(0, 0), (7, 0), (7, 4), (-3, 4), (-3, 15), (9, 15), (9, 9), (24, 9)]
    nodes = [{"x": x, "y": y} for x, y in places]
    paths = [{"start": start, "end": start + 1} for start in range(len(places) - 1)]
    for name in ("a.json", "b.json"):
        (path / name).write_text(json.dumps({"nodes": nodes, "paths": paths}))
    # What pages go on from.
    copy_map(path / "robot2.yaml", path / "map.yaml")
    shutil.copytree(ROOT / "pipelines/python/examples", path / "examples")
    shutil.copy(path / "log.truth.json", path / "truth.json")
    gridweave("merge log.mcap -o merged.mcap --summary summary.json")
    gridweave("pipelines auto_merge > my_merge.toml")
    # What a program leaves that was killed before the end.
    whole = (path / "merged.mcap").read_bytes()
    (path / "killed.mcap.part").write_bytes(whole[: len(whole) * 3 // 4])


def copy_map(source, target, pose=(0.0, 0.0, 0.0), wanted=(0.0, 0.0, 0.0)):
    """Copies a map file; the map frame, which has a pose in some frame, gets another one there."""
    shutil.copy(source.with_suffix(".pgm"), target.with_suffix(".pgm"))
    text = source.read_text().replace(source.with_suffix(".pgm").name, target.with_suffix(".pgm").name)
    x, y, yaw = (float(number) for number in re.search(r"origin: \[(.*)\]", text)[1].split(","))
    outer = compose(compose(inverse(wanted), pose), (x, y, yaw))
    target.write_text(re.sub(r"origin: .*", f"origin: [{', '.join(repr(number) for number in outer)}]", text))


def compose(a, b):
    cos, sin = math.cos(a[2]), math.sin(a[2])
    return a[0] + cos * b[0] - sin * b[1], a[1] + sin * b[0] + cos * b[1], a[2] + b[2]


def inverse(a):
    cos, sin = math.cos(a[2]), math.sin(a[2])
    return -cos * a[0] - sin * a[1], sin * a[0] - cos * a[1], -a[2]


class CommandsTest(Inputs):
    """What the pages show works."""

    def run_page(self, page):
        folder, robots = Folder(self, self.inputs), None
        for command in commands_of(page):
            with self.subTest(command=command):
                if command in EXCEPTED:
                    continue
                if command in NEED_PYTHON and not PYTHON:
                    continue
                if command.startswith("gridweave run my_merge.toml"):
                    robots = next(block for block in blocks(page) if block.startswith("[robots]"))
                    replace_section(folder.path / "my_merge.toml", robots)
                if command == NEED_PYTHON[0]:
                    make_python_stage(folder.path, next(block for block in blocks(page) if block.startswith("[stages.invert]")))
                printed = folder.run(command)
                if command.startswith("gridweave merge") and not STATUS.get(command):
                    self.assertIn("merged 2 of 2 robots", printed)
                if command.startswith("gridweave run my_merge.toml"):
                    self.assertIn("merged 2 of 2 robots", printed)
                if command.endswith("--explain robot2"):
                    refusal = next(block for block in blocks(page) if block.startswith("not merged: robot2:"))
                    self.assertIn(refusal.strip(), printed)

    def test_live(self):
        shown = commands_of(LIVE)
        together = [LIVE_RUN, LIVE_TAP, *LIVE_WATCHERS, *LIVE_IN_ORDER]
        self.assertEqual([command for command in together if command not in shown], [], f"{LIVE} does not show them")
        folder = Folder(self, self.inputs)
        run = folder.start(LIVE_RUN)
        run.wait_for(UNTIL_INTERRUPTED[LIVE_RUN])
        tap = folder.start(LIVE_TAP)
        watchers = [folder.start(command) for command in LIVE_WATCHERS]
        for watcher, command in zip(watchers, LIVE_WATCHERS):
            if text := UNTIL_INTERRUPTED[command]:
                watcher.wait_for(text)
        printed = [folder.run(command) for command in LIVE_IN_ORDER]
        self.assertEqual(json.loads(printed[1])["pipeline"], "live_merge")
        messages = [json.loads(line) for line in tap.end().splitlines()]
        self.assertEqual([message["topic"] for message in messages], ["/icp/alignment"] * 3)
        address = re.search(r"http://\S+", watchers[1].printed)[0]
        with urllib.request.urlopen(address, timeout=WATCHDOG) as page:
            self.assertIn(b"<html", page.read())
        for watcher in watchers:
            watcher.interrupt()
            watcher.end()
        self.assertGreater((folder.path / "some.mcap").stat().st_size, 0)
        run.interrupt()
        self.assertIn("merged 2 of 2 robots", run.end())
        for command in [command for command in shown if command not in together]:
            with self.subTest(command=command):
                self.assertNotIn(command, EXCEPTED)
                folder.run(command)

    def test_every_command_that_is_named_here_is_on_a_page(self):
        shown = {command for page in PAGES for command in commands_of(page)}
        named = {*EXCEPTED, *OF_COMMAND, *STATUS, *UNTIL_INTERRUPTED, *NEED_PYTHON}
        self.assertEqual(sorted(named - shown), [])

    def test_a_command_is_found_in_every_kind_of_block(self):
        self.assertGreater(len([command for page in PAGES for command in commands_of(page)]), 50)
        self.assertEqual(without_comment("gridweave info 'a#b' # c"), "gridweave info 'a#b'")


def replace_section(file, section):
    """Puts a section in place of that of its name."""
    name = section.split("\n", 1)[0]
    text, count = re.subn(rf"^{re.escape(name)}.*\n(?:(?!\[).*\n)*", lambda _: section, file.read_text(), flags=re.MULTILINE)
    assert count == 1, f"{file} has {count} sections {name}"
    file.write_text(text)


def make_python_stage(path, section):
    """A pipeline with the section that the page shows, and the stage beside it."""
    shutil.copy(ROOT / "pipelines/python/examples/invert.py", path)
    (path / "my.toml").write_text(
        '[pipeline]\nname = "my"\n\n[stages.log]\nkind = "mcap_source"\n\n' + section
        + '\n[stages.out]\nkind = "mcap_sink"\ninputs = ["invert"]\n'
    )


def _test_of(page):
    def test(self):
        self.run_page(page)

    return test


for _page in PAGES:
    if _page != LIVE and commands_of(_page):
        _name = re.sub(r"\W+", "_", _page.removesuffix(".md"))
        setattr(CommandsTest, f"test_page_{_name}", _test_of(_page))

GRIDWEAVE = Path(os.environ.get("GRIDWEAVE", ROOT / "target/debug/gridweave")).absolute()
PYTHON = os.environ.get("GRIDWEAVE_PYTHON")

if __name__ == "__main__":
    if len(sys.argv) > 1 and Path(sys.argv[1]).is_file():
        GRIDWEAVE = Path(sys.argv.pop(1)).absolute()
    if not GRIDWEAVE.is_file():
        sys.exit(f"there is no command {GRIDWEAVE}: give its path")
    unittest.main()
