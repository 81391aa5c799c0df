"""``python -m draglag.schemas DOCS``: write schemas and pages into a folder."""

import sys
from pathlib import Path

from draglag.schemas.make import write

write(Path(sys.argv[1]))
