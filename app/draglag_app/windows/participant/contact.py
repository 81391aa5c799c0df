"""Whether the stylus is on the screen."""

from __future__ import annotations

from draglag_app.session.events import SamplesArrived

# Where a source does not say when a contact ends: touches older than that are of one that is over.
LOST_AFTER_S = 0.35


class Contact:
    """Follows the kernel's contacts, as a stylus at rest gives no touches; without them, the age of touches decides."""

    def __init__(self) -> None:
        self._down: set[int] = set()
        self._reported = False

    def take(self, event: SamplesArrived) -> bool:
        """Whether the stylus is on the screen now."""
        changes = None if event.batch is None else event.batch.contacts
        if changes is not None:
            self._reported = self._reported or len(changes.down) > 0
            for contact, began in zip(changes.contact_id.tolist(), changes.down.tolist(), strict=True):
                (self._down.add if began else self._down.discard)(contact)
        if self._reported:
            return bool(self._down)
        return len(event.t_s) > 0 and event.until_s - float(event.t_s[-1]) < LOST_AFTER_S
