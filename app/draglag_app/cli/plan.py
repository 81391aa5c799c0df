"""``draglag plan``."""

from __future__ import annotations

import click

from draglag_app.cli.common import json_option, number, print_json, table


@click.command("plan")
@click.argument("protocol")
@click.option("--screen", "screen_name", required=True, metavar="NAME", help="Preset or TOML file of the screen.")
@json_option
def plan(protocol: str, screen_name: str, as_json: bool) -> None:
    """Predict the 95 % interval of the latency that each circle of PROTOCOL (a preset or a TOML file) will give on a
    screen like NAME, and that of the curve through them: the simulated participant rehearses every circle.

    \b
    Example:
        draglag plan latency-sweep --screen screen-1
    """
    from draglag.analysis.planning import plan as predict

    found = predict(protocol, screen_name)
    if as_json:
        print_json(found.to_dict())
        return
    click.echo(f"{found.protocol} on {found.screen}: {found.duration_s / 60:.0f} minutes\n")
    rows = [
        [
            run.id,
            number(run.nominal_speed_mm_s, 0),
            str(run.n_edges),
            number(1e3 * run.latency_s, 1),
            f"± {number(1e3 * run.half_interval_s, 2)}",
            run.note or "ok",
        ]
        for run in sorted(found.runs, key=lambda run: run.nominal_speed_mm_s)
    ]
    click.echo(table(["run", "speed mm/s", "edges", "latency ms", "95 % ms", "note"], rows))
    if found.curve_se_s is None:
        click.echo("\nToo few circles for a curve of five parameters: plan at least six speeds.")
        return
    rows = [
        [number(float(v), 0), f"± {number(1.96e3 * float(se), 2)}"]
        for v, se in zip(found.speed_mm_s, found.curve_se_s, strict=True)
    ]
    click.echo("\nThe curve (Eq. 5) through them\n" + table(["speed mm/s", "95 % ms"], rows, left=0))
