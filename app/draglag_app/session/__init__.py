"""The acquisition session: one thread a source, one writer, one outcome a run. No Qt."""
