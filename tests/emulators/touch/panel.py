"""A touch panel's kernel side: description, slots (or none), answers to ioctls, by the kernel's input protocol
(linux/input.h, protocol B). Standard library only: it runs with the system's Python."""

import struct

EV_SYN, EV_KEY, EV_ABS = 0, 1, 3
SYN_REPORT, SYN_DROPPED = 0, 3
BTN_TOUCH = 0x14A
ABS_X, ABS_Y, SLOT, MT_X, MT_Y, TRACKING = 0x00, 0x01, 0x2F, 0x35, 0x36, 0x39
PROP_DIRECT = 1
EVENT = struct.Struct("llHHi")
EINVAL, EBUSY = 22, 16


def bitmap(bits, size):
    data = bytearray(size)
    for bit in bits:
        if bit // 8 < size:
            data[bit // 8] |= 1 << bit % 8
    return bytes(data)


def sysfs_bitmap(bits):
    """As the kernel prints it: words of 64 bits in hex, the highest first."""
    whole = sum(1 << bit for bit in bits)
    words = []
    while whole or not words:
        words.insert(0, f"{whole & (1 << 64) - 1:x}")
        whole >>= 64
    return " ".join(words)


class Panel:
    def __init__(self, name="Emulated Touchscreen", width=5092, height=2864, resolution=10, fuzz=0, slots=10):
        self.name, self.phys, self.uniq = name, "emulated-usb-1/input0", "0001"
        self.limits = {
            ABS_X: (0, width - 1, fuzz, resolution),
            ABS_Y: (0, height - 1, fuzz, resolution),
            SLOT: (0, slots - 1, 0, 0),
            MT_X: (0, width - 1, fuzz, resolution),
            MT_Y: (0, height - 1, fuzz, resolution),
            TRACKING: (0, 65535, 0, 0),
        }
        if not slots:
            for code in (SLOT, MT_X, MT_Y, TRACKING):
                del self.limits[code]
        self.plain = {ABS_X: 0, ABS_Y: 0, BTN_TOUCH: 0}
        self.slots = [{TRACKING: -1, MT_X: 0, MT_Y: 0} for _ in range(slots)]
        self.current = 0
        self.clock = 0  # CLOCK_REALTIME until set otherwise, as in the kernel
        self.grabbed = False
        self.grabbed_by_another = False
        self.grab_log = []

    def apply(self, events):
        """Keep the slots as the kernel does."""
        for kind, code, value in events:
            if kind == EV_ABS and code == SLOT:
                self.current = value
            elif kind == EV_ABS and code in (TRACKING, MT_X, MT_Y):
                self.slots[self.current][code] = value
            elif code in self.plain and kind == (EV_KEY if code == BTN_TOUCH else EV_ABS):
                self.plain[code] = value

    def down(self):
        return bool(self.plain[BTN_TOUCH]) or any(slot[TRACKING] >= 0 for slot in self.slots)

    def pack(self, events, stamp_s):
        seconds = int(stamp_s // 1)
        micros = round((stamp_s - seconds) * 1e6)
        if micros == 1_000_000:
            seconds, micros = seconds + 1, 0
        return b"".join(EVENT.pack(seconds, micros, *event) for event in events)

    def answer(self, request, given):
        """One ioctl: (result, errno, bytes to return or None). ``given``: what the caller's buffer holds."""
        number, size = request & 0xFF, request >> 16 & 0x3FFF
        if request >> 8 & 0xFF != 0x45:
            return -1, EINVAL, None
        if request == 0x400445A0:
            self.clock = struct.unpack("i", given[:4])[0]
            return 0, 0, None
        if 0x20 <= number < 0x40:
            bits = {0x20: [EV_SYN, EV_KEY, EV_ABS], 0x20 + EV_KEY: [BTN_TOUCH], 0x20 + EV_ABS: list(self.limits)}
            return size, 0, bitmap(bits.get(number, []), size)
        if 0x40 <= number < 0x80:
            return self._axis(number - 0x40)
        if number == 0x0A:
            return self._values(given, size)
        return self._of_the_device(number, size)

    def _axis(self, code):
        """EVIOCGABS."""
        if code not in self.limits:
            return -1, EINVAL, None
        low, high, fuzz, resolution = self.limits[code]
        value = self.current if code == SLOT else self.plain.get(code, 0)
        return 0, 0, struct.pack("6i", value, low, high, fuzz, 0, resolution)

    def _values(self, given, size):
        """EVIOCGMTSLOTS."""
        code = struct.unpack("i", given[:4])[0]
        values = [slot.get(code, 0) for slot in self.slots][: size // 4 - 1]
        return 0, 0, struct.pack(f"{1 + len(values)}i", code, *values)

    def _of_the_device(self, number, size):
        """Version, identity, names, properties, and the state of keys and lights."""
        packed = {
            0x01: struct.pack("i", 0x010001),
            0x02: struct.pack("4H", 3, 0x1234, 0x5678, 1),
            0x84: struct.pack("i", 0),
        }
        texts = {0x06: self.name, 0x07: self.phys, 0x08: self.uniq}
        states = {
            0x09: bitmap([PROP_DIRECT], size),
            0x18: bitmap([BTN_TOUCH] if self.plain[BTN_TOUCH] else [], size),
            **{other: bytes(size) for other in (0x19, 0x1A, 0x1B)},
        }
        if number in packed:
            return 0, 0, packed[number]
        if number in texts:
            text = texts[number].encode()[: size - 1] + b"\0"
            return len(text), 0, text
        return (size, 0, states[number]) if number in states else (-1, EINVAL, None)

    def grab(self, wanted):
        if self.grabbed_by_another:
            return -1, EBUSY
        self.grabbed = wanted
        self.grab_log.append((wanted, self.down()))
        return 0, 0
