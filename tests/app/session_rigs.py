"""Short protocols and misbehaving sources for tests of the session."""

from __future__ import annotations

from draglag.protocol.presets import load_screen
from draglag.protocol.runs import Protocol
from draglag_app.session import Control, OffscreenDisplay, SessionOptions, events, run_session
from draglag_devices.rig import Rig, make_rig
from draglag_devices.source import Batch, DeviceError

SCREEN = "screen-1"
ROLES = ("touch", "laser", "walt")


def protocol(*speeds, duration_s=4.0, **more):
    """Circles of one duration, and whatever else is given."""
    runs = [{"kind": "circle", "speeds_mm_s": list(speeds), "duration_s": duration_s}] if speeds else []
    return Protocol.model_validate({"name": "test", "rest_s": 1.0, "runs": runs, "source": 'name = "test"', **more})


def fast_rig(roles=("touch", "laser"), seed=1):
    return make_rig(dict.fromkeys(roles, "sim:"), SCREEN, seed, fast=True)


def replaced(rig, source):
    """The rig with one of its sources replaced by another of the same role."""
    return Rig(tuple(source if s.role == source.role else s for s in rig.sources), rig.stage)


def of_role(rig, role):
    return next(source for source in rig.sources if source.role == role)


class Wrapped:
    """A source that behaves like another until set otherwise."""

    def __init__(self, inner):
        self.inner = inner
        self.address, self.role, self.realtime = inner.address, inner.role, inner.realtime
        self.closed = 0

    def open(self):
        return self.inner.open()

    def read(self, timeout_s) -> Batch:
        return self.inner.read(timeout_s)

    def close(self):
        self.closed += 1
        self.inner.close()


class DiesAt(Wrapped):
    """Lost for good at a time; ``error`` says how."""

    def __init__(self, inner, t_s, error=None):
        super().__init__(inner)
        self.t_s = t_s
        self.error = error or DeviceError(inner.address, "the cable was pulled", "plug it in")

    def read(self, timeout_s):
        batch = super().read(timeout_s)
        if batch.until_s >= self.t_s:
            raise self.error
        return batch


class NeedsPanel(Wrapped):
    """A touchscreen whose axes say nothing about millimetres."""

    panel_mm = None

    def use_panel(self, width_mm, height_mm):
        self.panel_mm = (width_mm, height_mm)

    def open(self):
        if self.panel_mm is None:
            raise DeviceError(self.address, "its size is not known", "add ?width_mm=W&height_mm=H, or calibrate")
        return super().open()


class DoesNotOpen(Wrapped):
    def open(self):
        raise DeviceError(self.address, f"no {self.role} there", f"connect the {self.role}")


class Recording:
    """A session run to its end, with all its events."""

    def __init__(self, plan, rig, out, on_event=None, control=None, display=None, **options):
        self.events = []
        self.rig = rig
        self.control = control or Control()
        self.error = None
        self.path = None

        def listener(event: events.Event) -> None:
            self.events.append(event)
            if on_event is not None:
                on_event(self.control, event)

        try:
            self.path = run_session(
                plan,
                rig,
                display or OffscreenDisplay(),
                out,
                SessionOptions(load_screen(SCREEN), countdown_s=0.5, **options),
                listener,
                self.control,
            )
        except Exception as error:  # handed to the test
            self.error = error

    def of(self, kind):
        return [event for event in self.events if isinstance(event, kind)]
