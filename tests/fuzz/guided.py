"""One reader under inputs guided by coverage (atheris, libFuzzer): ``guided.py READER INPUTS SEED FOLDER CORPUS``.

Ends with 3 without atheris. Failing inputs are written to the folder; inputs that reach new lines to the corpus, for
further calls.
"""

from __future__ import annotations

import random
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

try:
    import atheris
except ImportError:
    raise SystemExit(3) from None

with atheris.instrument_imports(include=["draglag", "draglag_devices", "draglag_app", "tomllib"]):
    from fuzz.mutate import MOST_BYTES, mutated
    from fuzz.readers import readers
    from fuzz.structure import changed_session


def main() -> None:
    name, inputs, seed, faults, corpus = sys.argv[1:6]
    Path(faults).mkdir(parents=True, exist_ok=True)
    Path(corpus).mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="draglag-fuzz-", dir="/dev/shm") as place:
        folder = Path(place) / "folder"
        folder.mkdir()
        reader = next(reader for reader in (*readers(Path(place)), changed_session(Path(place))) if reader.name == name)
        reader.prepare(folder)
        for number, data in enumerate(reader.seeds):
            (Path(corpus) / str(number)).write_bytes(data)

        def change(data: bytes, most: int, number: int) -> bytes:
            rng = random.Random(number)
            if rng.random() < 0.5:
                return bytes(atheris.Mutate(data, most))
            return mutated(data, reader.seeds, rng)[:most]

        options = [
            f"-runs={inputs}",
            f"-seed={int(seed) + 1}",
            f"-max_len={MOST_BYTES}",
            "-timeout=10",
            "-rss_limit_mb=2048",
            f"-artifact_prefix={faults}/",
            "-print_final_stats=1",
        ]
        atheris.Setup(
            [sys.argv[0], *options, corpus],
            lambda data: reader.attempt(folder, data) and None,
            custom_mutator=change,
        )
        atheris.Fuzz()


if __name__ == "__main__":
    main()
