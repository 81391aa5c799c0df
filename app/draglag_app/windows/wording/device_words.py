"""What instruments say of themselves, marked for translation: problems, remedies, and notices while they are read.

The drivers say it in English, with names and numbers in it, and know nothing of languages (``library_words`` puts it
into the operator's).
"""

from __future__ import annotations

from draglag_app.windows.wording.button_words import NOTICE_BUTTONS, REMEDY_BUTTONS
from draglag_app.windows.wording.i18n import QT_TRANSLATE_NOOP

# What stands between the address and the remedy of a ``DeviceError``. A longer form comes before one it begins with.
PROBLEMS = (
    # any device
    QT_TRANSLATE_NOOP("Device", "this is not a device address"),
    QT_TRANSLATE_NOOP("Device", "cannot serve as {role}"),
    QT_TRANSLATE_NOOP("Device", "option {name} is unknown here"),
    QT_TRANSLATE_NOOP("Device", "there is no such file"),
    QT_TRANSLATE_NOOP("Device", "the {role} source does not report any more"),
    QT_TRANSLATE_NOOP("Device", "a real device cannot run faster than time"),
    # touchscreen
    QT_TRANSLATE_NOOP("Device", "you have no rights to this device"),
    QT_TRANSLATE_NOOP("Device", "there is no such device"),
    QT_TRANSLATE_NOOP("Device", "this is not an event device"),
    QT_TRANSLATE_NOOP("Device", "{name} is not a touchscreen: it reports {axes}"),
    QT_TRANSLATE_NOOP("Device", "the recording holds no touch: it has {axes}"),
    QT_TRANSLATE_NOOP("Device", "{name} speaks the old multi-touch protocol without slots"),
    QT_TRANSLATE_NOOP("Device", "it was unplugged ({why})"),
    QT_TRANSLATE_NOOP("Device", "its events cannot be stamped on the monotonic clock"),
    QT_TRANSLATE_NOOP("Device", "the calibration belongs to {name}, not to {other}"),
    # laser sensor
    QT_TRANSLATE_NOOP("Device", "there is no network interface called {name}"),
    QT_TRANSLATE_NOOP("Device", "the network interface {name} is switched off"),
    QT_TRANSLATE_NOOP(
        "Device", "the network interface {name} has no carrier: the cable is unplugged or the coupler has no power"
    ),
    QT_TRANSLATE_NOOP("Device", "the network interface {name} cannot be opened"),
    QT_TRANSLATE_NOOP("Device", "this account has no right to send EtherCAT frames (CAP_NET_RAW and CAP_NET_ADMIN)"),
    QT_TRANSLATE_NOOP(
        "Device", "the network interface {name} was not allowed when the EtherCAT helper was installed, only {others}"
    ),
    QT_TRANSLATE_NOOP("Device", "the EtherCAT bus on {name} is in use by another program"),
    QT_TRANSLATE_NOOP("Device", "no EtherCAT device answers on {name}"),
    QT_TRANSLATE_NOOP("Device", "the EtherCAT devices on {name} are not an EK1101 with an EL1252, but: {found}"),
    QT_TRANSLATE_NOOP("Device", "at position {place} on {name} there is no EL1252; the line is: {line}"),
    QT_TRANSLATE_NOOP("Device", "there are {n} EL1252 on {name}, and the laser may be on any; the line is: {line}"),
    QT_TRANSLATE_NOOP("Device", "the EtherCAT devices on {name} stopped answering while being set up ({why})"),
    QT_TRANSLATE_NOOP("Device", "the EtherCAT devices on {name} do not identify themselves: answers get lost"),
    QT_TRANSLATE_NOOP("Device", "the EtherCAT devices on {name} do not get ready: answers come late or get lost"),
    QT_TRANSLATE_NOOP("Device", "the EtherCAT devices on {name} do not enter {state}: {why}"),
    QT_TRANSLATE_NOOP("Device", "the EL1252 on {name} does not keep its set-up (mapping or latch unit)"),
    QT_TRANSLATE_NOOP("Device", "the EtherCAT bus did not get ready"),
    QT_TRANSLATE_NOOP("Device", "the EtherCAT process ended unexpectedly{last}"),
    QT_TRANSLATE_NOOP("Device", "EtherCAT works on Linux only"),
    # WALT
    QT_TRANSLATE_NOOP("Device", "there is no such port"),
    QT_TRANSLATE_NOOP("Device", "you have no rights to this port"),
    QT_TRANSLATE_NOOP("Device", "another program uses this port"),
    QT_TRANSLATE_NOOP("Device", "there is no device behind this port"),
    QT_TRANSLATE_NOOP("Device", "cannot be used as a serial port ({why})"),
    QT_TRANSLATE_NOOP("Device", "cannot be opened ({why})"),
    QT_TRANSLATE_NOOP("Device", "nothing answers at this port"),
    QT_TRANSLATE_NOOP("Device", "what answers at this port is not a WALT"),
    QT_TRANSLATE_NOOP("Device", "it names a version but does not take commands as a WALT does"),
    QT_TRANSLATE_NOOP("Device", "the WALT runs firmware {version}, and only version {known} is known to be understood"),
    QT_TRANSLATE_NOOP("Device", "the WALT was unplugged ({why})"),
    QT_TRANSLATE_NOOP("Device", "the WALT is not connected"),
    QT_TRANSLATE_NOOP("Device", "the WALT takes {seconds} s to answer, too long to compare clocks"),
    QT_TRANSLATE_NOOP("Device", "the WALT does not answer as it should ({why})"),
    QT_TRANSLATE_NOOP("Device", "the WALT does not answer as it should"),
    QT_TRANSLATE_NOOP("Device", "the Python package {name} is not installed"),
    QT_TRANSLATE_NOOP("Device", "the Python module {name} is missing"),
    QT_TRANSLATE_NOOP("Device", "the laser is not open"),
    QT_TRANSLATE_NOOP("Device", "the EtherCAT process cannot be started ({why})"),
    QT_TRANSLATE_NOOP("Device", "the address says role={said} but is used as {role}"),
    QT_TRANSLATE_NOOP("Device", "the WALT sent a curve without samples"),
    QT_TRANSLATE_NOOP("Device", "the WALT stopped in the middle of a curve"),
    QT_TRANSLATE_NOOP("Device", "option position={place} is no place on the line"),
    # the file
    QT_TRANSLATE_NOOP("Device", "cannot be written ({why})"),
    QT_TRANSLATE_NOOP("Device", "cannot be made ({why})"),
    QT_TRANSLATE_NOOP("Device", "there is no such folder"),
    QT_TRANSLATE_NOOP("Device", "exists already and is not overwritten"),
)

REMEDIES = (
    *REMEDY_BUTTONS,
    QT_TRANSLATE_NOOP("Device", "known forms: {forms}"),
    QT_TRANSLATE_NOOP("Device", "for {role} use one of: {forms}"),
    QT_TRANSLATE_NOOP("Device", "known options: {options}"),
    QT_TRANSLATE_NOOP("Device", "check the path"),
    QT_TRANSLATE_NOOP("Device", "check the device"),
    QT_TRANSLATE_NOOP(
        "Device",
        "install the udev rules of draglag and plug it in again, or add yourself to the group input (sudo usermod -aG "
        "input $USER) and log out and in",
    ),
    QT_TRANSLATE_NOOP("Device", "update its driver"),
    QT_TRANSLATE_NOOP("Device", "record a touchscreen, from before it is touched"),
    QT_TRANSLATE_NOOP("Device", "plug it in again"),
    QT_TRANSLATE_NOOP("Device", "plug it in"),
    QT_TRANSLATE_NOOP("Device", "unplug it and plug it in again"),
    QT_TRANSLATE_NOOP("Device", "calibrate again, or forget the calibration"),
    QT_TRANSLATE_NOOP("Device", "choose the one that the coupler is plugged into; this computer has: {others}"),
    QT_TRANSLATE_NOOP("Device", "run: {command}"),
    QT_TRANSLATE_NOOP("Device", "plug the cable into the IN port of the EK1101 and switch on its 24 V supply"),
    QT_TRANSLATE_NOOP("Device", "check that it is an Ethernet interface"),
    QT_TRANSLATE_NOOP("Device", "install the helper once as administrator: {command}"),
    QT_TRANSLATE_NOOP("Device", "close the other program (a second draglag, TwinCAT, a SOEM tool) and try again"),
    QT_TRANSLATE_NOOP("Device", "check that the cable is in the IN port of the EK1101 and that its 24 V supply is on"),
    QT_TRANSLATE_NOOP(
        "Device", "connect the EK1101 (or an EK1100) with the EL1252, or choose the interface they are on"
    ),
    QT_TRANSLATE_NOOP("Device", "write {option} in the laser's address"),
    QT_TRANSLATE_NOOP("Device", "say which in the laser's address: {options}"),
    QT_TRANSLATE_NOOP("Device", "check the cable and the supply of the coupler"),
    QT_TRANSLATE_NOOP("Device", "close programs that keep this computer busy, check the cable and the supply"),
    QT_TRANSLATE_NOOP("Device", "switch the 24 V supply of the coupler off and on"),
    QT_TRANSLATE_NOOP(
        "Device", "switch its 24 V supply off and on; if this stays, the terminal is not a usable EL1252"
    ),
    QT_TRANSLATE_NOOP("Device", "switch the coupler off and on"),
    QT_TRANSLATE_NOOP("Device", "open the laser again"),
    QT_TRANSLATE_NOOP("Device", "record on a Linux computer"),
    QT_TRANSLATE_NOOP("Device", "close the other EtherCAT program"),
    QT_TRANSLATE_NOOP("Device", "to look there: {command}"),
    QT_TRANSLATE_NOOP("Device", "install the helper again: {command}"),
    QT_TRANSLATE_NOOP("Device", "install it again for this interface: {command}"),
    QT_TRANSLATE_NOOP("Device", "{command}, then log in again"),
    QT_TRANSLATE_NOOP("Device", "plug in the cable, switch on the coupler"),
    QT_TRANSLATE_NOOP("Device", "plug the cable into the coupler's IN port, switch it on"),
    QT_TRANSLATE_NOOP(
        "Device",
        "add yourself to the group that owns it (sudo usermod -aG dialout $USER), log out and in again, or install "
        "the udev rules of draglag",
    ),
    QT_TRANSLATE_NOOP("Device", "close it (see: {command})"),
    QT_TRANSLATE_NOOP("Device", "plug the WALT in again"),
    QT_TRANSLATE_NOOP("Device", "plug the WALT in, or use one of: {ports}"),
    QT_TRANSLATE_NOOP("Device", "check that it is a serial port"),
    QT_TRANSLATE_NOOP("Device", "check that it is the WALT's port, unplug it and plug it in again"),
    QT_TRANSLATE_NOOP("Device", "check that it is a WALT with firmware {version}"),
    QT_TRANSLATE_NOOP("Device", "flash firmware {version}, or try it as it is with ?firmware=any"),
    QT_TRANSLATE_NOOP("Device", "plug it into the computer itself, without a hub, and close other programs"),
    QT_TRANSLATE_NOOP("Device", "Check the folder and free space"),
    QT_TRANSLATE_NOOP(
        "Device", "Make room on the disk, or name another place; what was saved before is whole in {file}"
    ),
    QT_TRANSLATE_NOOP("Device", "Name another place; what was saved before is whole in {file}"),
    QT_TRANSLATE_NOOP("Device", "Name another place: the folder was removed while it was recorded into"),
    QT_TRANSLATE_NOOP("Device", "Make room there, or choose another place. The recording is whole in {file}"),
    QT_TRANSLATE_NOOP("Device", "Choose another place. The recording is whole in {file}"),
    QT_TRANSLATE_NOOP("Device", "Choose another name. The recording is whole in {file}"),
    QT_TRANSLATE_NOOP("Device", "Make it first, or choose another. The recording is whole in {file}"),
    QT_TRANSLATE_NOOP("Device", "Choose another place"),
    QT_TRANSLATE_NOOP("Device", "Choose a folder you may write, with room"),
    QT_TRANSLATE_NOOP("Device", "Choose another name"),
    QT_TRANSLATE_NOOP("Device", "calibrate"),
    QT_TRANSLATE_NOOP("Device", "add ?width_mm=W&height_mm=H, or calibrate"),
    QT_TRANSLATE_NOOP("Device", "write position=2 for the first device after the coupler"),
    QT_TRANSLATE_NOOP("Device", "open it first"),
    QT_TRANSLATE_NOOP("Device", "install draglag again"),
    QT_TRANSLATE_NOOP("Device", "check its sensors"),
    QT_TRANSLATE_NOOP("Device", "unplug it and try again"),
    QT_TRANSLATE_NOOP("Device", "check the address"),
    QT_TRANSLATE_NOOP("Device", "use a kernel of 3.4 or later"),
    QT_TRANSLATE_NOOP("Device", "use /dev/input/eventN"),
    QT_TRANSLATE_NOOP("Device", "write ?role={role}"),
)

# What comes while an instrument is read; each is a whole sentence, or two.
NOTICES = (
    *NOTICE_BUTTONS,
    QT_TRANSLATE_NOOP("Device", "was deleted while it was recorded into, and was written again"),
    QT_TRANSLATE_NOOP("Device", "{name} is gone ({why}). Plug it in again; it goes on then."),
    QT_TRANSLATE_NOOP("Device", "{name} is back at {path} and records again."),
    QT_TRANSLATE_NOOP("Device", "The kernel's buffer overflowed: touch events were lost, the gap is marked."),
    QT_TRANSLATE_NOOP("Device", "Touch events are not stamped on the host's monotonic clock: latencies will be wrong."),
    QT_TRANSLATE_NOOP("Device", "The touchscreen is not used exclusively: {why}."),
    QT_TRANSLATE_NOOP(
        "Device",
        "{axis} has a fuzz of {fuzz}: the kernel smooths slow motion, which is a latency of its own. Set it to 0 "
        "unless it is under test.",
    ),
    QT_TRANSLATE_NOOP(
        "Device",
        "{axis} is {said} mm long by its resolution and {size} mm by the panel: measure with a ruler, or calibrate.",
    ),
    QT_TRANSLATE_NOOP("Device", "The laser sensor is lost: {why}. draglag tries to bring it back."),
    QT_TRANSLATE_NOOP("Device", "The laser sensor is lost: its EtherCAT process ended. draglag starts it again."),
    QT_TRANSLATE_NOOP("Device", "The laser sensor is back and records again."),
    QT_TRANSLATE_NOOP(
        "Device", "The laser sensor is back after {seconds} s and records again; edges in between may be missing."
    ),
    QT_TRANSLATE_NOOP("Device", "{n} edge of the laser came too fast to be stamped."),
    QT_TRANSLATE_NOOP("Device", "{n} edges of the laser came too fast to be stamped."),
    QT_TRANSLATE_NOOP(
        "Device",
        "{percent} % of the EtherCAT cycles of the last {seconds} s were disturbed: {parts}. Where edges may be "
        "missing is marked. Close other programs, check the cable and the supply of the coupler.",
    ),
    QT_TRANSLATE_NOOP(
        "Device",
        "{percent} % of the EtherCAT cycles of the last {seconds} s were disturbed: {parts}. Where edges may be "
        "missing is marked.",
    ),
    QT_TRANSLATE_NOOP(
        "Device",
        "The laser was not read for {ms} ms: this computer was busy or the bus did not answer. Where edges may be "
        "missing is marked.",
    ),
    QT_TRANSLATE_NOOP(
        "Device",
        "The EL1252's clock does not follow the bus's: it is {ms} ms off, and so are its edges. Switch the supply of "
        "the coupler off and on.",
    ),
    QT_TRANSLATE_NOOP("Device", "The WALT at {path} is gone ({why}). Plug it in again; it goes on then."),
    QT_TRANSLATE_NOOP("Device", "The WALT at {path} is gone. Plug it in again; it goes on then."),
    QT_TRANSLATE_NOOP("Device", "The WALT at {path} is back and records again; its clock began at 0."),
    QT_TRANSLATE_NOOP("Device", "The WALT's clock jumped; it was set and compared again from here on."),
    QT_TRANSLATE_NOOP("Device", "{n} edge of the laser was lost by the WALT; the gap is marked."),
    QT_TRANSLATE_NOOP("Device", "{n} edges of the laser were lost by the WALT; the gap is marked."),
    QT_TRANSLATE_NOOP("Device", "{n} line from the WALT could not be read."),
    QT_TRANSLATE_NOOP("Device", "{n} lines from the WALT could not be read."),
    # what they say of themselves, and of their clocks
    QT_TRANSLATE_NOOP("Device", "simulated {role}, {screen}"),
    QT_TRANSLATE_NOOP("Device", "kernel stamps, simulated"),
    QT_TRANSLATE_NOOP("Device", "own clock, compared with the host's once a second"),
    QT_TRANSLATE_NOOP("Device", "kernel stamps, CLOCK_MONOTONIC"),
    QT_TRANSLATE_NOOP("Device", "WALT's microseconds, compared with the host's by bounds"),
    QT_TRANSLATE_NOOP("Device", "EtherCAT distributed clock, compared with the host's in every cycle"),
    QT_TRANSLATE_NOOP("Device", "as recorded, moved to the start of the run"),
    QT_TRANSLATE_NOOP("Device", "recording of {name}"),
    QT_TRANSLATE_NOOP("Device", "{names} on {interface}, channel {channel}"),
    # what the session says of any of them
    QT_TRANSLATE_NOOP(
        "Device",
        "{n} samples came with stamps that go back in time or are no times: they are left out and counted as lost, as "
        "further ones will be. Check the device.",
    ),
    # what a look around this computer finds
    QT_TRANSLATE_NOOP("Device", "simulated rig (any screen of the presets)"),
    QT_TRANSLATE_NOOP("Device", "EtherCAT bus on {name}, {n} devices, not an EK1101 with an EL1252: {found}"),
    QT_TRANSLATE_NOOP("Device", "EtherCAT bus on {name}, {n} devices, of which some do not say what they are"),
    QT_TRANSLATE_NOOP("Device", "EtherCAT bus on {name}, {n} devices, {k} of them EL1252"),
    QT_TRANSLATE_NOOP("Device", "EtherCAT bus on {name}, {n} devices"),
    QT_TRANSLATE_NOOP("Device", "EtherCAT bus on {name}, in use"),
    QT_TRANSLATE_NOOP("Device", "network interface {name}: {problem}"),
)

# Why something is lost or cannot be used, within other sentences.
REASONS = (
    QT_TRANSLATE_NOOP("Device", "the EtherCAT line does not answer (cable or supply)"),
    QT_TRANSLATE_NOOP("Device", "the EL1252 does not answer (unplugged, without supply or reset)"),
    QT_TRANSLATE_NOOP("Device", "answers come late and carry old data"),
    QT_TRANSLATE_NOOP("Device", "the EL1252's stamps do not fit the bus's clock (it was reset)"),
    QT_TRANSLATE_NOOP("Device", "the process that runs the bus stands still"),
    QT_TRANSLATE_NOOP("Device", "the EL1252 came up but gives no valid data"),
    QT_TRANSLATE_NOOP("Device", "the cable on {name} is unplugged or the other end is off"),
    QT_TRANSLATE_NOOP("Device", "the network interface {name} is gone: its adapter was unplugged or it was deleted"),
    QT_TRANSLATE_NOOP("Device", "the network interface {name} was switched off ({command})"),
    QT_TRANSLATE_NOOP("Device", "{axes}, and no BTN_TOUCH"),
    QT_TRANSLATE_NOOP("Device", "no axes"),
    QT_TRANSLATE_NOOP("Device", "{n} without an answer"),
    QT_TRANSLATE_NOOP("Device", "{n} without the EL1252"),
    QT_TRANSLATE_NOOP("Device", "{n} with old data"),
    QT_TRANSLATE_NOOP("Device", "{n} with impossible stamps"),
    QT_TRANSLATE_NOOP("Device", "turned by half a turn"),
    QT_TRANSLATE_NOOP("Device", "mirrored left to right"),
    QT_TRANSLATE_NOOP("Device", "mirrored top to bottom"),
    QT_TRANSLATE_NOOP("Device", "another program holds it"),
    QT_TRANSLATE_NOOP("Device", "unplugged"),
    QT_TRANSLATE_NOOP("Device", "hung up"),
    QT_TRANSLATE_NOOP("Device", "end of file"),
    QT_TRANSLATE_NOOP("Device", "No such device"),
    QT_TRANSLATE_NOOP("Device", "No space left on device"),
    QT_TRANSLATE_NOOP("Device", "Permission denied"),
    QT_TRANSLATE_NOOP("Device", "Input/output error"),
    QT_TRANSLATE_NOOP("Device", "it takes no more bytes"),
    QT_TRANSLATE_NOOP("Device", "switched off"),
    QT_TRANSLATE_NOOP("Device", "no carrier"),
    QT_TRANSLATE_NOOP("Device", "no rights to look"),
    QT_TRANSLATE_NOOP("Device", "was not allowed when the EtherCAT helper was installed"),
    QT_TRANSLATE_NOOP("Device", "has the address {ip}"),
    QT_TRANSLATE_NOOP("Device", "has addresses that cannot be read"),
    QT_TRANSLATE_NOOP("Device", "is wireless"),
    QT_TRANSLATE_NOOP("Device", "is a bridge"),
    QT_TRANSLATE_NOOP("Device", "is a tunnel"),
    QT_TRANSLATE_NOOP("Device", "belongs to {name}"),
    QT_TRANSLATE_NOOP("Device", "the EtherCAT helper failed ({why})"),
    QT_TRANSLATE_NOOP("Device", "no EtherCAT device answers"),
)
