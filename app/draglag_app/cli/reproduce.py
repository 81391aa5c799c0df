"""``draglag reproduce``."""

from __future__ import annotations

from pathlib import Path

import click

from draglag.errors import DataError, cause
from draglag.messages import message
from draglag.system.packages import need
from draglag_app.cli.common import Seed, json_option, print_json, progress, table


@click.command("reproduce")
@click.option("--out", type=click.Path(path_type=Path), metavar="DIR", help="Write reproduction.html and figures here.")
@click.option("--seed", type=Seed(), default=3, show_default=True, help="Another hand, other noise.")
@click.option(
    "--seeds",
    "n_further",
    type=click.IntRange(0, 1000),
    default=20,
    show_default=True,
    help="Further seeds that measure Table 2 again, to count how often its intervals hold the paper's values.",
)
@json_option
def reproduce(out: Path | None, seed: int, n_further: int, as_json: bool) -> None:
    """Measure simulated Screens 1 and 2 and compare Tables 2 and 3 and Figures 4 to 8 with the paper's.

    \b
    Example:
        draglag reproduce --out reproduction
    """
    from draglag.reproduction import reproduce as measure
    from draglag.reproduction.further import table_further
    from draglag.reproduction.write import SIMULATED_WORDS, table_2, table_3, words, write_reproduction

    if out is not None and (out / "reproduction.html").exists():
        raise DataError(
            message("{path}: exists already and is not overwritten", path=out / "reproduction.html"),
            "Choose another folder",
        )
    if out is not None:
        need("matplotlib")
        try:  # before minutes of work rather than after them
            out.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise DataError(
                message("{path}: cannot be made ({why})", path=out, why=cause(error)), "Choose another folder"
            ) from error
    with progress("Reproducing") as on_progress:
        result = measure(seed, on_progress, n_further)
    written = None if out is None else write_reproduction(result, out)
    if as_json:
        print_json(
            {**result.to_dict(), "words": list(words(result)), "page": None if written is None else str(written)}
        )
        return
    click.echo(f"SIMULATED: {SIMULATED_WORDS}\n")
    click.echo("Table 2\n" + table(*table_2(result), left=2))
    if result.further is not None:
        click.echo("\nTable 2 with further seeds\n" + table(*table_further(result.further), left=2))
    click.echo("\nTable 3\n" + table(*table_3(result), left=2) + "\n")
    for text in words(result):
        click.echo(f"- {text}")
    if written is not None:
        click.echo(f"\n{written}")
