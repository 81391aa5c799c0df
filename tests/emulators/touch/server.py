"""A live touchscreen in a umockdev test bed. Run it with the system's Python under umockdev-wrapper.

Reads one JSON object a line on stdin and answers each with one on stdout:
  {"do": "frame", "events": [[type, code, value], …], "at": seconds}   send events, stamped ``at`` on the monotonic
                                                clock (default now) once that time has come
  {"do": "frames", "frames": [[at, events], …], "ahead": seconds}  many of them, in order of time; each is sent
                                                "ahead" of its stamp, so that a late turn changes nothing
  {"do": "lose", "events": […]}                 the slots change, but the buffer overflows: SYN_DROPPED is sent
  {"do": "unplug"} · {"do": "plug", "number": N} · {"do": "state"} · {"do": "busy", "on": true}
"""

import contextlib
import json
import os
import queue
import struct
import sys
import termios
import threading
import time
import tty

import gi

gi.require_version("UMockdev", "1.0")
from gi.repository import GLib, UMockdev  # noqa: E402

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))


from panel import BTN_TOUCH, EV_ABS, EV_KEY, EV_SYN, PROP_DIRECT, SYN_DROPPED, SYN_REPORT, Panel, sysfs_bitmap  # noqa: E402

EVIOCGRAB, EVIOCSCLOCKID = 0x40044590, 0x400445A0
FULL_S = 1e-3  # between two looks whether a full pty was read


class Bed:
    def __init__(self, options):
        self.panel = Panel(**options)
        self.bed = UMockdev.Testbed.new()
        self.node = None
        self.known = set()
        self.fd = -1
        self.handler = UMockdev.IoctlBase()
        self.handler.connect("handle-ioctl", self.ioctl)
        self.due = queue.Queue()
        self.trouble = ""
        # The clock does not change between an event's stamp and its place in the queue, as in the kernel.
        self.stamping = threading.Lock()
        threading.Thread(target=self.send_due, daemon=True).start()

    def plug(self, number):
        if self.fd >= 0:  # it is plugged in
            return
        name = f"event{number}"
        self.node = f"/dev/input/{name}"
        panel = self.panel
        parent = self.bed.add_device(
            "input", f"input{number}", None,
            ["name", panel.name, "phys", panel.phys, "uniq", panel.uniq, "properties", sysfs_bitmap([PROP_DIRECT]),
             "capabilities/ev", sysfs_bitmap([EV_SYN, EV_KEY, EV_ABS]), "capabilities/key", sysfs_bitmap([BTN_TOUCH]),
             "capabilities/abs", sysfs_bitmap(list(panel.limits))],
            ["ID_INPUT", "1", "ID_INPUT_TOUCHSCREEN", "1"],
        )  # fmt: skip
        again = name in self.known
        self.known.add(name)
        numbers = f"13:{64 + number}"
        if again:
            fd = self.make_node(name, numbers)
        self.bed.add_from_string(
            f"P: {parent[4:]}/{name}\n" + ("" if again else f"N: input/{name}\n") + f"E: DEVNAME=/dev/input/{name}\n"
            f"E: SUBSYSTEM=input\nE: ID_INPUT=1\nE: ID_INPUT_TOUCHSCREEN=1\nA: dev={numbers}\n"
        )
        link = f"{self.bed.get_sys_dir()}/class/input/{name}/device"
        if not os.path.lexists(link):
            os.symlink(f"{self.bed.get_sys_dir()}{parent[4:]}", link)
        self.paths = (parent, f"{parent}/{name}")
        self.bed.attach_ioctl(self.node, self.handler)
        self.fd = fd if again else self.bed.get_dev_fd(self.node)
        os.set_blocking(self.fd, False)

    def make_node(self, name, numbers):
        """The end to write to, of the node of a panel that was here before.

        The test bed remembers every node, and aborts the process if asked for one again.
        """
        root = self.bed.get_root_dir()
        master, slave = os.openpty()
        tty.setraw(slave)
        pts = os.ttyname(slave)
        os.close(slave)
        os.makedirs(f"{root}/dev/input", exist_ok=True)
        os.symlink(numbers, f"{root}/dev/.ptymap/{pts.replace('/', '_')}")
        os.symlink(pts, f"{root}/dev/input/{name}")
        return master

    def unplug(self):
        if self.fd < 0:
            return
        self.bed.detach_ioctl(self.node)
        for path in reversed(self.paths):
            self.bed.uevent(path, "remove")
            self.bed.remove_device(path)
        fd, self.fd = self.fd, -1
        with contextlib.suppress(OSError):
            os.close(fd)
        # The test bed remembers the pty's number, which the next one may get again.
        known = f"{self.bed.get_root_dir()}/dev/.ptymap"
        for name in os.listdir(known):
            os.unlink(f"{known}/{name}")
        self.panel.clock, self.panel.grabbed = 0, False
        self.panel.apply(
            [event for k in range(len(self.panel.slots)) for event in ([EV_ABS, 0x2F, k], [EV_ABS, 0x39, -1])]
        )

    def ioctl(self, _base, client):
        request = client.get_request()
        arg = client.get_arg()
        if request == EVIOCGRAB:
            value = struct.unpack("l", bytes(arg.retrieve()))[0]
            client.complete(*self.panel.grab(value != 0))
            return True
        size = request >> 16 & 0x3FFF
        data = arg.resolve(0, size) if size else None
        given = bytes(data.retrieve()) if data else b""
        if request == EVIOCSCLOCKID:
            with self.stamping:
                result, error, answer = self.set_clock(given)
        else:
            result, error, answer = self.panel.answer(request, given)
        if answer and data:
            data.update(0, answer[:size])
        client.complete(result, error)
        return True

    def frame(self, events, at_s, ahead_s=0.0):
        self.due.put((at_s, events, False, ahead_s))

    def lose(self, events):
        self.due.put((None, events, True, 0.0))

    def send_due(self):
        while True:
            at_s, events, lost, ahead_s = self.due.get()
            wait_s = 0.0 if at_s is None else at_s - ahead_s - time.monotonic()
            if wait_s > 0:
                time.sleep(wait_s)
            self.panel.apply(events)
            if lost:
                events = [[EV_SYN, SYN_DROPPED, 0]]
            self.write([*events, [EV_SYN, SYN_REPORT, 0]], time.monotonic() if at_s is None else at_s)

    def write(self, events, at_s):
        """All of them, however often the pty takes a part; to an unplugged panel nothing."""
        clock, written, size = None, 0, 1
        try:
            while written < size and self.fd >= 0:
                with self.stamping:
                    if clock != self.panel.clock:  # the start is flushed
                        clock, written = self.panel.clock, 0
                        data = self.panel.pack(events, at_s if clock == 1 else at_s + time.time() - time.monotonic())
                        size = len(data)
                    with contextlib.suppress(BlockingIOError):
                        written += os.write(self.fd, data[written:])
                        continue
                time.sleep(FULL_S)
        except OSError as error:
            if self.fd >= 0:
                self.trouble = f"a frame could not be written ({error})"

    def set_clock(self, data):
        """Events that wait are stamped on the other clock: they are flushed, as in the kernel (evdev_set_clk_type)."""
        before = self.panel.clock
        result, error, _ = self.panel.answer(EVIOCSCLOCKID, data)
        if self.panel.clock != before:
            termios.tcflush(self.fd, termios.TCOFLUSH)
            slave = os.open(f"{self.bed.get_root_dir()}{self.node}", os.O_RDWR | os.O_NOCTTY)
            termios.tcflush(slave, termios.TCIFLUSH)
            os.close(slave)
        return result, error, None


def main():
    bed = Bed(json.loads(sys.argv[1]) if len(sys.argv) > 1 else {})
    loop = GLib.MainLoop()
    threading.Thread(target=loop.run, daemon=True).start()
    number = 5
    bed.plug(number)
    print(json.dumps({"root": bed.bed.get_root_dir(), "node": bed.node}), flush=True)
    for line in sys.stdin:
        command = json.loads(line)
        what = command["do"]
        answer = {}
        if what == "frame":
            bed.frame(command["events"], command.get("at"))
        elif what == "frames":
            for at_s, events in command["frames"]:
                bed.frame(events, at_s, command.get("ahead", 0.0))
        elif what == "lose":
            bed.lose(command["events"])
        elif what == "unplug":
            bed.unplug()
        elif what == "plug":
            bed.plug(command.get("number", number))
            answer = {"node": bed.node}
        elif what == "busy":
            bed.panel.grabbed_by_another = command["on"]
        elif what == "state":
            panel = bed.panel
            answer = {"clock": panel.clock, "grabbed": panel.grabbed, "grab_log": panel.grab_log,
                      "waiting": bed.due.qsize(), "trouble": bed.trouble}  # fmt: skip
        print(json.dumps(answer), flush=True)


main()
