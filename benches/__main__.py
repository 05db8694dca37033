"""``python -m benches NAME``."""

from __future__ import annotations

import typer

from benches.contact import contact
from benches.dynamics import dynamics
from benches.elements import elements
from benches.fill import fill
from benches.paper import paper
from benches.precompute import precompute
from benches.record import record
from benches.scale import scale
from benches.sensor import sensor
from benches.strain.beside import strain
from benches.strain.patch_table import patch_table
from benches.strain.references import strain_references
from benches.strain.table import strain_table
from benches.surface import surface
from benches.tick import tick
from benches.touches import touches
from benches.viewer import viewer
from benches.web import web
from benches.zwidth import zwidth
from palpate.cli.app import run_commands

app = typer.Typer(
    help="Measure, beside something else in the same run.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
for command in (
    *(tick, contact, scale, precompute, surface, elements),
    *(paper, dynamics, record, viewer, web, zwidth, touches, fill, sensor),
    strain,
    strain_table,
    patch_table,
    strain_references,
):
    app.command()(command)

if __name__ == "__main__":
    run_commands(app)
