"""The door to the workflow by the posterior: --engine tests.blind.posterior:close."""

from pathlib import Path


def close(folder: Path) -> dict[str, object]:
    """What it makes of one exchange folder, as the design's `gap --json` has it."""
    from draglag.exchange import read_exchange
    from draglag.gap.posterior.closing import close_by_posterior

    return close_by_posterior(read_exchange(folder)).to_dict()
