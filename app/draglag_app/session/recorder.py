"""The threads of a session."""

from __future__ import annotations

import queue
import threading

from draglag.store import SessionWriter
from draglag_app.session.events import Listener
from draglag_app.session.readers import ReaderThread
from draglag_app.session.saver import Saver
from draglag_devices.source import Paced, Source

# Batches that wait for the disk, of all sources together: half a minute of a touchscreen that reports every event of
# its 1 kHz by itself, together with a laser and a WALT; where time can wait, readers do.
REALTIME_BATCHES = 40_000
QUEUE_BATCHES = 512


class Recorder:
    """Starts and stops readers and saver."""

    def __init__(
        self,
        sources: tuple[Source, ...],
        writer: SessionWriter,
        listener: Listener,
    ) -> None:
        realtime = any(not isinstance(source, Paced) or source.realtime for source in sources)
        inbox: queue.Queue[object] = queue.Queue(REALTIME_BATCHES if realtime else QUEUE_BATCHES)
        self._inbox = inbox
        self._sources = sources
        self._stop_readers = threading.Event()
        self._readers = [ReaderThread(source, inbox, self._stop_readers) for source in sources]
        self.saver = Saver(inbox, writer, listener, [source.role for source in sources])

    def start(self) -> None:
        self.saver.thread.start()
        for reader in self._readers:
            reader.start()

    def stop(self) -> None:
        """Stop reading, save what was read, close the sources; not the file."""
        self._stop_readers.set()
        for reader in self._readers:
            if reader.is_alive():
                reader.join(5.0)
        if self.saver.thread.is_alive():
            self._inbox.put(None)
            self.saver.thread.join(30.0)
        for source in self._sources:
            source.close()
