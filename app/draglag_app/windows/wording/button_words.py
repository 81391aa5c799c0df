"""The library's sentences that name commands → the windows', naming buttons."""

from __future__ import annotations

from draglag_app.windows.wording.i18n import QT_TRANSLATE_NOOP

IN_BUTTONS = {
    (
        "Runs lie {off:.1f} ms off the curve beyond their own errors: something other than speed moves "
        "their latency, or the curve is too simple for them. See what draglag gap finds before "
        "using the curve."
    ): QT_TRANSLATE_NOOP(
        "Library",
        (
            "Runs lie {off:.1f} ms off the curve beyond their own errors: something other than speed moves "
            "their latency, or the curve is too simple for them. See what Explain the gap finds, on the"
            " page Gap, before using the curve."
        ),
    ),
    (
        "The stylus measures {mean:.2f} mm ({low:.2f} to {high:.2f}), by ruler {known:g} mm: more than noise and "
        "sensor explain. A wrong diameter, a wrong scale of the touchscreen, a filter that shrinks "
        "circles or a slow sensor can do this. Measure the stylus, calibrate the touchscreen, and "
        "see draglag gap."
    ): QT_TRANSLATE_NOOP(
        "Library",
        (
            "The stylus measures {mean:.2f} mm ({low:.2f} to {high:.2f}), by ruler {known:g} mm: more than noise and "
            "sensor explain. A wrong diameter, a wrong scale of the touchscreen, a filter that shrinks "
            "circles or a slow sensor can do this. Measure the stylus and correct its diameter under Width, calibrate "
            "the touchscreen, and press Explain the gap on the page Gap."
        ),
    ),
    (
        "No touch was recorded in any run. Check which touchscreen is in use: draglag devices lists them."
    ): QT_TRANSLATE_NOOP(
        "Library",
        (
            "No touch was recorded in any run. Check on the page Bench which touchscreen is in use: "
            "Look for devices lists them."
        ),
    ),
    (
        "draglag analyze cannot show this drift: the session holds no comparison of the laser's clock with the host's."
    ): QT_TRANSLATE_NOOP(
        "Library",
        (
            "The page Results cannot show this drift: the session holds no comparison of the "
            "laser's clock with the host's."
        ),
    ),
    (
        "draglag analyze sees the same drift: by the session's comparisons of clocks the laser's "
        "stamps run {rate}. It takes that out before it estimates."
    ): QT_TRANSLATE_NOOP(
        "Library",
        (
            "The page Results shows the same drift: by the session's comparisons of clocks the laser's "
            "stamps run {rate}. It is taken out before anything is estimated."
        ),
    ),
    (
        "draglag analyze sees another drift: by the session's comparisons of clocks the laser's stamps run {rate}."
    ): QT_TRANSLATE_NOOP(
        "Library",
        ("The page Results shows another drift: by the session's comparisons of clocks the laser's stamps run {rate}."),
    ),
    # What to do.
    "See with draglag analyze why the others give none, or record runs at more speeds": QT_TRANSLATE_NOOP(
        "Library", "See on the page Results why the others give none, or record runs at more speeds"
    ),
    "omit --fast and speed=fast": QT_TRANSLATE_NOOP(
        "Library",
        "on the page Bench, untick Simulated time, as fast as possible, and delete speed=fast from the addresses",
    ),
    "plug it in; draglag devices lists what is there": QT_TRANSLATE_NOOP(
        "Library", "plug it in; Look for devices, on the page Bench, lists what is there"
    ),
    "draglag devices lists touchscreens": QT_TRANSLATE_NOOP(
        "Library", "Look for devices, on the page Bench, lists touchscreens"
    ),
    "plug the WALT in; it appears as /dev/ttyACM0 or similar (draglag devices lists it)": QT_TRANSLATE_NOOP(
        "Library",
        "plug the WALT in; it appears as /dev/ttyACM0 or similar (Look for devices, on the page Bench, lists it)",
    ),
    "choose another port: draglag devices lists them": QT_TRANSLATE_NOOP(
        "Library", "choose another port: Look for devices, on the page Bench, lists them"
    ),
    "Make room on the disk, then `draglag verify {file}`, or save it elsewhere with --out": QT_TRANSLATE_NOOP(
        "Library",
        (
            "Make room on the disk, then start draglag again: it offers to save what {file} holds, "
            "there or in another folder"
        ),
    ),
    "Make room there, or give another place with --out": QT_TRANSLATE_NOOP(
        "Library", "Make room there, or choose another folder"
    ),
    "to look there: draglag devices --probe {name}": QT_TRANSLATE_NOOP(
        "Library", "to look there, enter ethercat:{name} as laser sensor on the page Bench and press Check the rig"
    ),
    "Try `draglag verify {path}` to see what can be saved": QT_TRANSLATE_NOOP(
        "Library", "Use another copy of the file, if there is one"
    ),
    "Save it first with `draglag verify {path}`": QT_TRANSLATE_NOOP(
        "Library", "Put it into the folder for sessions and start draglag again: it offers to save what it holds"
    ),
    "Save what it holds with `draglag verify {path}`": QT_TRANSLATE_NOOP(
        "Library", "Start draglag again: it offers to save what it holds"
    ),
    "Use an untouched copy of the file; draglag verify lists all that is wrong": QT_TRANSLATE_NOOP(
        "Library", "Use an untouched copy of the file"
    ),
    "Run draglag verify": QT_TRANSLATE_NOOP("Library", "Use an untouched copy of the file"),
    "Give another name with --out": QT_TRANSLATE_NOOP("Library", "Choose another folder"),
    "Save a model with --form double_exponential": QT_TRANSLATE_NOOP(
        "Library", "Choose the double exponential form on the page Results, then press Explain the gap again"
    ),
    # Found by the check of the rig.
    "make room, or save elsewhere": QT_TRANSLATE_NOOP(
        "Library", "make room, or choose another folder for sessions on the page Preferences"
    ),
    "choose another folder": QT_TRANSLATE_NOOP("Library", "choose another folder for sessions on the page Preferences"),
    "draw while checking": QT_TRANSLATE_NOOP(
        "Library", "press Check the rig again, and draw on the screen while it is watched"
    ),
    "break the beam while checking; if you did, it misses the sensor or passes above the stylus": QT_TRANSLATE_NOOP(
        "Library",
        "press Check the rig again, and move the stylus through the beam while it is watched; if you did, the beam "
        "misses the sensor or passes above the stylus: block it by hand",
    ),
    "measure the panel with a ruler, or calibrate": QT_TRANSLATE_NOOP(
        "Library", "on the page Geometry, press Show the bar and lay a ruler on it, or press Calibrate"
    ),
    "close it (see: {command})": QT_TRANSLATE_NOOP(
        "Library", "close it (another draglag, a terminal of the port), then press Check the rig"
    ),
    # Only who installed draglag can do it.
    "run: {command}": QT_TRANSLATE_NOOP("Library", "ask the administrator who installed draglag to run: {command}"),
    # While an instrument is read.
    (
        "{name} sends events that are no touch ({axes}), and nothing is recorded of them. Choose "
        "another input device: draglag devices lists touchscreens."
    ): QT_TRANSLATE_NOOP(
        "Library",
        (
            "{name} sends events that are no touch ({axes}), and nothing is recorded of them. Choose "
            "another input device: Look for devices, on the page Bench, lists touchscreens."
        ),
    ),
}
