"""Whether the stylus is on the screen, from what a touch source reports."""

from __future__ import annotations

from draglag_app.session.events import SamplesArrived

# Where a source does not say when a contact ends: touches older than that are of one that is over.
LOST_AFTER_S = 0.35


class Contact:
    """Follows the contacts that the kernel reports; sources that report none are judged by how old their touches are.

    A stylus that stands still gives no touches and has not left the screen.
    """

    def __init__(self) -> None:
        self._down: set[int] = set()
        self._reported = False

    def take(self, event: SamplesArrived) -> bool:
        """Whether it is on the screen after what has arrived from the touch source."""
        changes = None if event.batch is None else event.batch.contacts
        if changes is not None:
            self._reported = self._reported or len(changes.down) > 0
            for contact, began in zip(changes.contact_id.tolist(), changes.down.tolist(), strict=True):
                (self._down.add if began else self._down.discard)(contact)
        if self._reported:
            return bool(self._down)
        return len(event.t_s) > 0 and event.until_s - float(event.t_s[-1]) < LOST_AFTER_S
