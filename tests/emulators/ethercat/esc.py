"""One EtherCAT slave controller: registers, state machine, EEPROM, sync managers, FMMUs and clock, by the ESC's
register map.

Times are ns of the host's CLOCK_MONOTONIC (``t_ns``, the true time) or ns of the slave's own clock.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from .logical import FMMU_BASE, Fmmu, read_fmmus

MEMORY_END = 0x3000
INIT, PRE_OP, BOOT, SAFE_OP, OP = 1, 2, 3, 4, 8
ERROR = 0x10
# What the state machine allows: one step up, any step down.
_MAY_ENTER = {INIT: (INIT, PRE_OP, SAFE_OP, OP), PRE_OP: (INIT, PRE_OP, SAFE_OP, OP),
              SAFE_OP: (PRE_OP, SAFE_OP, OP), OP: (SAFE_OP, OP)}  # fmt: skip
AL_INVALID_CHANGE, AL_UNKNOWN_STATE = 0x0011, 0x0012

AL_CONTROL, AL_STATUS, AL_CODE = 0x0120, 0x0130, 0x0134
EEPROM_CONFIG, EEPROM_CONTROL, EEPROM_ADDRESS, EEPROM_DATA = 0x0500, 0x0502, 0x0504, 0x0508
DC_PORT_TIME, DC_SYSTEM_TIME, DC_LOCAL_TIME = 0x0900, 0x0910, 0x0918
DC_OFFSET, DC_DELAY, DC_DIFFERENCE = 0x0920, 0x0928, 0x092C
_READ_ONLY = ((0x0000, 0x0010), (0x0110, 0x0112), (0x0130, 0x0136), (0x0900, 0x0910), (0x0918, 0x0920),
              (0x092C, 0x0930), (0x09AE, 0x09D0))  # fmt: skip


@dataclass
class Esc:
    """A slave. ``sii``: its EEPROM; ``drift``, ``start_ns``: its quartz, and its time at power-on.

    ``before_read`` is called with (address, length, t_ns) before memory is read: process data and latches.
    """

    name: str
    sii: bytes
    drift: float = 0.0
    start_ns: int = 0
    hop_ns: int = 600
    before_read: Callable[[int, int, int], None] | None = None
    after_read: Callable[[int, int], None] | None = None
    after_power_on: Callable[[], None] | None = None
    memory: bytearray = field(default_factory=lambda: bytearray(MEMORY_END))
    fmmus: tuple[Fmmu, ...] = ()
    powered_ns: int = 0
    trim_ns: float = 0.0
    stubborn: tuple[tuple[int, int], ...] = ()  # (from, to) of registers that do not take what is written
    ports: int = 0x01  # bit per port with a link
    follows: bool = True  # steers its clock to the reference's
    slow_ns: int = 0  # how long a change of state takes; it then also wants process data before it runs
    exchanged: bool = False  # process data since the last change of state
    _coming: tuple[int, int] | None = None  # (when, state) of a change under way

    def power_on(self, t_ns: int) -> None:
        """All registers as after reset; the clock starts from zero."""
        self.memory[:] = bytes(MEMORY_END)
        self.fmmus = ()
        self.powered_ns, self.trim_ns = t_ns, 0.0
        # Type, revision, build, FMMUs, SMs, RAM in KB, ports (two EBUS), features: DC, 64 bits.
        self.memory[0:10] = bytes((0x11, 0, 1, 0, 8, 8, 8, 0x0A, 0x0C, 0x00))
        self.put(0x0100, 0x0000_0001, 4)
        self.put(AL_STATUS, INIT, 2)
        self.put(AL_CONTROL, INIT, 2)
        self.put(0x0140, 0x04, 1)
        self.put(EEPROM_CONTROL, 0x0040, 2)  # reads give 8 bytes
        self.put(0x0930, 0x1000, 2)
        self.put(0x0934, 0x0C00, 2)
        self.show_ports()
        if self.after_power_on is not None:
            self.after_power_on()

    # --- memory -----------------------------------------------------------------------------------------------

    def put(self, address: int, value: int, size: int) -> None:
        self.memory[address : address + size] = (value % (1 << (8 * size))).to_bytes(size, "little")

    def get(self, address: int, size: int) -> int:
        return int.from_bytes(self.memory[address : address + size], "little")

    @property
    def station(self) -> int:
        return self.get(0x0010, 2)

    @property
    def state(self) -> int:
        return self.get(AL_STATUS, 2)

    def show_ports(self) -> None:
        """DL status: links, and loops closed where nothing is connected."""
        status = 0x0001
        for port in range(4):
            if self.ports & (1 << port):
                status |= (1 << (4 + port)) | (2 << (8 + 2 * port))
            else:
                status |= 1 << (8 + 2 * port)
        self.put(0x0110, status, 2)

    def read(self, address: int, length: int, t_ns: int) -> bytes | None:
        """Physical read; None outside of the memory (the working counter then stays)."""
        if address + length > MEMORY_END:
            return None
        self._arrive(t_ns)
        if self.before_read is not None:
            self.before_read(address, length, t_ns)
        if address < 0x0920 and address + length > DC_SYSTEM_TIME:
            self.put(DC_SYSTEM_TIME, self.system_time(t_ns), 8)
        found = bytes(self.memory[address : address + length])
        if self.after_read is not None:
            self.after_read(address, length)
        return found

    def write(self, address: int, data: bytes, t_ns: int) -> bool:
        end = address + len(data)
        if end > MEMORY_END:
            return False
        if address == DC_SYSTEM_TIME:
            self._follow(data, t_ns)
            return True
        if address <= DC_PORT_TIME < end:
            self._latch_receive_times(t_ns)
        kept = [(max(a, address), self.memory[max(a, address) : min(b, end)])
                for a, b in (*_READ_ONLY, *self.stubborn) if a < end and b > address]  # fmt: skip
        self.memory[address:end] = data
        for start, old in kept:
            self.memory[start : start + len(old)] = old
        if address < FMMU_BASE + 16 * 8 and end > FMMU_BASE:
            self.fmmus = read_fmmus(self.memory)
        if address <= AL_CONTROL < end:
            self._request_state(self.get(AL_CONTROL, 2), t_ns)
        if address <= EEPROM_CONTROL + 1 < end:
            self._eeprom_command()
        return True

    # --- state machine ----------------------------------------------------------------------------------------

    def _request_state(self, request: int, t_ns: int) -> None:
        present, wanted = self.state, request & 0x0F
        if present & ERROR and not request & ERROR:
            return  # an error must be acknowledged first
        if wanted not in _MAY_ENTER:
            self.set_state((present & 0x0F) | ERROR, AL_UNKNOWN_STATE)
        elif (present & 0x0F) not in _MAY_ENTER[wanted]:
            self.set_state((present & 0x0F) | ERROR, AL_INVALID_CHANGE)
        elif self.slow_ns and wanted != INIT:
            if self._coming is None or self._coming[1] != wanted:
                self._coming, self.exchanged = (t_ns + self.slow_ns, wanted), False
        else:
            self._coming = None
            self.set_state(wanted)

    def _arrive(self, t_ns: int) -> None:
        if self._coming is not None and t_ns >= self._coming[0] and (self.exchanged or self._coming[1] != OP):
            self.set_state(self._coming[1])
            self._coming = None

    def set_state(self, state: int, code: int = 0) -> None:
        """AL status and its code."""
        self.put(AL_STATUS, state, 2)
        self.put(AL_CODE, code, 2)

    # --- EEPROM -----------------------------------------------------------------------------------------------

    def _eeprom_command(self) -> None:
        command = self.memory[EEPROM_CONTROL + 1] & 0x07
        self.put(EEPROM_CONTROL, 0x0040, 2)
        if command != 1 or self.memory[EEPROM_CONFIG] & 0x01:
            return
        start = 2 * self.get(EEPROM_ADDRESS, 4)
        self.memory[EEPROM_DATA : EEPROM_DATA + 8] = self.sii[start : start + 8].ljust(8, b"\xff")

    # --- clock ------------------------------------------------------------------------------------------------

    def local_time(self, t_ns: int) -> int:
        elapsed = t_ns - self.powered_ns
        return self.start_ns + elapsed + round(elapsed * self.drift)

    def system_time(self, t_ns: int) -> int:
        """Local time, the offset that the master wrote, and what following the reference added."""
        offset = int.from_bytes(self.memory[DC_OFFSET : DC_OFFSET + 8], "little", signed=True)
        return self.local_time(t_ns) + offset + round(self.trim_ns)

    def _follow(self, data: bytes, t_ns: int) -> None:
        """A write of the reference's time: steer towards it (a simple loop; a real one takes longer)."""
        if not self.follows:
            return
        size = min(len(data), 8)
        reference = int.from_bytes(data[:size], "little") + self.get(DC_DELAY, 4)
        span = 1 << (8 * size)
        ahead = (self.system_time(t_ns) - reference + span // 2) % span - span // 2
        self.put(DC_DIFFERENCE, min(abs(ahead), 0x7FFFFFFF) | (0x80000000 if ahead < 0 else 0), 4)
        if abs(ahead) < 1_000_000_000:
            self.trim_ns -= ahead / 4

    def _latch_receive_times(self, t_ns: int) -> None:
        local = self.local_time(t_ns)
        self.put(DC_LOCAL_TIME, local, 8)
        self.put(DC_PORT_TIME, local & 0xFFFFFFFF, 4)
        if self.ports & 0x02:
            self.put(DC_PORT_TIME + 4, (local + 2 * self.hop_ns) & 0xFFFFFFFF, 4)
